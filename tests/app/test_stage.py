"""The three-dimensional view and the drawings beside it: what they show together, and that nothing stays of another state."""

import pytest
from tests.app.browser import Browser
from tests.app.pages import (
    BRANCH,
    DIVISION,
    MAP,
    SEARCH,
    STATES,
    along,
    click_in_map,
    has,
    has_shape,
    middle,
    open_page,
    pixels,
    shown,
    text,
    title,
)

from shapespace.app.explore import Explorer

NOWHERE, SOMEWHERE = "1,0,3", "1,5,0"
"""Points of the second state of a map, which is not there below the onset of swimming."""


def test_a_point_without_a_state_leaves_nothing_on_the_stage(browser: Browser, whole: Explorer):
    open_page(browser, whole, STATES, state=1, place=SOMEWHERE)
    assert abs(shown(browser)["velocity"]) > 1e-2
    assert pixels(browser) > 10_000
    click_in_map(browser, 0.05, 0.95)
    assert "not reached" in text(browser, "#facts")
    assert not has_shape(browser)
    assert pixels(browser) == 0
    assert text(browser, "#scale") == ""
    open_page(browser, whole, STATES, state=1, place=NOWHERE)
    assert pixels(browser) == 0


def test_a_store_that_cannot_be_read_leaves_nothing_on_the_stage(browser: Browser, serve, stores, tmp_path):
    explorer = serve(stores.branch, tmp_path)
    open_page(browser, explorer, 0)
    assert pixels(browser) > 10_000
    browser.press("s")
    browser.settle()
    assert "store.json: is missing" in text(browser, "#trouble")
    assert pixels(browser) == 0


def test_a_place_is_marked_in_all_drawings(browser: Browser, whole: Explorer):
    """From the surface to its outline and profiles, from each of these to the others, and nowhere when the pointer leaves."""
    open_page(browser, whole, DIVISION)
    linked = "#outline .here", "#profiles .cross"
    bare = pixels(browser)

    def marked() -> list[bool]:
        browser.settle()
        return [*(has(browser, one) for one in linked), pixels(browser) != bare]

    assert marked() == [False, False, False]
    browser.move(*middle(browser, "#stage"))
    assert marked()[:2] == [True, True]
    # The equator is under the middle of the view, or near it.
    ends = browser.all("#profiles .axis, #profiles .cross", "[e.x1.baseVal.value, e.x2.baseVal.value]")
    (left, right), (u, _) = ends
    assert 0.3 < (u - left) / (right - left) < 0.7
    x, y = middle(browser, "#stage")
    browser.move(x - 300, y - 150)
    assert marked()[:2] == [False, False]
    for chart in ("#outline .shape", "#profiles .first"):
        browser.move(*along(browser, chart, 0.5))
        assert marked() == [True, True, True], chart
        browser.move(5, 5)
        assert marked() == [False, False, False], chart


def test_flow_that_is_left_where_a_run_is_stationary_is_none(browser: Browser, whole: Explorer):
    """A resting sphere's velocities are round-off: no arrow, flat profiles, and words."""
    open_page(browser, whole, MAP)
    assert "at rest: no flow above 10⁻⁵" in text(browser, "#scale")
    assert "everywhere" in text(browser, "#scale")
    without = pixels(browser)
    browser.press("f")
    assert pixels(browser) == without
    assert {*browser.all("#profiles text.warm", "e.textContent")} >= {"0"}
    open_page(browser, whole, SEARCH)
    browser.press("n")
    browser.settle()
    assert title(browser) == "state-2"
    assert "longest arrow" in text(browser, "#scale")


@pytest.mark.parametrize("name", ["velocity", "polarity"])
def test_round_off_is_no_data(browser: Browser, explorer: Explorer, name: str):
    """Spheres do not swim: what is stored of it, some 1e-15, is drawn as a flat line about zero."""
    open_page(browser, explorer, BRANCH, y=name)
    heights = browser.all("#diagram .stable, #diagram .unstable", "e.getBBox().height")
    assert max(heights) < 0.5
    assert {"0", "1"} <= {*browser.all("#diagram text", "e.textContent")}


def test_how_to_stop_a_mode_is_said_for_keys_and_for_fingers(browser: Browser, explorer: Explorer):
    note = "document.getElementById('note').textContent"
    open_page(browser, explorer, BRANCH, mode=0)
    assert browser.run(note).endswith("Esc stops")
    browser.resize(390, 844, mobile=True)
    open_page(browser, explorer, BRANCH, mode=0)
    assert browser.run(note).endswith("tap the growth rate again to stop")
