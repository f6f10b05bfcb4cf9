"""What all tests share: a persistent compilation cache, so that only the first run pays for compiling."""

import os
import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings


def pytest_configure(config: pytest.Config) -> None:
    """Keep compiled functions under pytest's cache folder, unless the environment names another; child processes too."""
    if "JAX_COMPILATION_CACHE_DIR" not in os.environ and config.cache is not None:
        os.environ["JAX_COMPILATION_CACHE_DIR"] = str(config.cache.mkdir("jax"))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")
    if "jax" in sys.modules:
        raise pytest.UsageError("jax was imported before its cache was configured: a plugin must have loaded it.")


@pytest.fixture
def own_models() -> Iterator[None]:
    """What a test defines of models, scenarios and quantities goes with it."""
    from shapespace.base.scales import QUANTITIES
    from shapespace.study.keys import MODELS
    from shapespace.study.scenario import TEMPLATES

    variable = os.environ.pop("SHAPESPACE_IMPORT", None)
    kept = [(table, dict(table)) for table in (QUANTITIES, MODELS, TEMPLATES)]
    yield
    for table, before in kept:
        table.clear()
        table.update(before)
    os.environ.pop("SHAPESPACE_IMPORT", None)
    if variable is not None:
        os.environ["SHAPESPACE_IMPORT"] = variable


@pytest.fixture
def pages_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every figure that a test writes to a file must have its texts on the page, and its legends beside its lines."""
    from matplotlib.figure import Figure
    from tests.pages import assert_legends_clear, assert_on_page

    write = Figure.savefig

    def checked(figure: Figure, target: object, **options: object) -> None:
        if options.get("format") not in ("rgba", "raw"):  # frames of movies
            assert_on_page(figure)
            assert_legends_clear(figure)
        write(figure, target, **options)

    monkeypatch.setattr(Figure, "savefig", checked)


# The same examples every time, so that what passed passes again; `--hypothesis-profile=random` explores new ones.
settings.register_profile("random", deadline=None)
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")
