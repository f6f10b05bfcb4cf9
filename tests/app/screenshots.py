"""Pictures of the explorer to look at: every kind of store, in both themes, on a desktop and on a phone.

Run from the root: python -m tests.app.screenshots FOLDER [STORE ...]   (small stores are made where none is given)
"""

import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from tests.app.browser import Browser, chromium
from tests.app.pages import address, go_to, open_page
from tests.app.served import serving
from tests.app.stores import make_more, make_stores

from shapespace.app.explore import Explorer

SIZES = ((1280, 800), (390, 844))
THEMES = ("light", "dark")


class View(NamedTuple):
    """What the page shows: a store by number, how."""

    store: int
    theme: str
    width: int
    height: int


def views(stores: int) -> Iterator[View]:
    """All of them, one after the other."""
    for width, height in SIZES:
        for theme in THEMES:
            for store in range(stores):
                yield View(store, theme, width, height)


def show(browser: Browser, explorer: Explorer, view: View) -> None:
    """Go to a view, in a new page where none is open."""
    browser.resize(view.width, view.height, mobile=view.width < 600)
    if browser.run("location.href").startswith(explorer.address):
        go_to(browser, address(explorer, view.store, theme=view.theme))
    else:
        open_page(browser, explorer, view.store, theme=view.theme)


def take(browser: Browser, explorer: Explorer, folder: Path) -> None:
    """A picture of every view, of a phone the whole length of the page."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = explorer.catalogue.paths
    for view in views(len(paths)):
        show(browser, explorer, view)
        file = folder / f"{paths[view.store].name}-{view.theme}-{view.width}.png"
        browser.picture(file, full=view.width < 600)
        print(file)


def main() -> None:
    """Take them all."""
    if len(sys.argv) < 2:
        sys.exit("give a FOLDER for the pictures: python -m tests.app.screenshots FOLDER [STORE ...]")
    with ExitStack() as stack:
        paths = [Path(one) for one in sys.argv[2:]]
        if not paths:
            there = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            few = make_stores(there)
            paths = [*few, *make_more(there, few.branch)]
        take(stack.enter_context(chromium()), stack.enter_context(serving(*paths)), Path(sys.argv[1]))


if __name__ == "__main__":
    main()
