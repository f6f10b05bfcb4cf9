"""What is refused names a page of the documentation, and there it is."""

import re
from pathlib import Path

import pytest
from tests.shell import Shell, one_complaint

from shapespace.base.errors import InputError, StoreError
from shapespace.cli import app
from shapespace.cli.guide import FIRST, KEYS, LAWS, PAGES, STORES, page_for

DOCS = Path(__file__).resolve().parents[1] / "docs"


def test_every_command_has_a_page_that_there_is():
    commands = {name for name in app if not name.startswith("-")}
    assert commands == {*PAGES}
    assert [page for page in (*PAGES.values(), FIRST, KEYS, LAWS, STORES) if not (DOCS / page).is_file()] == []


@pytest.mark.parametrize(
    ("command", "page"),
    [
        ("run nothing", "quickstart.md"),
        ("run guided-division -s pecklet=3", "glossary.md"),
        ("branch guided-division --vary nothing --stop 3", "how-to/follow-branches.md"),
        ("diagram polar-swimmer -x a -y b", "how-to/map-shape-space.md"),
        ("export nowhere a.csv", "how-to/export.md"),
        ("plot nowhere", "how-to/draw-figures.md"),
        ("plot nowhere --mode 0", "how-to/draw-figures.md"),
        ("movie nowhere", "how-to/make-movies.md"),
        ("steady vesicle --from nowhere", "file-format.md"),
        ("verify --html /nowhere/x.html", "how-to/verify.md"),
        ("explore nowhere", "how-to/explore-in-the-browser.md"),
        ("--import nowhere.py run vesicle", "how-to/add-a-term.md"),
        ("unknown", "quickstart.md"),
        ("search --nothing", "how-to/find-all-states.md"),
    ],
)
def test_what_is_refused_names_its_page(
    command: str, page: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.chdir(tmp_path)
    told = one_complaint(Shell(capsys)(*command.split()))
    (named,) = re.findall(r"(\S+\.md)\b", told)
    assert Path(named) == DOCS / page


def test_the_page_is_named_as_it_is_seen_from_here(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(DOCS.parent)
    assert page_for(["verify"]) == Path("docs/how-to/verify.md")
    assert page_for(["run"], StoreError("x")) == Path("docs/file-format.md")
    assert page_for(["explore"], StoreError("x")) == Path("docs/how-to/explore-in-the-browser.md")
    refused = StoreError("x")
    refused.__cause__ = PermissionError()
    assert page_for(["run"], refused) == Path("docs/quickstart.md")
    assert page_for(["run", "-s", "a=1"], InputError("x")) == Path("docs/glossary.md")
