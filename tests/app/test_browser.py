"""The explorer in Chromium: what it shows is what is stored, it asks no other machine, and everything goes by keyboard too."""

import json
import math
from typing import Any

import numpy as np
import pytest
from tests.app.browser import Browser
from tests.app.pages import BRANCH, MAP, RUN, has_shape, open_page, shown, title
from tests.app.served import Stores
from tests.app.stores import made_up

from shapespace.app.explore import Explorer
from shapespace.study.branch_store import BranchStore, open_branch
from shapespace.study.store import RunStore

LABEL = "pitchfork-1"


def test_a_branch_shows_the_numbers_of_its_points(browser: Browser, explorer: Explorer, stores: Stores):
    branch = open_branch(stores.branch)
    open_page(browser, explorer, BRANCH)
    assert title(browser) == LABEL
    assert shown(browser) == {**branch[LABEL].observables, "peclet": branch[LABEL].parameter}
    assert {*browser.all(".special-label", "e.textContent")} == {
        point.label for point in branch.special_points if point.kind != "end"
    }
    assert browser.run("document.querySelectorAll('#diagram .stable').length") == 1
    assert browser.run("document.querySelectorAll('#diagram .unstable').length") == 1
    rates = browser.all(".rate", "[e.dataset.real, e.dataset.imaginary]")
    assert np.array_equal(np.array(rates, float), branch[LABEL].growth_rates)


def test_clicking_points_and_keys_lead_along_a_branch(browser: Browser, explorer: Explorer, stores: Stores):
    store = BranchStore.open(stores.branch)
    open_page(browser, explorer, BRANCH, place=0)
    assert shown(browser)["velocity"] == store.read(0).observables["velocity"]
    browser.click("#diagram .special")
    browser.settle()
    assert title(browser) == next(point.label for point in open_branch(stores.branch).special_points)
    browser.press("Home")
    browser.settle()
    browser.press("ArrowRight")
    browser.settle()
    assert shown(browser)["peclet"] == store.read(1).parameter
    browser.press("n")
    browser.settle()
    assert title(browser) == LABEL
    assert "place=" in browser.run("location.hash")


def test_an_eigenvalue_sets_the_surface_swinging(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, BRANCH)
    assert not browser.run("!!document.querySelector('#outline .moved')")
    leading = browser.all(".rate .dot", "[e.getBoundingClientRect().x + 4, e.getBoundingClientRect().y + 4]")[0]
    browser.click_at(*leading)
    browser.settle()
    assert browser.wait("!!document.querySelector('#outline .moved')")
    # At the onset of swimming the sphere stays one: only the concentration changes.
    note = "document.getElementById('note').textContent"
    assert "mode 1, of the concentration alone" in browser.run(note)
    path = "document.querySelector('#profiles .first').getAttribute('d')"
    first = browser.run(path)
    assert browser.wait(f"{path} !== {json.dumps(first)}")
    browser.press("Escape")
    browser.settle()
    assert not browser.run("!!document.querySelector('#outline .moved')")
    browser.press("2")
    browser.settle()
    assert "mode 2" in browser.run(note)
    assert browser.run("location.hash").endswith("mode=1")


def test_growth_rates_are_computed_where_they_are_not_stored(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, BRANCH, place=1)
    browser.press("1")
    browser.settle()
    assert browser.wait("!!document.querySelector('#outline .moved')")
    open_page(browser, explorer, MAP)
    assert not browser.run("!!document.querySelector('.rate')")
    browser.click("#compute")
    browser.wait("!!document.querySelector('.rate')")
    real = np.array(browser.all(".rate", "e.dataset.real"), float)
    assert real.max() < 0.0


def test_a_run_plays_from_its_start_to_its_end(browser: Browser, explorer: Explorer, stores: Stores):
    run = RunStore.open(stores.run)
    open_page(browser, explorer, RUN)
    last = run.read(-1)
    assert shown(browser) == {**last.observables, "time": last.time}
    browser.choose("#time", 2)
    browser.settle()
    assert shown(browser)["time"] == run.read(2).time
    browser.press("Home")
    browser.settle()
    browser.press(" ")
    seen = set()
    while browser.run("document.getElementById('play').getAttribute('aria-label')") == "Pause":
        seen.add(browser.run("document.getElementById('time').value"))
    browser.settle()
    # A busy machine skips some.
    assert seen - {"0", str(len(run) - 1)}
    assert shown(browser)["time"] == last.time


def test_a_map_of_many_points_shows_any_of_them(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, MAP)
    canvas = json.loads(
        browser.run("JSON.stringify(document.querySelector('#diagram canvas').getBoundingClientRect())")
    )
    for across, up in ((0.105, 0.895), (0.675, 0.225)):
        at = canvas["x"] + across * canvas["width"], canvas["y"] + (1.0 - up) * canvas["height"]
        browser.move(*at)
        i, j = int(across * 100), int(up * 100)
        x, y = 10.0 + i * 10.0 / 99, 0.5 + j * 4.5 / 99
        assert "velocity" in browser.wait(
            "!document.getElementById('tip').hidden && document.getElementById('tip').textContent"
        )
        browser.click_at(*at)
        browser.settle()
        numbers = shown(browser)
        assert (numbers["peclet"], numbers["inverse_hydrodynamic_length"]) == pytest.approx((x, y), rel=1e-12)
        assert numbers["velocity"] == float(made_up(numbers["peclet"], numbers["inverse_hydrodynamic_length"]))
        assert numbers["area"] == pytest.approx(4.0 * math.pi)
        assert has_shape(browser)
    browser.press("ArrowUp")
    browser.settle()
    assert shown(browser)["inverse_hydrodynamic_length"] > numbers["inverse_hydrodynamic_length"]


def test_regimes_are_colours_with_their_words(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, MAP, of="regime")
    assert browser.all("#legend span", "e.textContent") == ["resting", "swimming"]
    canvas = "document.querySelector('#diagram canvas')"
    x, y = browser.run(
        f"(() => {{ const b = {canvas}.getBoundingClientRect(); return [b.x + 0.1 * b.width, b.y + 0.4 * b.height]; }})()"
    )
    browser.move(x, y)
    told = browser.wait("!document.getElementById('tip').hidden && document.getElementById('tip').textContent")
    i, j = 10, 99 - 40
    is_swimming = made_up(np.float64(10.0 + i * 10.0 / 99), np.float64(0.5 + j * 4.5 / 99)) < -1.5
    assert told.startswith("swimming" if is_swimming else "resting")
    pixels = browser.run(f"[...{canvas}.getContext('2d').getImageData(10, 40, 1, 1).data]")
    sample = browser.all("#legend .kind", "getComputedStyle(e).backgroundColor")[int(is_swimming)]
    assert sample == f"rgb({', '.join(map(str, pixels[:3]))})"


def test_what_is_chosen_comes_back_by_its_address(browser: Browser, explorer: Explorer):
    open_page(browser, explorer, BRANCH)
    for chosen, value in (("choose-y", "velocity"), ("choose-x", "area"), ("choose-colour", "meridional_curvature")):
        browser.choose(f"#{chosen}", value)
    browser.press("t")
    browser.press("f")
    browser.press("End")
    browser.settle()
    before = shown(browser)
    chosen = browser.all(".tools select", "e.value"), browser.run("document.documentElement.dataset.theme")
    browser.open(browser.run("location.href"))
    browser.settle()
    assert shown(browser) == before
    assert (browser.all(".tools select", "e.value"), browser.run("document.documentElement.dataset.theme")) == chosen
    assert "velocity" in chosen[0]


def clipboard(browser: Browser) -> str:
    """What was copied last."""
    browser.wait("!document.getElementById('toast').hidden")
    return str(browser.run("navigator.clipboard.readText()"))


def test_python_commands_and_links_are_copied(browser: Browser, explorer: Explorer, stores: Stores):
    browser.send("Browser.grantPermissions", permissions=["clipboardReadWrite", "clipboardSanitizedWrite"])
    open_page(browser, explorer, BRANCH)
    browser.click("#python")
    names: dict[str, Any] = {}
    exec(clipboard(browser), names)
    assert names["state"].observables["area"] == pytest.approx(4.0 * math.pi)
    browser.press("c")
    browser.choose("dialog input", 77)
    told = browser.all("dialog pre", "e.textContent")
    assert len(told) == 4
    for number, command in enumerate(told):
        browser.click("dialog section button", number)
        assert clipboard(browser) == command
        assert command.startswith("shapespace ")
        assert f"{stores.branch}:{LABEL}" in command
    assert "--vary peclet --stop 77 " in told[2]
    browser.press("Escape")
    browser.press("ArrowRight")
    browser.settle()
    for copy in (lambda: browser.click("#link"), lambda: browser.press("l")):
        copy()
        link = clipboard(browser)
        assert link == browser.run("location.href")
    before = shown(browser)
    open_page(browser, explorer, MAP)
    browser.open(link)
    browser.settle()
    assert shown(browser) == before


def test_options_of_a_command_are_not_broken(browser: Browser, explorer: Explorer):
    browser.resize(390, 844, mobile=True)
    open_page(browser, explorer, BRANCH)
    browser.press("c")
    rows = browser.all("dialog .option", "[e.textContent, e.getClientRects().length]")
    assert {"--from", "--out", "--stop"} <= {word for word, _ in rows}
    assert all(count == 1 for _, count in rows)


def test_help_says_what_the_store_is(browser: Browser, explorer: Explorer, stores: Stores):
    open_page(browser, explorer, RUN)
    browser.press("?")
    words = browser.run("document.getElementById('dialog').textContent")
    assert str(stores.run) in words
    assert "next state" in words


def test_no_other_machine_is_asked(browser: Browser, explorer: Explorer):
    for store in (RUN, BRANCH, MAP):
        open_page(browser, explorer, store)
    assert len(browser.requests) > 20
    assert not [one for one in browser.requests if not one.startswith((explorer.address, "about:", "data:"))]
