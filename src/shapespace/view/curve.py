"""The figure of a curve: the plane of its two keys, with cusps and other special points marked and named."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from shapespace.study.curve_store import Curve, outline
from shapespace.view import style
from shapespace.view.labels import label_points

COLOURS = {"fold": style.BLUE, "pitchfork": style.PURPLE}
WORDS = {
    "fold": "folds",
    "pitchfork": "pitchforks",
    "transcritical": "transcritical points",
    "branch-point": "branch points",
}
RIM = (withStroke(linewidth=3.0, foreground="white"),)
"""Around lines and marks, so that they show on a map of any colour."""
MARKS = {
    "cusp": "^",
    "fold-pitchfork": "D",
    "degenerate-pitchfork": "D",
    "bogdanov-takens": "o",
    "branch-point": "D",
    "turn": "s",
    "user": "|",
    "end": "",
    "reached-stop": "",
}
"""By kind; physical ends and stalls are crosses."""
HEIGHT_MM = 110.0


def plot_curve(curve: Curve) -> Figure:
    """The curve, the first key to the right and the second upwards."""
    with style.house_style():
        figure = style.new_figure(0.75, HEIGHT_MM)
        axes = figure.add_subplot()
        draw_curve(axes, curve, curve.keys)
        axes.margins(0.06, 0.08)
        axes.set_xlabel(style.quantity_label(curve.scenario.scales, curve.keys[0]))
        axes.set_ylabel(style.quantity_label(curve.scenario.scales, curve.keys[1]))
        axes.legend(loc="best")
        label_points(axes, [(one.label, *one.parameters) for one in curve.special_points if one.kind != "end"])
    return figure


def draw_curve(axes: Axes, curve: Curve, keys: tuple[str, str], named: bool = True) -> None:
    """The curve with its special points, the first of these keys to the right; named: for a legend."""
    order = [curve.keys.index(key) for key in keys]
    colour = COLOURS.get(curve.of, style.GREEN)
    label = WORDS[curve.of] if named else None
    axes.plot(*outline(curve.points)[order], color=colour, label=label, path_effects=RIM)
    for point in curve.special_points:
        x, y = point.parameters[order]
        axes.plot(x, y, MARKS.get(point.kind, "X"), color=style.RED, markersize=4.0, zorder=3, path_effects=RIM)
