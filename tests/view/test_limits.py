"""Scales of axes: round-off stays small, and decades on both sides of zero have ticks apart and no kink."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.text import Text
from tests.pages import assert_apart, assert_on_page
from tests.view.synthetic import dataset_of

from shapespace.view import style
from shapespace.view.budget import plot_budget
from shapespace.view.diagram import _scale
from shapespace.view.figure import plot_run
from shapespace.view.limits import not_magnified, scale_by_powers


@pytest.mark.parametrize(
    ("values", "scale", "limits"),
    [
        ((-3e-9, 2e-9), 1.0, (-0.5, 0.5)),
        ((25.0, 25.0 + 1e-6), 1.0, (12.5, 37.5)),
        ((1e-4, 2e-4), 1.0, (1e-4, 2e-4)),
        ((-3e-9, 2e-9), 1e-6, (-3e-9, 2e-9)),
    ],
)
def test_round_off_is_not_magnified(values: tuple[float, float], scale: float, limits: tuple[float, float]):
    assert not_magnified(*values, scale) == pytest.approx(limits, rel=1e-6, abs=1e-9)


def test_a_run_at_rest_is_drawn_at_rest():
    """Velocities of 1e-9 give no arrows, and axes on which they are straight lines."""
    still = dataset_of("polar-swimmer").copy(deep=True)
    for name in ("tangential_velocity", "normal_velocity", "velocity"):
        still[name] = 1e-9 * still[name]
    figure = plot_run(still)
    for axes in figure.axes:
        if axes.get_ylabel().startswith("velocity"):
            assert np.ptp(axes.get_ylim()) > 0.5
    keys = [text for text in figure.findobj(Text) if text.get_color() == style.RED]
    assert keys == []


def test_a_map_of_round_off_has_one_colour():
    values = 1e-10 * np.random.default_rng(0).normal(size=(1, 4, 4))
    norm, colours = _scale("velocity", values, 1.0)
    assert np.ptp(colours(norm(values[0]))[..., :3].reshape(-1, 3), axis=0).max() < 0.01


def dying_powers() -> xr.Dataset:
    """Powers that fall by ten decades, some of them negative, as those of the membrane."""
    time = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 60)])
    heat = 1e6 / (1.0 + 1e6 * time)
    powers = {
        "shear_dissipation": heat, "friction_dissipation": 0.03 * heat, "dissipation": 1.03 * heat,
        "energy_rate": -2.0 * heat, "boundary_power": -0.5 * heat, "energy_residual": 1e-4 * heat, "energy": 5.0 + heat,
    }  # fmt: skip
    data = xr.Dataset(
        {name: ("time", values, {"units": "kappa/tau"}) for name, values in powers.items()}, {"time": time}
    )
    data["time"].attrs = {"symbol": "t", "units": "tau"}
    return data


def test_powers_over_decades_have_ticks_apart_and_no_kinks():
    figure = plot_budget(dying_powers())
    assert_on_page(figure)
    assert_apart(figure)
    powers = figure.axes[1]
    assert powers.get_yscale() == "asinh"
    ticks = powers.get_yticks()
    assert 0.0 in ticks
    assert ticks.min() < 0.0 < ticks.max()
    assert figure.axes[-1].get_xscale() == "asinh"


def test_ticks_keep_apart_whatever_the_span():
    for span in ((-1e6, 1e2), (0.0, 3e3), (-20.0, 20.0), (-1e-3, 1e5)):
        axes = style.new_figure(0.5, 40.0).add_subplot()
        axes.set_ylim(*span)
        scale_by_powers(axes, "y", 1.0, span, room=0.1)
        ticks = axes.yaxis.get_transform().transform(axes.get_yticks())
        low, high = axes.yaxis.get_transform().transform(np.array(span))
        assert (np.diff(ticks) > 0.099 * (high - low)).all()
