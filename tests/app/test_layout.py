"""Nothing is wider than the screen or out of its panel, in any size and theme; pictures of it all can be taken."""

from collections.abc import Callable
from pathlib import Path

import pytest
from tests.app.browser import Browser
from tests.app.pages import BRANCH, DIVISION, MAP, open_page
from tests.app.screenshots import SIZES, THEMES, View, show, take
from tests.app.served import Stores

from shapespace.app.explore import Explorer

INSIDE = """(() => {
  const out = [], reach = (e) => e.getBoundingClientRect();
  const inPanels = 'svg text, button, select, label, h2, .bar, #scale span, #legend span, #facts dt i, #facts dd';
  if (document.documentElement.scrollWidth > innerWidth) out.push(`the page is ${document.documentElement.scrollWidth} wide`);
  for (const panel of document.querySelectorAll('.panel')) {
    const edge = reach(panel), isScrolled = panel.id === 'facts';
    if (edge.left < 0 || edge.right > innerWidth + 1) out.push(`${panel.id} ends at ${edge.right}`);
    for (const e of panel.querySelectorAll(inPanels)) {
      const box = reach(e);
      const isOut = box.left < edge.left - 1 || box.right > edge.right + 1
        || (!isScrolled && (box.top < edge.top - 1 || box.bottom > edge.bottom + 1));
      const words = `${e.tagName} ${e.textContent.slice(0, 30)} is out of its panel`;
      if (isOut && box.width > 0 && e.checkVisibility()) out.push(words);
    }
  }
  for (const svg of document.querySelectorAll('.chart svg')) {
    const axes = [...svg.querySelectorAll(':scope > g:not([clip-path]) > text')].filter((e) => e.checkVisibility());
    axes.forEach((one, i) => axes.slice(i + 1).forEach((other) => {
      const [a, b] = [reach(one), reach(other)];
      // Boxes of text have room above and below.
      const isOver = a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 5 && b.top < a.bottom - 5;
      if (isOver) out.push(`${one.textContent} lies on ${other.textContent}`);
    }));
  }
  return out;
})()"""


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_everything_is_in_its_place(browser: Browser, whole: Explorer, width: int, height: int):
    for store in range(len(whole.catalogue.paths)):
        show(browser, whole, View(store, THEMES[store % 2], width, height))
        assert browser.run(INSIDE) == [], store


def test_everything_is_in_its_place_in_any_width(browser: Browser, explorer: Explorer):
    """Where the computation of growth rates is offered, and where numbers are even but for round-off."""
    for store in (BRANCH, MAP):
        open_page(browser, explorer, store)
        for width in (360, 560, 821, 830, 900, 1000, 1180, 1920):
            browser.resize(width, 700, mobile=width < 600)
            browser.settle()
            assert browser.run(INSIDE) == [], (store, width)


def test_numbers_of_any_length_have_room(browser: Browser, whole: Explorer):
    open_page(browser, whole, DIVISION, x="length", first="meridional_curvature", second="azimuthal_curvature")
    for width, height in SIZES:
        browser.resize(width, height, mobile=width < 600)
        for name in ("discretisation_error", "boundary_residual", "area", "pressure", "max_meridional_curvature"):
            browser.choose("#choose-y", name)
            browser.settle()
            assert browser.run(INSIDE) == [], (width, name)


def test_pictures_are_taken_of_every_view(
    browser: Browser,
    serve: Callable[..., Explorer],
    stores: Stores,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    monkeypatch.setattr("tests.app.screenshots.SIZES", ((400, 300),))
    take(browser, serve(stores.branch), tmp_path / "pictures")
    pictures = sorted((tmp_path / "pictures").iterdir())
    assert [one.name for one in pictures] == ["branch-dark-400.png", "branch-light-400.png"]
    assert all(one.read_bytes().startswith(b"\x89PNG") for one in pictures)
    assert len({one.read_bytes() for one in pictures}) == 2
    assert capsys.readouterr().out.count("\n") == 2
