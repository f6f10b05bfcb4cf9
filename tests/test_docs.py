"""What README and docs show works: Python blocks run, shell lines are commands and targets that there are."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import traceback
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from docs.executed import blocks_of, run_page
from tests.shell import Shell

import shapespace as ss
from shapespace.cli import app
from shapespace.study.scenario import load_scenario, template

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), ROOT / "benchmarks" / "README.md"]
SHORT = {"until": 2e-3, "elements": 20}


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def run_blocks(page: Path, names: dict[str, Any] | None = None) -> dict[str, Any]:
    """The Python blocks of a page, one after the other as in one session."""
    names = {"__name__": "docs", **(names or {})}
    for number, text in enumerate(blocks(page, "python"), start=1):
        exec(compile(text, f"{page.name}, block {number}", "exec"), names)
    return names


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """An empty folder, pictures that need no screen, and scenarios that end soon."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ss, "scenario", lambda name, **keys: _built_in(name, **{**SHORT, **keys}), raising=False)
    mpl.use("agg")


_built_in = ss.scenario


@pytest.mark.usefixtures("short", "own_models")
def test_readme_python_runs():
    names = run_blocks(ROOT / "README.md")
    assert names["run"].outcome == "reached-end"
    assert Path("results/strong-ring/store.json").exists()
    assert names["data"].sizes["time"] > 2


@pytest.mark.usefixtures("short", "own_models")
def test_readme_has_the_law_that_its_commands_use(capsys: pytest.CaptureFixture[str]):
    """What a reader has who has nothing but this page."""
    (law,) = [block for block in blocks_of(ROOT / "README.md") if block.note == "file"]
    Path(law.of).write_text(law.text)
    for line in shell_lines():
        if line[0] == "README.md" and law.of in line[1]:
            few = ("-s", "elements=20", *(("--until", "1e-3") if " run " in line[1] else ()))
            answer = Shell(capsys)(*shlex.split(line[1])[1:], *few)
            assert answer.status == 0, answer.err


@pytest.mark.usefixtures("short")
def test_a_store_is_read_without_the_package():
    run = ss.run(ss.scenario("guided-division"), out="results/guided-division")
    page = ROOT / "docs" / "file-format.md"
    Path("read.py").write_text(blocks(page, "python")[0])
    code = "import runpy, sys; runpy.run_path('read.py'); assert 'shapespace' not in sys.modules"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split()[:2] == ["guided-division", "reached-end"]
    assert float(done.stdout.split()[-1]) == pytest.approx(run.observables["height"])
    entries = [*json.loads(Path("results/guided-division/store.json").read_text())]
    with np.load("results/guided-division/frames/000001.npz") as frame:
        entries += [*frame]
    assert [name for name in entries if f"`{name}`" not in page.read_text(encoding="utf-8")] == []


@pytest.mark.usefixtures("short", "own_models")
@pytest.mark.parametrize(("page", "picture"), [("add-a-species", "pattern"), ("add-an-end-condition", "hinged")])
def test_species_and_end_conditions_can_be_added_as_the_pages_say(page: str, picture: str):
    run_blocks(ROOT / "docs" / "how-to" / f"{page}.md")
    assert {path.name for path in Path().glob("*.png")} == {f"{picture}.png"}


@pytest.mark.usefixtures("short", "own_models")
def test_a_term_can_be_added_as_the_page_says():
    run_blocks(ROOT / "docs" / "how-to" / "add-a-term.md")
    assert {path.name for path in Path().glob("*.png")} == {"elastic-swimmer.png", "elastic-swimmer-budget.png"}


@pytest.mark.usefixtures("short")
def test_a_map_is_read_as_the_page_says():
    axes = ("peclet=20:26:2", "inverse_hydrodynamic_length=1:2:2")
    ss.diagram(ss.scenario("polar-swimmer"), *axes, out="results/swimmers", workers=1)
    names: dict[str, Any] = {}
    exec(blocks(ROOT / "docs" / "how-to" / "map-shape-space.md", "python")[-2], names)
    assert names["found"].converged == 2


@pytest.mark.usefixtures("short", "own_models")
def test_the_tutorial_on_laws_runs():
    run_blocks(ROOT / "docs" / "tutorials" / "own-law.md")


RUN = [
    page
    for page in PAGES
    if any(block.note != "not run" for block in blocks_of(page)) and "benchmarks" not in page.parts
]


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_pages_run_as_they_are(page: Path, tmp_path: Path):
    """All blocks and commands, as `make docs` runs them."""
    command = [sys.executable, ROOT / "docs" / "executed.py", page, tmp_path / "page"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_no_block_escapes():
    """What is neither Python nor shell is no code that a reader could run; comments that steer stand before a block."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        fences = re.findall(r"^```([^\n]*)\n.*?^```", text, flags=re.MULTILINE | re.DOTALL)
        shown = [block for block in blocks_of(page) if block.text in "".join(blocks(page, block.language))]
        assert fences.count("python") + fences.count("sh") == len(shown), page.name
        others = {fence.partition(" ")[0] for fence in fences} - {"python", "sh"}
        assert not others - {"math", "toml", "", "{toctree}", "{image}", "{eval-rst}"}
        steering = re.findall(r"^<!-- (?:not run|file):", text, flags=re.MULTILINE)
        assert len(steering) == sum(bool(block.note) for block in blocks_of(page)), page.name


def test_a_page_runs_in_order_and_says_where_it_failed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    page = Path("page.md")
    blocks = [
        "<!-- run first\nshapespace config vesicle --out a.toml\n-->",
        "<!-- file: b.py -->\n```python\nfrom pathlib import Path\n\nassert Path('b.py').exists()\n```",
        "```python\nassert Path('a.toml').exists()\n```",
        "<!-- not run: never -->\n```python\nraise KeyError\n```",
        "```sh\nshapespace config vesicle --out c.toml  # a comment\n```",
    ]
    page.write_text("\n\n".join(blocks))
    run_page(page)
    assert Path("c.toml").exists()
    for text, said in (("```python\n1 / 0\n```", "block 1"), ("```sh\nshapespace run nothing\n```", "exit status 2")):
        page.write_text(text)
        with pytest.raises((ZeroDivisionError, RuntimeError)) as raised:
            run_page(page)
        assert said in "".join(traceback.format_exception(raised.value))


def shell_lines() -> list[tuple[str, str]]:
    """(page, command) of every line in a shell block, comments removed."""
    return [
        (page.name, shlex.join(words))
        for page in PAGES
        for block in blocks(page, "sh")
        for line in block.splitlines()
        if (words := shlex.split(line, comments=True))
    ]


@pytest.mark.parametrize(("page", "command"), shell_lines())
def test_shell_lines_are_commands_that_there_are(page: str, command: str, tmp_path: Path, monkeypatch: Any):
    monkeypatch.chdir(tmp_path)
    program, *arguments = shlex.split(command)
    if program == "make":
        assert shutil.which("make")
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
        assert {word for word in arguments if "=" not in word} <= {*targets}
        return
    assert program == "shapespace", f"{page}: {command}"
    if arguments[0] == "--import":
        assert Path(arguments[1]).suffix == ".py"
        arguments = arguments[2:]
    function, bound, _ = app.parse_args(arguments, exit_on_error=False, print_error=False)
    assert function.__name__ in {
        "list_scenarios",
        "config",
        "run_command",
        "steady_command",
        "branch_command",
        "curve_command",
        "search_command",
        "diagram_command",
        "plot",
        "movie",
        "export",
        "explore",
        "check",
        "reproduce",
        "verify",
    }
    if function.__name__ == "run_command":
        name, changes = bound.args[0], dict(text.split("=") for text in bound.kwargs.get("settings", ()))
        if any(
            page == other and line.startswith("shapespace config") and name in line for other, line in shell_lines()
        ):
            return  # the page makes the file itself, and is run as a whole
        if name.endswith(".toml"):
            Path(name).write_text(template("guided-division"))
            load_scenario(name).with_overrides(changes)
        elif "--import" not in command:
            _built_in(name, **changes)


def test_the_documentation_builds_without_a_warning(tmp_path: Path):
    """References, directives and docstrings of all pages, as `make docs` builds them but without running them."""
    options = ("-W", "--keep-going", "-q", "-D", "run_pages=0", "-b", "html", "-d", tmp_path / "trees")
    command = [sys.executable, "-m", "sphinx", *options, ROOT / "docs", tmp_path / "html"]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    assert "shapespace.open_run" in (tmp_path / "html" / "api.html").read_text(encoding="utf-8")


def test_the_interface_in_the_reference_is_whole():
    reference = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    assert [name for name in ss.__all__ if f"shapespace.{name}\n" not in reference] == []


def test_links_lead_somewhere():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        images = re.findall(r"^```\{image\} (\S+)$", text, flags=re.MULTILINE)
        for target in [*re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text), *images]:
            made = "/".join(Path(target).parts[-2:])
            is_made = made.startswith("made/") and any(Path(target).name in block.text for block in blocks_of(page))
            assert target.startswith("http") or is_made or (page.parent / target).exists(), f"{page.name}: {target}"
