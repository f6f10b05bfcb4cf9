"""The experiments: what they assert holds, in their quick form and, slowly, in full; folds and rates are converged."""

from importlib import import_module
from pathlib import Path

import pytest

EXPERIMENTS = Path(__file__).resolve().parents[1] / "experiments"
NAMES = sorted(path.stem for path in EXPERIMENTS.glob("*.py") if path.stem != "common")
FULL = [name for name in NAMES if name != "fig_5abcd"]
"""A map of 250,000 states is run by hand."""


def assert_holds(name: str, out: Path, quick: bool) -> None:
    rows = import_module(name).run(out, quick)
    failed = [f"{row.claim}: paper {row.paper}, here {row.ours} {row.error}" for row in rows if not row.holds]
    assert not failed, "\n".join(failed)
    assert rows
    for suffix in ("png", "pdf"):
        assert (out / f"{name}.{suffix}").stat().st_size > 10_000


@pytest.mark.usefixtures("own_models", "pages_checked")
@pytest.mark.parametrize("name", NAMES)
def test_quick(name: str, tmp_path: Path):
    assert_holds(name, tmp_path, quick=True)


@pytest.mark.slow
@pytest.mark.usefixtures("own_models", "pages_checked")
@pytest.mark.parametrize("name", FULL)
def test_full(name: str, tmp_path: Path):
    assert_holds(name, tmp_path, quick=False)


@pytest.mark.parametrize("name", NAMES)
def test_opens_as_a_short_paper(name: str):
    """What it solves, its parameters and units, how to run it, how long it takes, and what to expect."""
    text = (EXPERIMENTS / f"{name}.py").read_text(encoding="utf-8").split('"""')[1]
    for part in ("What.", "Parameters:", "Units:", f"python experiments/{name}.py", "Time:", "Expect"):
        assert part in text, part
