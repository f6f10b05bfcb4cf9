"""Which page of the documentation says more about a command that was refused, and where it lies on this machine."""

from collections.abc import Sequence
from pathlib import Path

from shapespace.base.errors import StoreError

FIRST, BRANCHES = "quickstart.md", "how-to/follow-branches.md"
PAGES = {
    "scenarios": FIRST,
    "config": FIRST,
    "run": FIRST,
    "steady": FIRST,
    "plot": "how-to/draw-figures.md",
    "movie": "how-to/make-movies.md",
    "branch": BRANCHES,
    "curve": BRANCHES,
    "search": "how-to/find-all-states.md",
    "diagram": "how-to/map-shape-space.md",
    "export": "how-to/export.md",
    "explore": "how-to/explore-in-the-browser.md",
    "check": "how-to/verify.md",
    "verify": "how-to/verify.md",
    "reproduce": "how-to/verify.md",
}
STORES, LAWS, KEYS = "file-format.md", "how-to/add-a-term.md", "glossary.md"
LOOKING = ("plot", "movie", "export", "explore")
"""Commands whose pages say more of a store that they cannot show than what is in one."""


def page_for(tokens: Sequence[str], error: Exception | None = None) -> Path:
    """The page for a command line that failed: of what is stored, of laws of one's own, of keys, or of the command."""
    command = next((token for token in tokens if token in PAGES), "")
    # A file that the system refuses is no matter of the format.
    is_refused = error is not None and isinstance(error.__cause__, OSError)
    if isinstance(error, StoreError) and command not in LOOKING and not is_refused:
        return _found(STORES)
    if any(token.partition("=")[0] == "--import" for token in tokens):
        return _found(LAWS)
    if (
        error is not None
        and command in ("config", "run", "steady")
        and any(token in ("-s", "--set") for token in tokens)
    ):
        return _found(KEYS)
    return _found(PAGES.get(command, FIRST))


def _found(name: str) -> Path:
    """Beside the package where it is installed, else in the source tree; as it is seen from the current directory."""
    package = Path(__file__).resolve().parents[1]
    places = [package / "docs" / name, package.parents[1] / "docs" / name]
    page = next((place for place in places if place.is_file()), places[0])
    here = Path.cwd()
    return page.relative_to(here) if page.is_relative_to(here) else page
