"""The grid of a diagram: two keys with evenly spaced values, cut into tiles that are computed one by one."""

import math
import re
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, Self

import numpy as np

from shapespace.base.errors import InputError
from shapespace.study.frame import Array
from shapespace.study.keys import MODELS
from shapespace.study.scenario import Scenario

LARGEST_EDGE = 25
"""Points along a tile's edge: a tile takes seconds, and its lines are long enough to extrapolate along."""
WORTH_CUTTING = 10
"""Points along an axis from which on it is cut, so that there is work for several processes."""
MAX_POINTS = 100_000


@dataclass(frozen=True)
class Axis:
    """`count` evenly spaced values of a key from `start` to `stop`, both included."""

    key: str
    start: float
    stop: float
    count: int

    @classmethod
    def read(cls, text: str, flag: str) -> Self:
        """The axis that `key=a:b:n` states; InputError where it states none."""
        match = re.fullmatch(r"\s*(\w+)\s*=\s*([^:]+):([^:]+):([^:]+)", text)
        if match is None:
            raise InputError(f"{flag} {text}: must be KEY=FROM:TO:COUNT, e.g. {flag} peclet=25:300:40.")
        try:
            start, stop = float(match[2]), float(match[3])
        except ValueError:
            raise InputError(f"{flag} {text}: FROM and TO must be numbers, e.g. {flag} peclet=25:300:40.") from None
        try:
            count = int(match[4])
        except ValueError:
            raise InputError(f"{flag} {text}: COUNT must be a whole number, e.g. {flag} peclet=25:300:40.") from None
        return cls(match[1], start, stop, count)

    @cached_property
    def values(self) -> Array:
        """(count,)."""
        return np.linspace(self.start, self.stop, self.count)

    @property
    def step(self) -> float:
        """Between neighbouring values."""
        return (self.stop - self.start) / (self.count - 1)

    @property
    def edge(self) -> int:
        """Points of a tile along this axis."""
        return math.ceil(self.count / max(1 + (self.count >= WORTH_CUTTING), math.ceil(self.count / LARGEST_EDGE)))

    @property
    def tiles(self) -> int:
        """Tiles along this axis."""
        return math.ceil(self.count / self.edge)

    def span(self, number: int) -> slice:
        """The points of a tile along this axis."""
        return slice(number * self.edge, min((number + 1) * self.edge, self.count))

    @cached_property
    def anchors(self) -> Array:
        """The middle point of each tile."""
        spans = [self.span(number) for number in range(self.tiles)]
        return np.array([(one.start + one.stop) // 2 for one in spans])

    def __str__(self) -> str:
        return f"{self.key}={self.start:g}:{self.stop:g}:{self.count}"


@dataclass(frozen=True)
class Grid:
    """Points (x_i, y_j). A point is (i, j), a tile the same of tiles; its anchor is its middle point."""

    x: Axis
    y: Axis

    @property
    def keys(self) -> tuple[str, str]:
        """Of both axes."""
        return self.x.key, self.y.key

    @property
    def shape(self) -> tuple[int, int]:
        """Points along x and y."""
        return self.x.count, self.y.count

    @cached_property
    def tiles(self) -> list[tuple[int, int]]:
        """All tiles, those of one y after another."""
        return [(i, j) for j, i in product(range(self.y.tiles), range(self.x.tiles))]

    def values(self, i: Any, j: Any) -> Array:
        """Values of both keys, (n_i, n_j, 2), for indices or slices along x and y."""
        return np.stack(np.meshgrid(self.x.values[i], self.y.values[j], indexing="ij"), axis=-1)

    def span(self, tile: tuple[int, int]) -> tuple[slice, slice]:
        """The points of a tile."""
        return self.x.span(tile[0]), self.y.span(tile[1])

    def tile_of(self, at: tuple[int, int]) -> tuple[int, int]:
        """The tile of a point."""
        return at[0] // self.x.edge, at[1] // self.y.edge

    def corners(self, scenario: Scenario) -> list[Scenario]:
        """The scenario at the corners; InputError where the keys or their values are none that it takes."""
        for flag, axis in (("x", self.x), ("y", self.y)):
            if not (math.isfinite(axis.start) and math.isfinite(axis.stop)):
                raise InputError(f"-{flag} {axis}: must run between finite numbers; choose others.")
            if not axis.start < axis.stop:
                raise InputError(f"-{flag} {axis}: must run upwards; give the smaller number first.")
            if not 2 <= axis.count <= MAX_POINTS:
                raise InputError(f"-{flag} {axis}: must have 2 to {MAX_POINTS} points; choose another count.")
        if self.x.key == self.y.key or MODELS[scenario.model].rival_of(self.x.key) == self.y.key:
            raise InputError(f"-y {self.y}: varies the same as -x {self.x}; choose another key for one of them.")
        ends = product((self.x.start, self.x.stop), (self.y.start, self.y.stop))
        return [scenario.with_overrides({self.x.key: x, self.y.key: y}) for x, y in ends]
