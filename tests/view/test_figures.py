"""Figures of made-up runs: they build, say what they show, and nothing is clipped or overlaps."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from matplotlib.text import Text
from tests.pages import assert_apart, assert_on_page, texts_of
from tests.view.synthetic import FRAMES, MAKERS, dataset_of, dying_flow, guided_division

from shapespace.base.errors import InputError
from shapespace.view import style
from shapespace.view.figure import plot_run
from shapespace.view.frames import progress_measure, read_run, snapshot_frames
from shapespace.view.movie import save_movie
from shapespace.view.snapshot import make_camera, make_surface

CURVES = {
    "membrane-protrusion": ("height $d$ ($R_{b}$)", "growth speed ($R_{b}/\\tau$)"),
    "ring-slipping": ("ring position $u_m$", "velocity $v_0$ ($R_{0}/\\tau$)"),
    "polar-swimmer": ("polarity $P$", "velocity $v_0$ ($R_{0}/\\tau$)"),
    "guided-division": ("equator radius $r(1/2)$ ($R_{0}$)",),
}


@cache
def figure_of(scenario: str) -> Figure:
    figure = plot_run(dataset_of(scenario))
    figure.canvas.draw()
    return figure


def arrows_of(figure: Figure) -> Iterator[tuple[Axes, Quiver]]:
    for axes in figure.axes:
        for artist in axes.collections:
            if isinstance(artist, Quiver):
                yield axes, artist


@pytest.mark.parametrize("scenario", MAKERS)
def test_figure_shows_curve_snapshots_and_panels(scenario: str) -> None:
    figure = figure_of(scenario)
    labels = [axes.get_ylabel() for axes in figure.axes]
    for expected in CURVES[scenario]:
        assert expected in labels
    assert any(label.startswith("velocity (") for label in labels)
    assert any(label.startswith("curvature (") for label in labels)
    assert figure.axes[0].get_xlabel() == "time $t$ ($\\tau$)"
    titles = [axes.get_title() for axes in figure.axes if "\\bf" in axes.get_title()]
    assert len(titles) == 5
    assert "0.00 $\\tau$" in titles[0]
    assert ("concentration $c$ ($c_{0}$)" in labels) == (scenario != "membrane-protrusion")
    assert figure.get_figwidth() * 25.4 == pytest.approx(180)


@pytest.mark.parametrize("scenario", MAKERS)
def test_arrows_are_there_and_inside_their_axes(scenario: str) -> None:
    shown = 0
    for axes, quiver in arrows_of(figure_of(scenario)):
        frame = axes.get_window_extent()
        places = quiver.get_offset_transform().transform(quiver.get_offsets())
        hidden = np.broadcast_to(quiver.Umask, len(places))
        shapes = quiver.get_paths()
        assert len(shapes) == len(places)
        for place, shape, is_hidden in zip(places, shapes, hidden, strict=True):
            if is_hidden:
                continue
            points = quiver.get_transform().transform(shape.vertices) + place
            shown += np.ptp(points, axis=0).max() > 1
            assert frame.x0 <= points[:, 0].min()
            assert points[:, 0].max() <= frame.x1
            assert frame.y0 <= points[:, 1].min()
            assert points[:, 1].max() <= frame.y1
    assert shown > 20


def check_labels(figure: Figure) -> None:
    assert_on_page(figure)
    assert_apart(figure)
    assert [text for text in texts_of(figure) if text.get_fontsize() < 7] == []


@pytest.mark.parametrize("scenario", MAKERS)
def test_labels_are_readable_inside_the_page_and_apart(scenario: str) -> None:
    check_labels(figure_of(scenario))


def test_neck_inset_only_where_there_is_a_neck() -> None:
    last = figure_of("guided-division").axes[-1]
    assert len(last.child_axes) == 1
    inset = last.child_axes[0]
    assert inset.get_ylim()[0] < -100
    wide = plot_run(guided_division(frames=6, neck=0.5))
    assert not wide.axes[-1].child_axes


def test_swimmer_has_a_green_arrow_along_its_velocity() -> None:
    greens = [
        quiver
        for _, quiver in arrows_of(figure_of("polar-swimmer"))
        if mpl.colors.to_hex(quiver.get_facecolor()[0]).upper() == style.GREEN
    ]
    assert len(greens) == 5
    assert greens[-1].V[0] < 0
    assert greens[0].Umask.all()


def test_other_datasets_get_a_generic_layout() -> None:
    dataset = dataset_of("ring-slipping").assign_attrs(scenario="mine")
    labels = [axes.get_ylabel() for axes in plot_run(dataset).axes]
    assert "equator radius $r(1/2)$ ($R_{0}$)" in labels
    assert "velocity $v_0$ ($R_{0}/\\tau$)" in labels
    bare = dataset.drop_vars(["concentration", "velocity"]).assign_attrs(model="something else")
    for name in bare.variables:
        bare[name].attrs = {}
    assert "equator radius" in [axes.get_ylabel() for axes in plot_run(bare).axes]


def test_two_frames_and_a_resting_surface_can_be_drawn() -> None:
    dataset = dataset_of("guided-division").isel(time=[0, 1])
    still = dataset.copy(deep=True)
    for name in ("tangential_velocity", "normal_velocity"):
        still[name] = 0 * still[name]
    still["radius"][1] = still["radius"][0]
    for each in (dataset, still):
        figure = plot_run(each)
        figure.canvas.draw()
        assert sum("\\bf" in axes.get_title() for axes in figure.axes) == 2


def test_user_settings_neither_leak_in_nor_out() -> None:
    with mpl.rc_context({"font.size": 30, "axes.facecolor": "black", "text.usetex": True}):
        before = dict(mpl.rcParams)
        figure = plot_run(dataset_of("membrane-protrusion"))
        assert dict(mpl.rcParams) == before
    assert max(text.get_fontsize() for text in figure.findobj(Text)) < 10
    assert not any(text.get_usetex() for text in figure.findobj(Text))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda d: d.isel(time=[0]), "1 frame"),
        (lambda d: d.drop_vars("radius"), "lacks radius"),
        (lambda d: d.drop_vars(["equator_radius", "concentration"]), "lacks equator_radius, concentration"),
        (lambda d: d.assign(radius=d["radius"] * np.nan), "'radius'.* NaN"),
        (lambda d: d.isel(time=slice(None, None, -1)), "does not increase"),
        (lambda d: d.assign(equator_radius=d["radius"]), "'equator_radius' has dimensions"),
    ],
)
def test_unusable_datasets_are_refused_in_one_line(spoil: object, message: str, tmp_path: Path) -> None:
    dataset = spoil(dataset_of("guided-division"))
    with pytest.raises(InputError, match=message) as caught:
        plot_run(dataset)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match=message):
        save_movie(dataset, tmp_path / "run.mp4")
    assert not list(tmp_path.iterdir())


def test_snapshots_follow_change_and_keep_the_ends() -> None:
    dataset = dataset_of("guided-division")
    progress = progress_measure(read_run(dataset), dataset["equator_radius"].values)
    chosen = snapshot_frames(progress, 5)
    assert chosen[0] == 0
    assert chosen[-1] == FRAMES - 1
    assert len(set(chosen)) == 5
    middle = dataset["time"].values[chosen[1:-1]]
    assert np.all((middle > 0.15) & (middle < 0.5)), "ingression takes place at t = 0.22"
    assert snapshot_frames(np.array([0.0, 1.0]), 5) == [0, 1]


def test_states_between_frames_are_interpolated_at_fixed_u() -> None:
    run = read_run(dataset_of("guided-division"))
    before, half, after = (run.profile(10 + w) for w in (0.0, 0.5, 1.0))
    assert half.time == pytest.approx(0.5 * (before.time + after.time))
    expected = 0.5 * (before.radius + np.interp(before.u, after.u, after.radius))
    np.testing.assert_allclose(half.radius, expected, rtol=1e-12)


def test_surface_of_a_sphere_fills_its_disc() -> None:
    run = read_run(dataset_of("guided-division"))
    sphere = run.profile(0)
    surface = make_surface(sphere, make_camera(run, [sphere]))
    drawn = surface.vertices[np.unique(surface.triangles)]
    radius = np.hypot(*drawn.T)
    assert radius.max() == pytest.approx(1, abs=2e-3)
    assert drawn[:, 1].min() == pytest.approx(-1, abs=2e-2)
    assert drawn[:, 1].max() == pytest.approx(1, abs=2e-2)
    assert np.all((surface.colours >= 0) & (surface.colours <= 1))


@pytest.mark.parametrize(
    ("stored", "shown"),
    [
        ("R0/tau", "$R_{0}/\\tau$"),
        ("1/Rb", "$1/R_{b}$"),
        ("kappa/R0**2", "$\\kappa/R_{0}^{2}$"),
        ("R_b/tau_eta", "$R_{b}/\\tau_{\\eta}$"),
        ("um/s", "$\\mathrm{μm}/\\mathrm{s}$"),
        ("pN nm/um^2", "$\\mathrm{pN}\\,\\mathrm{nm}/\\mathrm{μm}^{2}$"),
        ("kappa tau/(R0 c0)", "$\\kappa\\,\\tau/(R_{0}\\,c_{0})$"),
        ("1", ""),
    ],
)
def test_units_are_typeset(stored: str, shown: str) -> None:
    assert style.math_units(stored) == shown


def test_early_change_gets_a_logarithmic_time_axis() -> None:
    figure = plot_run(dying_flow())
    check_labels(figure)
    assert figure.axes[0].get_xscale() == "asinh"
    ticks = figure.axes[0].get_xticks()
    assert ticks[0] == 0
    assert len(ticks) > 3
    assert figure_of("membrane-protrusion").axes[0].get_xscale() == "linear"


def test_a_dying_flow_gets_an_arrow_scale_per_snapshot() -> None:
    def keys(figure: Figure) -> int:
        return sum(
            text.get_color() == style.RED and text.get_text().endswith("$R_{b}/\\tau$") for text in figure.findobj(Text)
        )

    assert keys(figure_of("membrane-protrusion")) == 1
    assert keys(plot_run(dying_flow())) > 1


@pytest.mark.parametrize(
    ("stored", "shown"),
    [
        ("C_phi^phi", "$C_{\\phi}^{\\phi}$"),
        ("v_u", "$v_u$"),
        ("v0", "$v_{0}$"),
        ("gamma0", "$\\gamma_{0}$"),
        ("(xi Delta mu)_0", "$(\\xi \\Delta \\mu)_0$"),
        ("max c", "$\\mathrm{max}\\,c$"),
        ("dF/dt", "$dF/dt$"),
        ("Pe", "$\\mathrm{Pe}$"),
        ("r(1/2)", "$r(1/2)$"),
        ("$r_n$", "$r_n$"),
        ("\\tilde{c}", "$\\tilde{c}$"),
        ("broken_{", "broken_{"),
    ],
)
def test_symbols_are_typeset_or_left_as_text(stored: str, shown: str) -> None:
    assert style.math_symbol(stored) == shown


def test_regulator_colours_fall_evenly_in_lightness() -> None:
    rgb = style.regulator_map()(np.linspace(0, 1, 33))[:, :3]
    luminance = np.where(rgb > 0.04045, ((rgb + 0.055) / 1.055) ** 2.4, rgb / 12.92) @ [0.2126, 0.7152, 0.0722]
    lightness = np.cbrt(luminance)
    steps = -np.diff(lightness)
    assert np.all(steps > 0)
    assert steps.max() < 2.5 * steps.mean()


def test_growth_that_starts_like_a_power_of_time_is_logarithmic():
    """As that of a flat disc, which buckles as the root of time: on a linear axis only its start would be seen."""
    slow = dataset_of("membrane-protrusion")
    fast = slow.assign_coords(time=slow["time"] ** 4 / 8.0)
    speed = slow["normal_velocity"] / np.maximum(fast["time"], 1e-9).values[:, None] ** 0.5
    fast["normal_velocity"] = (("time", "point"), speed.values, slow["normal_velocity"].attrs)
    for dataset, scale in ((slow, "linear"), (fast, "log")):
        figure = plot_run(dataset)
        right = next(axes for axes in figure.axes if axes.get_ylabel().startswith("growth speed"))
        assert right.get_yscale() == scale
        assert right.get_ylim()[1] > dataset["normal_velocity"][:, 0].max()
        figure.canvas.draw()
