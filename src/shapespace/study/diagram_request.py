"""What is asked of a diagram besides the scenario."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Self

from shapespace.base.errors import InputError
from shapespace.study.grid import Axis, Grid


@dataclass(frozen=True)
class DiagramRequest:
    """Grid, states, and what is to be found of them.

    states: names. branches: with more than none, up to so many states at each point, on all sheets that folds connect with those
    named, those of the stores `origins`, and those that searches by deflation find at `deflate` places. adaptive: only at the
    points of a quad-tree.
    """

    grid: Grid
    states: tuple[str, ...]
    stability: bool
    branches: int = 0
    origins: tuple[str, ...] = ()
    adaptive: bool = False
    deflate: int = 0

    @cached_property
    def places(self) -> list[tuple[int, int]]:
        """Points whose states the tiles start from: the middles of tiles, and with `branches` also those on their borders."""
        return self.grid.nodes if self.branches else self.grid.middles

    @property
    def labels(self) -> tuple[str, ...]:
        """Of the states at one point."""
        return tuple(f"state-{number + 1}" for number in range(self.branches)) or self.states

    def place(self, text: str) -> tuple[int, int, int]:
        """A point as `STATE,I,J`: the numbers of the state, and of the values along x and y. InputError where it is none."""
        parts = text.split(",")
        limits = (len(self.labels), *self.grid.shape)
        if len(parts) != 3 or not all(part.isdecimal() for part in parts):
            raise InputError(f"{text[:20]!r}: is no point of this diagram; give STATE,I,J.")
        state, i, j = map(int, parts)
        if not (state < limits[0] and i < limits[1] and j < limits[2]):
            raise InputError(f"{text[:40]}: is no point of this diagram, which has {' by '.join(map(str, limits))}.")
        return state, i, j

    def as_dict(self) -> dict[str, Any]:
        """Plain values."""
        axes = {name: asdict(axis) for name, axis in (("x", self.grid.x), ("y", self.grid.y))}
        more = {"branches": self.branches, "origins": [*self.origins]} if self.branches else {}
        more |= {"deflate": self.deflate} if self.deflate else {}
        more |= {"adaptive": True} if self.adaptive else {}
        return {**axes, "states": [*self.states], "stability": self.stability, **more}

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """What `as_dict` described."""
        grid = Grid(Axis(**stored["x"]), Axis(**stored["y"]))
        more = {name: stored[name] for name in ("branches", "adaptive", "deflate") if name in stored}
        origins = tuple(stored.get("origins", ()))
        return cls(grid, tuple(stored["states"]), stored["stability"], origins=origins, **more)
