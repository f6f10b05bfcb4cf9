"""Everything in the explorer goes by keyboard, which is never lost on the way."""

import pytest
from tests.app.browser import Browser
from tests.app.pages import BRANCH, MAP, RUN, STATES, focused, has, open_page, shown, text

from shapespace.app.explore import Explorer


def focus(browser: Browser, selector: str) -> None:
    """Let the keyboard be at an element."""
    browser.run(f"document.querySelector({selector!r}).focus()")


def camera(browser: Browser) -> list[float]:
    """Angles and nearness of the view; empty as it is at first."""
    told = browser.run("new URLSearchParams(location.hash.slice(1)).get('camera')")
    return [float(one) for one in told.split(",")] if told else []


def test_keys_turn_the_surface_and_bring_it_nearer(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, BRANCH)
    before = shown(browser)
    focus(browser, "#stage")
    views = []
    for key in ("ArrowLeft", "ArrowUp", "+", "+", "-"):
        browser.press(key)
        views.append(camera(browser))
    assert views[0][0] > 0.6
    assert views[1][1] > views[0][1]
    assert views[2][2] < views[3][2] > views[4][2] > 1.0
    # They were for the surface alone.
    assert shown(browser) == before
    browser.press("Home")
    assert camera(browser) == []
    focus(browser, "#diagram")
    browser.press("ArrowRight")
    browser.settle()
    assert camera(browser) == []
    assert shown(browser) != before


def test_a_growth_rate_keeps_the_keyboard(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, BRANCH)
    focus(browser, ".rate[data-index='2']")
    browser.press("Enter")
    browser.wait("!!document.querySelector('#outline .moved')")
    browser.settle()
    assert focused(browser) == "2"
    assert has(browser, ".rate.chosen[data-index='2']")
    browser.press("Enter")
    browser.settle()
    assert not has(browser, "#outline .moved")
    assert focused(browser) == "2"


def test_the_keyboard_goes_from_the_button_to_the_rates_that_it_computes(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, MAP)
    focus(browser, "#compute")
    browser.press("Enter")
    browser.wait("!!document.querySelector('.rate')")
    browser.settle()
    assert focused(browser) == "0"


def test_a_list_keeps_the_keyboard(browser: Browser, whole: Explorer):
    fields = {
        BRANCH: {"choose-y": "area", "choose-colour": "meridional_curvature", "choose-second": "none"},
        STATES: {"choose-of": "area", "choose-state": "1", "choose-mapcolours": "grey"},
    }
    open_page(browser, whole, BRANCH)
    for store, values in fields.items():
        browser.choose("#store", store)
        browser.settle()
        for field, value in values.items():
            focus(browser, f"#{field}")
            browser.choose(f"#{field}", value)
            browser.settle()
            assert focused(browser) == field
            assert browser.run(f"document.getElementById({field!r}).value") == value


def test_the_ends_of_a_row_of_a_map(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, MAP, place="0,40,7")
    for key, value in (("End", 20.0), ("Home", 10.0)):
        browser.press(key)
        browser.settle()
        assert shown(browser)["peclet"] == value
        assert shown(browser)["inverse_hydrodynamic_length"] == pytest.approx(0.5 + 7 * 4.5 / 99)


@pytest.mark.parametrize("store", [RUN, MAP])
def test_every_stop_of_the_keyboard_has_a_name(browser: Browser, explorer: Explorer, store: int):
    open_page(browser, explorer, store)
    browser.run("document.activeElement.blur()")
    stops = []
    for _ in range(40):
        browser.press("Tab")
        stop = browser.run(
            "(({activeElement: e}) => [e.tagName, e.getAttribute('aria-label') || e.labels?.[0]?.textContent.trim()"
            " || e.textContent.trim()])(document)"
        )
        if stop[0] == "BODY":
            break
        stops.append(stop)
    assert len(stops) > 12
    assert all(name for _, name in stops), stops
    assert ["DIV", "All states; arrow keys go from one to the next"] in stops


def test_dialogs_begin_at_their_top_and_give_the_keyboard_back(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, BRANCH)
    for key, head in (("?", "Help"), ("c", "Continue from pitchfork-1")):
        focus(browser, "#diagram")
        browser.press(key)
        assert text(browser, "#dialog-title") == head
        assert browser.run("document.getElementById('dialog').scrollTop") == 0
        assert browser.run("document.getElementById('dialog').contains(document.activeElement)")
        tops = browser.all("dialog, dialog button", "e.getBoundingClientRect().top")
        assert 0 <= tops[1] - tops[0] < 40
        browser.press("Escape")
        assert not browser.run("document.getElementById('dialog').open")
        assert focused(browser) == "diagram"
