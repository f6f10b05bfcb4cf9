"""Executables on disk: what a second process finds, and when it must not find it."""

import time
from collections.abc import Iterator
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import shapespace as ss
from shapespace.models import closed_surface
from shapespace.numerics import kept
from shapespace.numerics.kept import Kept, fingerprint
from shapespace.numerics.pointwise import compiled_functions
from shapespace.study.engine import Engine

X = np.linspace(0.1, 1.0, 7)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    before = jax.config.values["jax_compilation_cache_dir"]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    monkeypatch.setattr(kept, "_LOADED", time.time() + kept.IMPORTING)
    yield tmp_path / "executables"
    jax.config.update("jax_compilation_cache_dir", before)


class Traced:
    """A function that counts how often it is traced."""

    def __init__(self) -> None:
        self.times = 0

    def __call__(self, x: jax.Array) -> jax.Array:
        self.times += 1
        return jnp.sin(x) * x


def test_a_second_process_does_not_trace(folder: Path):
    first, second = Traced(), Traced()
    np.testing.assert_array_equal(Kept(first, "one")(X), Kept(second, "one")(X))
    np.testing.assert_allclose(Kept(second, "one")(X), np.sin(X) * X, rtol=1e-15)
    assert (first.times, second.times) == (1, 0)
    assert len(list(folder.iterdir())) == 1


def test_names_and_shapes_are_kept_apart(folder: Path):
    for name, x in (("one", X), ("one", X[:3]), ("two", X)):
        function = Traced()
        Kept(function, name)(x)
        assert function.times == 1
    assert len(list(folder.iterdir())) == 3


def test_what_jax_has_kept_is_whole_here_too():
    """JAX's own cache holds the executable already: what is stored from there must run."""
    before = jax.config.values["jax_persistent_cache_min_compile_time_secs"]
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    try:
        expected = jax.jit(Traced())(X)
        Kept(Traced(), "one")(X)
        np.testing.assert_array_equal(Kept(Traced(), "one")(X), expected)
    finally:
        jax.config.update("jax_persistent_cache_min_compile_time_secs", before)


@pytest.mark.parametrize("damage", [b"", b"short", b"x" * 5000])
def test_a_damaged_file_is_made_again(folder: Path, damage: bytes):
    expected = Kept(Traced(), "one")(X)
    (path,) = folder.iterdir()
    path.write_bytes(damage)
    function = Traced()
    np.testing.assert_array_equal(Kept(function, "one")(X), expected)
    assert function.times == 1
    assert path.stat().st_size > len(damage)


def test_without_a_folder_nothing_is_kept(folder: Path):
    jax.config.update("jax_compilation_cache_dir", None)
    np.testing.assert_allclose(Kept(Traced(), "one")(X), np.sin(X) * X, rtol=1e-15)
    assert not folder.exists()


def test_any_change_of_the_sources_changes_the_fingerprint(tmp_path: Path):
    found = set()
    for number, text in enumerate(("x = 1\n", "x = 2\n", "x = 1\n# \n")):
        package = tmp_path / str(number)
        package.mkdir()
        (package / "a.py").write_text(text)
        found.add(fingerprint(package))
    (tmp_path / "0" / "b.py").touch()
    fingerprint.cache_clear()
    found.add(fingerprint(tmp_path / "0"))
    assert len(found) == 4


def test_sources_that_change_under_a_process_are_not_trusted(folder: Path, monkeypatch: pytest.MonkeyPatch):
    """What it has loaded may be older than what it would hash."""
    monkeypatch.setattr(kept, "_LOADED", 0.0)
    np.testing.assert_allclose(Kept(Traced(), "one")(X), np.sin(X) * X, rtol=1e-15)
    assert not folder.exists()


def test_only_shipped_systems_are_kept():
    """A user's law may change while its name does not; so may any system that is not the shipped one."""
    shipped = Engine.of(ss.scenario("polar-swimmer")).system
    assert isinstance(compiled_functions(shipped).values, Kept)
    extended = closed_surface.RECIPE.extended((), lambda p: ()).system()
    assert not isinstance(compiled_functions(extended).values, Kept)
