"""A link brings a view back, in a new page and in one that is open; what it has that makes no sense is left out."""

from typing import Any

import pytest
from tests.app.browser import Browser
from tests.app.pages import BRANCH, MAP, RUN, STATES, address, go_to, has, has_shape, open_page, shown, title

from shapespace.app.explore import Explorer

VIEW = {
    STATES: {"state": "1", "place": "1,5,1", "of": "polarity", "mapcolours": "viridis", "camera": "1.100,0.500,2.000"},
    BRANCH: {"place": "3", "mode": "1", "x": "area", "y": "velocity", "colours": "grey", "arrows": "0", "theme": "dark",
             "first": "radius", "second": "none", "colour": "meridional_curvature", "camera": "-0.300,0.100,0.500"},
}  # fmt: skip


def told(browser: Browser) -> dict[str, str]:
    """What the address says of the view."""
    return dict(browser.run("[...new URLSearchParams(location.hash.slice(1))]"))


def look(browser: Browser) -> list[Any]:
    """What is to be seen: numbers, choices, the mode, the theme."""
    return [
        shown(browser),
        title(browser),
        browser.all(".tools select", "e.value"),
        has(browser, "#outline .moved"),
        browser.run("document.documentElement.dataset.theme"),
    ]


@pytest.mark.parametrize("store", VIEW)
def test_a_link_brings_the_view_back_in_a_new_page_and_in_an_open_one(browser: Browser, whole: Explorer, store: int):
    view = VIEW[store]
    open_page(browser, whole, store, **view)
    browser.wait("document.body.dataset.busy === 'false'")
    assert told(browser) == {"store": str(store)} | view
    before = look(browser)
    assert before[3] == ("mode" in view)
    # From another store, and from the first view of the same one.
    open_page(browser, whole, RUN)
    for other in ({}, {"store": store}):
        go_to(browser, address(whole, **{"store": RUN} | other))
        assert told(browser).get("camera") is None
        go_to(browser, address(whole, store, **view))
        assert told(browser) == {"store": str(store)} | view
        assert look(browser) == before


def test_the_camera_of_a_link_is_that_of_the_stage(browser: Browser, explorer: Explorer):
    """In an open page too; the picture tells."""
    picture = "document.querySelector('#stage canvas').toDataURL()"
    open_page(browser, explorer, BRANCH)
    first = browser.run(picture)
    go_to(browser, address(explorer, BRANCH, camera="2.000,0.900,3.000"))
    turned = browser.run(picture)
    assert turned != first
    open_page(browser, explorer, BRANCH, camera="2.000,0.900,3.000")
    assert browser.run(picture) == turned
    go_to(browser, address(explorer, BRANCH))
    assert browser.run(picture) == first


@pytest.mark.parametrize("store", [RUN, BRANCH, MAP])
def test_what_makes_no_sense_in_a_link_is_as_if_it_were_not_there(browser: Browser, explorer: Explorer, store: int):
    open_page(browser, explorer, store)
    usual = look(browser)
    names = (
        "place",
        "x",
        "y",
        "of",
        "state",
        "mapcolours",
        "colour",
        "colours",
        "arrows",
        "first",
        "second",
        "mode",
        "camera",
        "theme",
    )
    for value in ("zzz", "999999", "toString", "%00"):
        go_to(browser, address(explorer, store, **dict.fromkeys(names, value)))
        assert has_shape(browser)
        assert look(browser) == usual, value
        assert browser.run("document.getElementById('trouble').hidden")
    # What is read when the page begins is the same.
    open_page(browser, explorer, store, **dict.fromkeys(names, "zzz"))
    assert browser.run("document.body.dataset.stage") == "ready"
    assert look(browser) == usual


@pytest.mark.parametrize("value", ["zzz", "99"])
def test_a_store_that_is_not_there_is_the_first_one(browser: Browser, explorer: Explorer, value: str):
    browser.open(f"{explorer.address}#store={value}&place=1")
    browser.settle()
    assert browser.run("document.getElementById('store').value") == "0"
    assert has_shape(browser)
    assert browser.run("document.getElementById('trouble').hidden")


def test_the_next_store_is_opened_as_its_list_does(browser: Browser, explorer: Explorer):
    """What belongs to the one before stays there."""
    view = {"x": "area", "y": "velocity", "place": 3, "mode": 1}
    links = []
    for act in (lambda: browser.press("s"), lambda: browser.choose("#store", MAP)):
        open_page(browser, explorer, BRANCH, **view, theme="dark")
        act()
        browser.settle()
        links.append(told(browser))
    assert links[0] == links[1]
    assert links[0].keys() == {"store", "place", "theme"}


def test_stores_in_quick_succession_end_with_the_last(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, RUN)
    for store in (MAP, RUN, MAP, BRANCH):
        browser.choose("#store", store)
    browser.settle()
    assert title(browser) == "pitchfork-1"
    assert has(browser, "#diagram .unstable")
