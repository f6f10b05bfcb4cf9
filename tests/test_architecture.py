"""The rooms of the package, read from its source: who may import whom, how long things may be, what must
not occur; and that pins and glossary are complete.

Ranks: base 0, numerics 1, geometry 2, physics 3, variational 4, models 5, analysis 2', study 6, view 7, cli and app 8.
"""

import ast
import io
import re
import tokenize
import tomllib
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from shapespace.base.scales import QUANTITIES
from shapespace.base.units import Dimension

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "shapespace"
SOURCE = ROOT / "src"
CHECKED = ("src", "tests", "benchmarks", "experiments")

MAX_FILE = 400
MAX_BODY = 60

# Room by room, the rooms it may import besides itself. `analysis` sees a problem only as F(x, p): it meets the surface
# in `study`. `view` draws what is stored and never solves: what it imports from `study` must not lead to SOLVING.
MECHANICS = ("base", "numerics", "geometry", "physics", "variational", "models")
SOLVING = frozenset({"analysis"})
ALLOWED: dict[str, frozenset[str]] = {
    "base": frozenset(),
    "numerics": frozenset({"base"}),
    "geometry": frozenset(MECHANICS[:2]),
    "physics": frozenset(MECHANICS[:3]),
    "variational": frozenset(MECHANICS[:4]),
    "models": frozenset(MECHANICS[:5]),
    "analysis": frozenset({"base", "numerics"}),
    "study": frozenset({*MECHANICS, "analysis"}),
    "view": frozenset({"base", "study"}),
    "cli": frozenset({"base", "study", "view", "app"}),
    "app": frozenset({"base", "study", "view"}),
    # The front doors: public names re-exported, those for models of one's own, and `python -m shapespace`.
    "__init__": frozenset({*MECHANICS, "analysis", "study", "view", "app"}),
    "modelling": frozenset({"physics", "study", "variational"}),
    "__main__": frozenset({"cli"}),
}

Graph = dict[str, set[str]]


def module_names(source: Path) -> dict[str, Path]:
    """Every module of the package below `source`, by dotted name."""
    names = {}
    for path in sorted((source / PACKAGE).rglob("*.py")):
        parts = path.relative_to(source).with_suffix("").parts
        names[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return names


def imported_names(tree: ast.Module, module: str, *, is_package: bool) -> Iterator[str]:
    """Dotted names that a module imports anywhere in its text, inside functions and for type checking too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                here = module.split(".")
                anchor = here[: len(here) - node.level + is_package]
                base = ".".join([*anchor, base] if base else anchor)
            yield from (f"{base}.{alias.name}" for alias in node.names)


def import_graph(source: Path) -> Graph:
    """Modules of the package that each module imports; a name that is no module stands for the one that holds it."""
    names = module_names(source)
    graph: Graph = {}
    for module, path in names.items():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        targets = set()
        for name in imported_names(tree, module, is_package=path.name == "__init__.py"):
            if name.split(".")[0] != PACKAGE:
                continue
            while name not in names and "." in name:
                name = name.rpartition(".")[0]
            targets.add(name)
        graph[module] = targets - {module}
    return graph


def room(module: str) -> str:
    """The room of a module: the first name below the package, `__init__` for the package itself."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else "__init__"


def reached(graph: Graph, start: str) -> set[str]:
    """All modules that a module imports, directly or through others."""
    seen: set[str] = set()
    waiting = [start]
    while waiting:
        new = graph[waiting.pop()] - seen
        seen |= new
        waiting += new
    return seen


def rank_errors(graph: Graph) -> list[str]:
    """Imports that the ranks forbid, views that lead to a solver, and modules that stand in no room."""
    errors = [
        f"{module} stands in no room; the rooms are {', '.join(ALLOWED)}."
        for module in graph
        if room(module) not in ALLOWED
    ]
    for module in (module for module in graph if room(module) in ALLOWED):
        errors += [
            f"{module} imports {target}: {room(module)} may not import {room(target)}."
            for target in sorted(graph[module])
            if room(target) not in {room(module), *ALLOWED[room(module)]}
        ]
        if room(module) == "view":
            errors += [
                f"{module} imports {target}, which leads to {', '.join(solvers)}: view only reads what is stored."
                for target in sorted(graph[module])
                if room(target) == "study"
                and (solvers := sorted(name for name in reached(graph, target) if room(name) in SOLVING))
            ]
    return errors


def import_cycle(graph: Graph) -> list[str]:
    """The modules of one import cycle, empty if there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def python_files(*folders: str) -> list[Path]:
    """The Python files below the given folders of the repository."""
    return [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]


def function_bodies(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Every function with the lines of its body, from the first statement after the docstring to the last."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.body[1:] if ast.get_docstring(node, clean=False) is not None else node.body
            if body:
                yield node.name, (body[-1].end_lineno or body[-1].lineno) - first_line(body[0]) + 1


def first_line(statement: ast.stmt) -> int:
    """The line where a statement begins, its decorators included."""
    decorators = getattr(statement, "decorator_list", [])
    return min([statement.lineno, *(decorator.lineno for decorator in decorators)])


def printing_lines(tree: ast.Module) -> list[int]:
    """Lines that call print."""
    return [
        node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
    ]


def broad_handlers(tree: ast.Module) -> list[int]:
    """Lines of handlers that can hide any failure; one that cleans up and passes a BaseException on hides none."""
    lines = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ExceptHandler):
            kinds = node.type.elts if isinstance(node.type, ast.Tuple) else [node.type]
            names = {kind.id for kind in kinds if isinstance(kind, ast.Name)}
            last = node.body[-1]
            passes_on = isinstance(last, ast.Raise) and last.exc is None
            if node.type is None or "Exception" in names or ("BaseException" in names and not passes_on):
                lines.append(node.lineno)
    return lines


def unfinished_comments(text: str) -> list[int]:
    """Lines with a comment that leaves work for later."""
    marks = re.compile(r"\b(TODO|FIXME|XXX|HACK)\b")
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return [token.start[0] for token in tokens if token.type == tokenize.COMMENT and marks.search(token.string)]


def test_imports_go_down_the_ranks():
    assert not (errors := rank_errors(import_graph(SOURCE))), "\n".join(errors)


def test_every_folder_is_a_package():
    folders = {path.parent for path in python_files("src")}
    assert not [str(folder.relative_to(ROOT)) for folder in folders if not (folder / "__init__.py").exists()]


def test_no_import_cycles():
    assert not (cycle := import_cycle(import_graph(SOURCE))), " <- ".join(cycle)


@pytest.mark.parametrize("path", python_files(*CHECKED), ids=lambda path: str(path.relative_to(ROOT)))
def test_file_keeps_its_budgets(path: Path):
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    assert len(text.splitlines()) <= MAX_FILE
    assert not {name: lines for name, lines in function_bodies(tree) if lines > MAX_BODY}
    assert not broad_handlers(tree), "name the exceptions that are expected"
    assert not unfinished_comments(text), "finish it, or open an issue"


@pytest.mark.parametrize("path", python_files("src"), ids=lambda path: str(path.relative_to(ROOT)))
def test_library_does_not_print(path: Path):
    if SOURCE / PACKAGE / "cli" not in path.parents:
        assert not printing_lines(ast.parse(path.read_text(encoding="utf-8")))


def canonical(name: str) -> str:
    """A distribution name as package indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def test_constraints_are_plain_pins_of_every_dependency():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pin = re.compile(r"([A-Za-z0-9][A-Za-z0-9._-]*)==[0-9][A-Za-z0-9.]*")
    assert not [line for line in lines if not pin.fullmatch(line)]
    pinned = [canonical(line.partition("==")[0]) for line in lines]
    assert len(set(pinned)) == len(pinned)
    with (ROOT / "pyproject.toml").open("rb") as file:
        data = tomllib.load(file)
    wanted = [*data["build-system"]["requires"], *data["project"]["dependencies"]]
    wanted += [item for extra in data["project"]["optional-dependencies"].values() for item in extra]
    names = {canonical(re.split(r"[<>=!~;\[ ]", item, maxsplit=1)[0]) for item in wanted}
    assert names - {PACKAGE} <= set(pinned), f"not pinned: {sorted(names - {PACKAGE, *pinned})}"


def unit_text(dimension: Dimension) -> str:
    """A dimension as the glossary writes it: `E T/L^2`."""
    letters = {"energy": "E", "length": "L", "time": "T", "concentration": "C"}
    exponents = {letter: getattr(dimension, base) for base, letter in letters.items()}
    powers = {letter: letter if abs(n) == 1 else f"{letter}^{abs(n)}" for letter, n in exponents.items()}
    above = " ".join(powers[letter] for letter, n in exponents.items() if n > 0) or "1"
    below = " ".join(powers[letter] for letter, n in exponents.items() if n < 0)
    return f"{above}/{below}" if below else above


def test_glossary_has_every_public_name_with_its_unit():
    rows = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        for line in (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").splitlines()
        if line.startswith("| `")
    ]
    found = [(name.strip("`"), unit) for name, _, _, unit, _ in rows]
    assert sorted(found) == sorted((name, unit_text(quantity.dimension)) for name, quantity in QUANTITIES.items())


def write_package(folder: Path, modules: dict[str, str]) -> Path:
    """A package with the given modules, by path below it, in `folder`."""
    for name, text in {"__init__": "", **modules}.items():
        path = folder / PACKAGE / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("module", "text"),
    [
        ("base/units", "import shapespace.numerics.mesh"),
        ("geometry/curve", "from shapespace.physics import term"),
        ("physics/term", "def f():\n    from shapespace.analysis.stepper import step"),
        ("analysis/stepper", "from ..geometry import curve"),
        ("view/figure", "from shapespace import models"),
        ("view/figure", "from shapespace.study.run import run"),
        ("cli", "from shapespace.analysis.stepper import step"),
        ("study/store", "import shapespace"),
        ("helpers/misc", ""),
    ],
)
def test_a_forbidden_import_is_found(tmp_path: Path, module: str, text: str):
    others = ["numerics/mesh", "physics/term", "analysis/stepper", "geometry/curve", "models", "study/store"]
    modules = {**dict.fromkeys(others, ""), "study/run": "import shapespace.analysis.stepper", module: text}
    assert len(rank_errors(import_graph(write_package(tmp_path, modules)))) == 1


def test_allowed_imports_pass_and_a_cycle_is_found(tmp_path: Path):
    modules = {
        "numerics/__init__": "from shapespace.numerics.mesh import Mesh",
        "numerics/mesh": "from shapespace.base import arrays\nfrom .grid import Grid",
        "numerics/grid": "import numpy",
        "base/arrays": "",
        "study/run": "from shapespace.numerics import mesh\nimport shapespace.base.arrays as arrays",
        "study/store": "from shapespace.base.arrays import Array",
        "view/figure": "from shapespace.study.store import read",
    }
    graph = import_graph(write_package(tmp_path, modules))
    assert not rank_errors(graph)
    assert not import_cycle(graph)
    modules["numerics/grid"] = "def f():\n    from shapespace.numerics.mesh import Mesh"
    cycle = import_cycle(import_graph(write_package(tmp_path, modules)))
    assert set(cycle) == {"shapespace.numerics.mesh", "shapespace.numerics.grid"}


def test_lines_of_a_body_and_bad_habits_are_found():
    body = "\n".join(["    x = 1"] * 61)
    tree = ast.parse(f'def f():\n    """Doc\n    string."""\n{body}\n')
    assert dict(function_bodies(tree)) == {"f": 61}
    assert printing_lines(ast.parse("import rich\nrich.print(1)\nprint(2)")) == [3]
    tries = [f"try:\n    f()\nexcept{kind}:\n    pass\n" for kind in ("", " Exception", " (OSError, BaseException)")]
    assert all(broad_handlers(ast.parse(text)) == [3] for text in tries)
    fair = ["OSError:\n    pass", "BaseException:\n    undo()\n    raise"]
    assert not any(broad_handlers(ast.parse(f"try:\n    f()\nexcept {text}\n")) for text in fair)
    assert unfinished_comments("x = 'TODO'\ny = 1  # TO" + "DO: later\n") == [2]
