"""The grid of a diagram: two keys with evenly spaced values, cut into tiles that are computed one by one."""

import math
import re
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, Self

import numpy as np

from shapespace.base.errors import InputError
from shapespace.base.scales import QUANTITIES
from shapespace.study.frame import Array
from shapespace.study.keys import MODELS
from shapespace.study.scenario import Scenario

LARGEST_EDGE = 25
"""Points along a tile's edge: a tile takes seconds, and its lines are long enough to extrapolate along."""
WORTH_CUTTING = 10
"""Points along an axis from which on it is cut, so that there is work for several processes."""
MAX_POINTS = 100_000
STORED_WHOLE = 10_000
"""States of a map that are stored whole at most, 80 MB: close enough for the others to be one or two Newton iterations away."""

Tile = tuple[int, int]
"""Numbers of a tile along x and y."""


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

    @cached_property
    def lines(self) -> Array:
        """The middle and the ends of each tile, where there are several: what one of them has another may have as well."""
        ends = [*(self.span(number).start for number in range(self.tiles)), self.count - 1]
        return np.union1d(self.anchors, ends) if self.tiles > 1 else self.anchors

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
    def tiles(self) -> list[Tile]:
        """All tiles, those of one y after another."""
        return [(i, j) for j, i in product(range(self.y.tiles), range(self.x.tiles))]

    @cached_property
    def middles(self) -> list[tuple[int, int]]:
        """The middle points of all tiles."""
        return [(int(self.x.anchors[i]), int(self.y.anchors[j])) for i, j in self.tiles]

    @cached_property
    def nodes(self) -> list[tuple[int, int]]:
        """The middle points of all tiles, then the other points of the lattice of their middles and ends."""
        lattice = product(self.x.lines.tolist(), self.y.lines.tolist())
        return list(dict.fromkeys((*self.middles, *lattice)))

    def spread(self, count: int) -> list[tuple[int, int]]:
        """So many points spread over the map, the first of them for any larger count as well: Halton's sequence."""
        shares = ((_halton(number, 2), _halton(number, 3)) for number in range(1, count + 1))
        return [(int(a * self.x.count), int(b * self.y.count)) for a, b in shares]

    def number(self, tile: Tile) -> int:
        """The place of a tile among all."""
        return tile[1] * self.x.tiles + tile[0]

    def values(self, i: Any, j: Any) -> Array:
        """Values of both keys, (n_i, n_j, 2), for indices or slices along x and y."""
        return np.stack(np.meshgrid(self.x.values[i], self.y.values[j], indexing="ij"), axis=-1)

    def span(self, tile: Tile) -> tuple[slice, slice]:
        """The points of a tile."""
        return self.x.span(tile[0]), self.y.span(tile[1])

    def tile_of(self, at: tuple[int, int]) -> Tile:
        """The tile of a point."""
        return at[0] // self.x.edge, at[1] // self.y.edge

    def chosen(self, tile: Tile, states: int) -> list[tuple[int, int]]:
        """Points of a tile where states are stored whole: spread evenly over it, edges included, or the middle alone.

        states: at each point.
        """
        most = STORED_WHOLE // (states * len(self.tiles))
        x, y = self.span(tile)
        lines = min(y.stop - y.start, math.isqrt(most))
        columns = min(x.stop - x.start, most // max(lines, 1))
        lines = min(y.stop - y.start, most // max(columns, 1))
        if min(lines, columns) < 2:
            return [self.middles[self.number(tile)]]
        i, j = (
            np.linspace(one.start, one.stop - 1, count).round().astype(int).tolist()
            for one, count in ((x, columns), (y, lines))
        )
        return [*product(i, j)]

    def corners(self, scenario: Scenario) -> list[Scenario]:
        """The scenario at the corners; InputError where the keys or their values are none that it takes."""
        for flag, axis in (("x", self.x), ("y", self.y)):
            if not (math.isfinite(axis.start) and math.isfinite(axis.stop)):
                raise InputError(f"-{flag} {axis}: must run between finite numbers; choose others.")
            if not axis.start < axis.stop:
                raise InputError(f"-{flag} {axis}: must run upwards; give the smaller number first.")
            if not 2 <= axis.count <= MAX_POINTS:
                raise InputError(f"-{flag} {axis}: must have 2 to {MAX_POINTS} points; choose another count.")
            _check_parameter(scenario, axis, flag)
        if self.x.key == self.y.key or MODELS[scenario.model].rival_of(self.x.key) == self.y.key:
            raise InputError(f"-y {self.y}: varies the same as -x {self.x}; choose another key for one of them.")
        ends = product((self.x.start, self.x.stop), (self.y.start, self.y.stop))
        return [scenario.with_overrides({self.x.key: x, self.y.key: y}) for x, y in ends]


def _check_parameter(scenario: Scenario, axis: Axis, flag: str) -> None:
    """InputError for what is no parameter of the model but known otherwise."""
    parameters = [*scenario.parameters.model_dump(), *scenario.twins()]
    if axis.key in parameters or axis.key not in (*scenario.values(), *QUANTITIES):
        return
    what = "belongs to the computation" if axis.key in scenario.values() else "is an observable"
    raise InputError(
        f"-{flag} {axis}: {axis.key} {what}, while maps vary parameters of the model; choose one of {', '.join(parameters)}."
    )


def _halton(number: int, base: int) -> float:
    """The digits of a number in a base mirrored at the point: 1/2, 1/4, 3/4, ... in base 2."""
    found, unit = 0.0, 1.0 / base
    while number:
        number, digit = divmod(number, base)
        found, unit = found + unit * digit, unit / base
    return found
