"""Damaged stores in Chromium: what is damaged is named, and the rest can be used."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.app.browser import Browser
from tests.app.pages import has, has_shape, open_page, pixels, shown, text, title
from tests.app.served import MoreStores, Stores

from shapespace.app.explore import Explorer
from shapespace.study.branch_store import open_branch
from shapespace.study.store import RunStore

Serve = Callable[..., Explorer]


def cut(file: Path, count: int = 500) -> Path:
    """Leave the beginning of a file only."""
    file.write_bytes(file.read_bytes()[:count])
    return file


def trouble(browser: Browser) -> str:
    return text(browser, "#trouble") if has(browser, "#trouble") else ""


def copy(store: Path, to: Path) -> Path:
    shutil.copytree(store, to)
    return to


@pytest.mark.parametrize("number", [0, 1, -1])
def test_a_run_is_shown_without_its_damaged_frames(
    browser: Browser, serve: Serve, stores: Stores, tmp_path: Path, number: int
):
    damaged = copy(stores.run, tmp_path / "damaged")
    frames = sorted((damaged / "frames").iterdir())
    file = cut(frames[number])
    open_page(browser, serve(damaged), 0)
    assert str(file) in trouble(browser)
    whole = [frame for frame in frames if frame != file]
    last = RunStore.open(stores.run).read(int(whole[-1].stem))
    assert shown(browser) == {**last.observables, "time": last.time}
    assert browser.run("document.getElementById('time').max") == str(len(whole) - 1)
    browser.press("Home")
    browser.settle()
    assert shown(browser)["time"] == RunStore.open(stores.run).read(int(whole[0].stem)).time
    assert has_shape(browser)


def test_a_branch_is_shown_without_its_damaged_points(browser: Browser, serve: Serve, stores: Stores, tmp_path: Path):
    damaged, branch = copy(stores.branch, tmp_path / "damaged"), open_branch(stores.branch)
    files = [cut(damaged / "points" / f"{number:06d}.npz") for number in (2, 3)]
    explorer = serve(damaged)
    open_page(browser, explorer, 0)
    assert all(str(file) in trouble(browser) for file in files)
    assert title(browser) == "pitchfork-1"
    assert shown(browser) == {**branch["pitchfork-1"].observables, "peclet": branch["pitchfork-1"].parameter}
    browser.press("End")
    browser.settle()
    assert shown(browser)["peclet"] == branch.points[-1].parameter
    assert has_shape(browser)
    # A link to a damaged point leads to the first that there is.
    open_page(browser, explorer, 0, place=3)
    assert title(browser) == "pitchfork-1"


def test_a_point_that_is_damaged_while_it_is_looked_at_leaves_no_old_numbers(
    browser: Browser, serve: Serve, stores: Stores, tmp_path: Path
):
    growing = copy(stores.branch, tmp_path / "growing")
    open_page(browser, serve(growing), 0, place=1)
    file = cut(growing / "points" / "000000.npz")
    # The store is read anew when something new is in its folder.
    (growing / "points" / "new.tmp").touch()
    browser.press("ArrowLeft")
    browser.settle()
    assert str(file) in trouble(browser)
    assert title(browser) == "not readable"
    assert shown(browser) == {}
    assert pixels(browser) == 0


def test_a_map_is_shown_without_its_damaged_boundary_points(
    browser: Browser, serve: Serve, more: MoreStores, tmp_path: Path
):
    damaged = copy(more.states, tmp_path / "damaged")
    point = cut(damaged / "curves" / "made-up" / "points" / "000001.npz")
    manifest = cut(next(one for one in (damaged / "curves").iterdir() if one.name != "made-up") / "store.json", 50)
    open_page(browser, serve(damaged), 0, state=1, place="1,5,1")
    assert str(point) in trouble(browser)
    assert str(manifest) in trouble(browser)
    assert has(browser, "#diagram .boundary.fold")
    assert not has(browser, "#diagram .boundary.pitchfork")
    assert has_shape(browser)


@pytest.mark.parametrize("name", ["outcome", "velocity", "shear_dissipation"])
def test_a_map_is_shown_without_its_damaged_tiles(
    browser: Browser, serve: Serve, stores: Stores, tmp_path: Path, name: str
):
    damaged = copy(stores.map, tmp_path / "damaged")
    cut(damaged / name / "c" / "0" / "0", 5)
    open_page(browser, serve(damaged), 0)
    browser.choose("#choose-of", name if name != "outcome" else "velocity")
    browser.settle()
    assert f"{name}/c/0/0: numbers of tile 0, 0 are damaged" in trouble(browser)
    assert has_shape(browser)
    canvas = "document.querySelector('#diagram canvas')"
    browser.choose("#choose-of", "area")
    browser.settle()
    assert trouble(browser).count("0 are damaged") == 1
    browser.choose("#choose-of", "velocity")
    browser.settle()
    corner, rest = browser.run(
        f"[[0, 99], [60, 40]].map(([x, y]) => {canvas}.getContext('2d').getImageData(x, y, 1, 1).data[3])"
    )
    assert (corner, rest) == ((0 if name == "outcome" else 255), 255)


def test_what_is_no_store_is_told_so_for_every_kind(browser: Browser, serve: Serve, stores: Stores, tmp_path: Path):
    (tmp_path / "notes").mkdir()
    open_page(browser, serve(tmp_path / "notes", stores.branch), 0)
    assert trouble(browser).endswith(
        "is missing; give the directory of a run, a branch, a curve, a search or a diagram."
    )
    browser.press("s")
    browser.choose("#store", 1)
    browser.settle()
    assert title(browser) == "pitchfork-1"
    assert trouble(browser) == ""
