"""Curves, searches, and maps of several states with boundaries, as the explorer shows them."""

import json

import numpy as np
import pytest
from tests.app.browser import Browser
from tests.app.pages import (
    BRANCH,
    DIVISION,
    FOLDS,
    FORKS,
    RUN,
    SEARCH,
    STATES,
    along,
    has_shape,
    open_page,
    shown,
    text,
    title,
)
from tests.app.served import MoreStores
from tests.app.stores import swimmer

from shapespace.app.explore import Explorer
from shapespace.study.curve_store import open_curve
from shapespace.study.search_store import open_search
from shapespace.study.steady import steady

WORDS = {
    RUN: "guided-division: run, reached-end",
    BRANCH: "polar-swimmer: branch in peclet, reached-stop",
    FOLDS: "guided-division: curve of folds in ring amplitude and peclet, reached-stop",
    FORKS: "polar-swimmer: curve of pitchforks in peclet and turnover rate, reached-stop",
    SEARCH: "polar-swimmer: search, max-starts",
    STATES: "polar-swimmer: diagram over peclet and turnover rate, complete",
}


def test_the_head_says_what_a_store_holds(browser: Browser, whole: Explorer):
    open_page(browser, whole, RUN)
    for store, words in WORDS.items():
        browser.choose("#store", store)
        browser.settle()
        assert text(browser, "#about") == words


@pytest.mark.parametrize(("store", "name", "of"), [(FOLDS, "folds", "fold"), (FORKS, "forks", "pitchfork")])
def test_points_of_a_curve_have_growth_rates_of_which_one_vanishes(
    browser: Browser, whole: Explorer, more: MoreStores, store: int, name: str, of: str
):
    curve = open_curve(getattr(more, name))
    open_page(browser, whole, store)
    assert text(browser, "#legend") == f"{of}s"
    for key, place in (("Home", 0), ("ArrowRight", 1), ("End", -1)):
        browser.press(key)
        browser.settle()
        keys = dict(zip(curve.keys, curve.points[place].parameters, strict=True))
        assert shown(browser) == {**curve.points[place].observables, **keys}
        assert has_shape(browser)
        browser.click("#compute")
        browser.wait("!!document.querySelector('.rate')")
        browser.settle()
        vanishing = browser.all(".rate.neutral", "Math.abs(e.dataset.real)")
        assert len(vanishing) == 1
        assert vanishing[0] < 1e-6
        assert text(browser, ".badge") == "marginal"


def test_a_search_tells_stable_states_from_others(browser: Browser, whole: Explorer, more: MoreStores):
    states = open_search(more.search).states
    open_page(browser, whole, SEARCH)
    kinds = browser.all("#diagram .special", "[e.dataset.label, e.classList.contains('unstable')]")
    assert dict(kinds) == {state.label: state.n_unstable > 0 for state in states}
    assert {*dict(kinds).values()} == {True, False}
    fills = browser.all("#diagram .special", "getComputedStyle(e).fill")
    assert len({*fills}) == 2
    assert browser.all("#legend span", "e.textContent") == ["stable", "unstable"]
    assert {*browser.all("#legend .special", "getComputedStyle(e).fill")} == {*fills}
    browser.click("#diagram .special", 1)
    browser.settle()
    assert title(browser) == states[1].label
    assert shown(browser) == states[1].observables


def test_where_stability_changes_a_state_is_marginal(browser: Browser, whole: Explorer):
    open_page(browser, whole, DIVISION)
    for label, words in (("fold-1", "marginal"), ("pitchfork-1", "1 growing mode, one marginal")):
        browser.click(f"#diagram [data-label='{label}'].special")
        browser.settle()
        assert title(browser) == label
        assert text(browser, ".badge") == words
        assert text(browser, "#tip").endswith(words)


def test_a_map_of_two_states_shows_either(browser: Browser, whole: Explorer):
    open_page(browser, whole, STATES, state=1, place="1,5,1")
    moving = shown(browser)
    found = steady(swimmer(peclet=moving["peclet"], turnover_rate=moving["turnover_rate"]))
    assert abs(moving["velocity"]) == pytest.approx(abs(found.observables["velocity"]), rel=1e-6)
    assert has_shape(browser)
    browser.choose("#choose-state", "0")
    browser.settle()
    assert title(browser) == "trivial"
    resting = shown(browser)
    assert resting["peclet"] == moving["peclet"]
    assert abs(resting["velocity"]) < 1e-9


def test_boundaries_of_a_map_are_told_apart(browser: Browser, whole: Explorer):
    """By their dashes, in the legend as in the map, and by words under the pointer."""
    open_page(browser, whole, STATES)
    legend = browser.all("#legend span", "e.textContent")
    assert {"folds", "pitchforks"} <= {*legend}
    dashes = {
        kind: browser.all(f"{where} .boundary.{kind}", "getComputedStyle(e).strokeDasharray")
        for kind in ("fold", "pitchfork")
        for where in ("#diagram", "#legend")
    }
    assert dashes["fold"][0] != dashes["pitchfork"][0]
    for kind in dashes:
        assert [*{*browser.all(f".boundary.{kind}", "getComputedStyle(e).strokeDasharray")}] == dashes[kind][:1]
        browser.move(*along(browser, f"#diagram .boundary.{kind}", 0.4))
        browser.wait("!document.getElementById('tip').hidden")
        assert text(browser, "#tip").endswith(f"boundary: {kind}s")


def test_special_points_beyond_a_map_are_not_named_beside_it(browser: Browser, whole: Explorer):
    open_page(browser, whole, STATES)
    browser.run(
        "import('./session.js').then(({ session }) => {"
        "for (const { keys, labels } of session.overview.map.boundaries) labels.push(['far', 'cusp', 1e3, 1e3]); })"
    )
    browser.press("t")
    browser.settle()
    assert (
        browser.all("#diagram .special", "e.dataset.label")
        == browser.all("#diagram .special-label", "e.textContent")
        == ["cusp-1"]
    )


def test_boundaries_show_on_pale_and_on_dark_maps(browser: Browser, whole: Explorer):
    """The line is dark and its rim pale in both themes, as maps are the same in both."""
    open_page(browser, whole, STATES, theme="light")
    for _ in range(2):
        for which, (least, most) in ((".fold", (0, 60)), (".rim", (200, 255))):
            colour = browser.run(f"getComputedStyle(document.querySelector('#diagram .boundary{which}')).stroke")
            channels = [int(one) for one in colour[4:-1].split(",")]
            assert all(least <= one <= most for one in channels), (which, colour)
        browser.press("t")


def test_a_value_that_is_everywhere_is_said_to_be(browser: Browser, whole: Explorer):
    """No bar of colours that are nowhere, and axes around one value whose numbers are short."""
    open_page(browser, whole, STATES, of="reduced_volume")
    assert "everywhere" not in text(browser, "#legend")
    open_page(browser, whole, BRANCH)
    assert text(browser, "#scale").endswith("1 c0 everywhere")
    assert (
        max(len(one) for one in browser.all("#diagram text, #profiles text", "e.textContent") if one[:1].isdigit()) <= 6
    )
    browser.press("1")
    browser.wait("!!document.querySelector('#outline .moved')")
    assert "everywhere" not in text(browser, "#scale")


def test_units_are_printed_as_in_figures(browser: Browser, serve, tmp_path):
    from shapespace.study.branching import branch

    sizes = {"length": "10 um", "energy": "1e-17 J", "time": "60 s", "concentration": "1/um^2"}
    branch(swimmer().in_units(**sizes), "peclet", 24.0, start=20.0, state="trivial", out=tmp_path / "branch")
    open_page(browser, serve(tmp_path / "branch"), 0)
    units = "".join(browser.all("#facts small, .chart text, #scale", "e.textContent"))
    assert "μm" in units
    assert "um" not in units


def test_long_names_leave_their_symbols_in_sight(browser: Browser, whole: Explorer):
    open_page(browser, whole, DIVISION)
    for width in (1280, 900, 390):
        browser.resize(width, 800, mobile=width < 600)
        inside = browser.all(
            "#facts dt i",
            "[e.getBoundingClientRect().right, e.closest('dt').getBoundingClientRect().right, e.textContent]",
        )
        assert len(inside) > 20
        assert all(right <= edge + 1 for right, edge, symbol in inside), json.dumps(inside)
    assert np.isfinite([*shown(browser).values()]).all()
