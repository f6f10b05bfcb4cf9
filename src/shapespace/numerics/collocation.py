"""Gauss collocation of an AbstractSystem: residual, structured Jacobian and stored quantities on a given mesh."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from shapespace.base.arrays import Array, Flags
from shapespace.base.problem import (
    REST,
    AbstractLinearisation,
    AbstractProblem,
    AbstractSmoothProblem,
    Actions,
    Border,
    Rate,
)
from shapespace.numerics import condensation
from shapespace.numerics.adaptation import adapted_mesh
from shapespace.numerics.border import with_border
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.layout import assembled, by_element, joined, lay_out, product
from shapespace.numerics.pointwise import Density, Functions, Values, compiled_functions, numbers, points_per_tile
from shapespace.numerics.small_lu import compiled, read_only
from shapespace.numerics.state import State
from shapespace.numerics.system import AbstractSystem, Symmetry
from shapespace.numerics.transposed import solve_transposed

RELATIVE_FLOOR = 1.0
"""Fields and scalars smaller than this are measured absolutely in norms; problems are dimensionless and of order one."""

Slopes = tuple[Array, Array]
"""Derivatives by x (size,) and by p (n_p,)."""


@compiled
def _largest_relative(change: Array, values: Array, columns: int, weights: Array) -> float:
    """max over columns of max_i |weights_i change_ic| / max(max_i |values_ic|, floor), both flat and columns wide.

    weights may be empty, for ones.
    """
    largest = 0.0
    for c in range(columns):
        top, scale = 0.0, RELATIVE_FLOOR
        for i in range(change.shape[0] // columns):
            difference = abs(change[i * columns + c])
            if weights.shape[0] > 0:
                difference *= weights[i]
            if not difference <= top:
                top = difference
        for i in range(values.shape[0] // columns):
            scale = max(scale, abs(values[i * columns + c]))
        if not top < np.inf:
            return np.inf
        largest = max(largest, top / scale)
    return largest


@compiled
def _norm(dx: Array, x: Array, n: int, n_a: int, k: int, widths: Array) -> float:
    """Of `CollocationProblem.norm`; widths (N k,): of each point's element."""
    slopes = (widths.shape[0] // k + 1) * n
    algebraic = slopes + widths.shape[0] * n
    scalars = algebraic + widths.shape[0] * n_a
    ones = widths[:0]
    largest = _largest_relative(dx[:slopes], x[:slopes], n, ones)
    largest = max(largest, _largest_relative(dx[slopes:algebraic], x[:slopes], n, widths))
    largest = max(largest, _largest_relative(dx[algebraic:scalars], x[algebraic:scalars], n_a, ones))
    return max(largest, _largest_relative(dx[scalars:], x[scalars:], dx.shape[0] - scalars, ones))


@dataclass(frozen=True)
class CollocationLinearisation(AbstractLinearisation):
    """The factorised Jacobian of a CollocationProblem."""

    problem: "CollocationProblem"
    factors: condensation.Factors

    @property
    def is_singular(self) -> bool:
        """A pivot vanished or is not finite."""
        return self.factors.singular

    @property
    def sign(self) -> float:
        """Of the determinant, up to a factor that N and k determine."""
        return condensation.determinant_sign(self.factors)

    def solve(self, residual: Array) -> Array:
        """J dx = residual."""
        return condensation.solve(self.factors, residual)

    def solve_transposed(self, x: Array) -> Array:
        """The multipliers y of the rows, flat as the residual, with J^T y = x."""
        return solve_transposed(self.factors, x)


@dataclass(frozen=True)
class CollocationProblem(AbstractSmoothProblem):
    """An AbstractSystem on a mesh with k Gauss points per element; x packs nodes, slopes, algebraic fields and scalars."""

    system: AbstractSystem
    mesh: Array
    degree: int
    tolerance: float = 1e-6

    @cached_property
    def elements(self) -> int:
        """Number of elements N."""
        return len(self.mesh) - 1

    @cached_property
    def n(self) -> int:
        """Number of differential fields."""
        return len(self.system.fields)

    @cached_property
    def n_rows(self) -> int:
        """Equations per point, n + n_a."""
        return self.n + len(self.system.algebraic)

    @cached_property
    def n_stored(self) -> int:
        """Stored quantities n_q."""
        return numbers(self.system).stored

    @cached_property
    def n_integrals(self) -> int:
        """Integral conditions n_i."""
        return numbers(self.system).integrals

    @cached_property
    def _widths(self) -> Array:
        return np.diff(self.mesh)

    def pack(self, state: State) -> Array:
        """x (size,) of a state on this mesh."""
        return np.concatenate([state.nodes.ravel(), state.slopes.ravel(), state.algebraic.ravel(), state.scalars])

    def unpack(self, x: Array) -> State:
        """The state of x (size,)."""
        elements, k, n, n_a = self.elements, self.degree, self.n, len(self.system.algebraic)
        a = (elements + 1) * n
        b = a + elements * k * n
        c = b + elements * k * n_a
        nodes, slopes = x[:a].reshape(-1, n), x[a:b].reshape(elements, k, n)
        return State(self.mesh, nodes, slopes, x[b:c].reshape(elements, k, n_a), x[c:])

    @cached_property
    def _point_widths(self) -> Array:
        """Each Gauss point's element width."""
        return np.repeat(self._widths, self.degree)

    @cached_property
    def functions(self) -> Functions:
        """Compiled functions of tiles of points."""
        return compiled_functions(self.system)

    @cached_property
    def _points(self) -> int:
        return self.elements * self.degree

    @cached_property
    def _tile(self) -> int:
        return points_per_tile(self._points)

    @cached_property
    def _shares(self) -> Array:
        """Quadrature weights of the points."""
        return np.asarray((gauss_rule(self.degree).weights[:, None] * self._widths).ravel())

    def _tiles(self, x: Array, p: Array, rate: Rate = REST) -> Array:
        """All points, and the ends with each tile; linear in (x, p)."""
        rule = gauss_rule(self.degree)
        return lay_out(
            x, p, rate.coefficient, rate.history, self.mesh, rule.matrix, rule.points, self.n, self.n_rows - self.n,
            self.n_stored, self._tile,
        )  # fmt: skip

    def _assembled(self, parts: Sequence[Any], x: Array) -> Array:
        """The flat residual from the flat values of all tiles: equations, continuity, end conditions, integral conditions."""
        values = np.asarray(parts[0])[None] if len(parts) == 1 else np.stack(parts)
        weights, n_i = gauss_rule(self.degree).weights, self.n_integrals
        return assembled(read_only(values), x, self.mesh, weights, self.n, self.n_rows, n_i, self._tile)

    def residual(self, x: Array, p: Array, rate: Rate) -> Array:
        """Equations at the Gauss points, continuity, end conditions, integral conditions."""
        return self._assembled([self.functions.values(tile) for tile in self._tiles(x, p, rate)], x)

    def blocks(self, x: Array, p: Array, rate: Rate) -> tuple[Array, Array, Array, Array]:
        """Residual, and the Jacobian's blocks: points (m + n_i, m + n + n_s, k, N), ends, targets."""
        out = [self.functions.linearised(tile) for tile in self._tiles(x, p, rate)]
        return self._assembled([values for values, _ in out], x), *self._blocks_of([slopes for _, slopes in out])

    def _blocks_of(self, tiles: Sequence[Values]) -> tuple[Array, Array, Array]:
        """Of all tiles."""
        points = np.ascontiguousarray(joined([tile.rows for tile in tiles], self._points))
        points = points.reshape(*points.shape[:2], self.degree, self.elements)
        return points, np.asarray(tiles[0].ends), np.asarray(tiles[0].targets)

    def linearise(
        self, x: Array, p: Array, rate: Rate, border: Border | None = None
    ) -> tuple[Array, CollocationLinearisation]:
        """Residual and factorised Jacobian. A border's columns become scalars, its rows integral conditions."""
        residual, points, ends, targets = self.blocks(x, p, rate)
        if border is None:
            return residual, self._factorised(points, ends, targets)
        weights = gauss_rule(self.degree).weights
        return residual, self._factorised(*with_border(border, self._widths, weights, self.n, points, ends, targets))

    def _factorised(self, points: Array, ends: Array, targets: Array, *border: Array) -> CollocationLinearisation:
        rule = gauss_rule(self.degree)
        factors = condensation.factorise(
            self._widths, rule.matrix, rule.weights, points, ends, targets, self.n, *border
        )
        return CollocationLinearisation(self, factors)

    def derivative(self, x: Array, p: Array, dx: Array, dp: Array) -> Array:
        """F_x dx + F_p dp at rest, flat as the residual."""
        tiles = zip(self._tiles(x, p), self._tiles(dx, dp), strict=True)
        return self._assembled([self.functions.derivative(at, along) for at, along in tiles], dx)

    def second_derivative(self, x: Array, p: Array, one: Array, dp: Array, other: Array, ep: Array) -> Array:
        """F'' along (one, dp) and (other, ep) at rest, flat as the residual."""
        tiles = zip(self._tiles(x, p), self._tiles(one, dp), self._tiles(other, ep), strict=True)
        return self._assembled([self.functions.second_derivative(*tile) for tile in tiles], np.zeros_like(x))

    def actions(self, x: Array, p: Array) -> Actions:
        """By the blocks of the Jacobian at rest, and by what a growth rate adds to them, in which they are linear."""
        rest = self.blocks(x, p, REST)[1:]
        mass = self._blocks_of([self.functions.mass(tile) for tile in self._tiles(x, p)])

        def factors(s: float) -> CollocationLinearisation:
            return self._factorised(*(j + s * b for j, b in zip(rest, mass, strict=True)))

        return Actions(self._product(rest, 1.0), self._product(mass, 0.0), factors, self._moving(*mass))

    def _moving(self, points: Array, ends: Array, targets: Array) -> Flags:
        """Unknowns that a matrix without continuity rows acts on, of all points alike."""
        n, inside = self.n, (self.elements, self.degree, 1)
        at_points, at_ends = np.any(points, axis=(0, 2, 3)), np.any(ends, axis=0)
        slope, algebraic, field, scalar = np.split(at_points, np.cumsum([n, self.n_rows - n, n]))
        field |= at_ends[:n] | at_ends[n : 2 * n]
        scalar |= at_ends[2 * n :] | np.any(targets, axis=0)
        parts = (field, (self.elements + 1, 1)), (slope | field, inside), (algebraic, inside), (scalar, 1)
        return np.concatenate([np.tile(flags, times).ravel() for flags, times in parts])

    def _product(self, blocks: Sequence[Array], jumps: float) -> Callable[[Array], Array]:
        """Multiplication by a matrix of these blocks (points, ends, targets), with `jumps` times the continuity rows."""
        points, ends, targets = map(read_only, blocks)
        structure, rule = np.any(points, axis=(2, 3)), gauss_rule(self.degree)
        return lambda dx: product(
            np.ascontiguousarray(dx), points, structure, ends, targets, self.mesh, rule.matrix, rule.weights, jumps
        )

    def stored(self, x: Array, p: Array) -> Array:
        """q at the Gauss points and at both ends, flattened."""
        parts = [self.functions.stored(tile) for tile in self._tiles(x, p)]
        inner = by_element(joined([part for part, _ in parts], self._points), self.degree)
        return np.concatenate([inner, np.asarray(parts[0][1])]).ravel()

    def integrals(self, density: Density, x: Array, p: Array, rate: Rate) -> tuple[dict[str, float], dict[str, float]]:
        """Gauss quadrature of density(system, dy, y, a, s, dq, p) over u, by name, and the largest point values."""
        names, values = self._densities(density, self._tiles(x, p, rate))
        sums, peaks = (values @ self._shares).tolist(), values.max(axis=1).tolist()
        return dict(zip(names, sums, strict=True)), dict(zip(names, peaks, strict=True))

    def _densities(self, density: Density, tiles: Array) -> tuple[list[str], Array]:
        """Names, and values (names, k N) at the points."""
        parts = [self.functions.densities(density, tile) for tile in tiles]
        (names,) = parts[0]
        return names.split(), joined([part[names] for part in parts], self._points)

    def integral_slopes(self, density: Density, x: Array, p: Array) -> tuple[dict[str, Slopes], dict[str, Slopes]]:
        """Derivatives by x and p of what `integrals` returns, at rest; a largest value stays that of its point."""
        tiles = self._tiles(x, p)
        parts = [self.functions.density_slopes(density, tile) for tile in tiles]
        sums, peaks = dict[str, Slopes](), dict[str, Slopes]()
        for name, values in zip(*self._densities(density, tiles), strict=True):
            slopes = [joined(list(by), self._points) for by in zip(*(part[name] for part in parts), strict=True)]
            largest = np.zeros(self._points)
            largest[int(values.argmax())] = 1.0
            sums[name], peaks[name] = self._gathered(slopes, self._shares), self._gathered(slopes, largest)
        return sums, peaks

    def _gathered(self, slopes: Sequence[Array], shares: Array) -> Slopes:
        """Derivatives of a sum over points with these shares, from those by rows, scalars and p (., k N)."""
        rows, scalars, p = slopes[0] * shares, slopes[1] @ shares, slopes[2] @ shares
        n, k = self.n, self.degree
        rows = rows.reshape(-1, k, self.elements).transpose(2, 1, 0)
        slope, algebraic, field = rows[..., :n], rows[..., n : self.n_rows], rows[..., self.n_rows :]
        nodes = np.zeros((self.elements + 1, n))
        nodes[:-1] = field.sum(axis=1)
        inside = slope + self._widths[:, None, None] * np.einsum("jl,ejn->eln", gauss_rule(k).matrix, field)
        return self.pack(State(self.mesh, nodes, inside, algebraic, scalars)), p

    def rates(self, x: Array, p: Array, rate: Rate) -> Array:
        """dq/dt at the Gauss points, (N, k, n_q)."""
        dq = rate.coefficient * self.stored(x, p) + rate.history
        n_q = len(dq) // (self.elements * self.degree + 2)
        return np.asarray(dq.reshape(-1, n_q)[:-2].reshape(self.elements, self.degree, n_q))

    def norm(self, dx: Array, x: Array) -> float:
        """Largest change of any field, algebraic field or scalar relative to that field's largest value (or one).

        A change of a slope counts as what it adds over its element.
        """
        return float(_norm(dx, x, self.n, self.n_rows - self.n, self.degree, self._point_widths))

    def weights(self, x: Array) -> Array:
        """Of node values by the trapezoidal rule over u and of scalars, each relative to its largest value (or one)."""
        nodes = x[: (self.elements + 1) * self.n].reshape(-1, self.n)
        scale = np.maximum(np.abs(nodes).max(axis=0), RELATIVE_FLOOR)
        weights = np.zeros_like(x)
        weights[: nodes.size] = (self._node_shares / scale**2).ravel()
        scalars = len(self.system.scalars)
        if scalars:
            weights[-scalars:] = 1.0 / np.maximum(np.abs(x[-scalars:]), RELATIVE_FLOOR) ** 2
        return weights

    @cached_property
    def _node_shares(self) -> Array:
        """Weights (N + 1, 1) of the trapezoidal rule."""
        return 0.5 * (np.append(self._widths, 0.0) + np.append(0.0, self._widths))[:, None]

    def stored_norm(self, dq: Array, q: Array) -> float:
        """Largest change of any stored quantity relative to its largest value (or one)."""
        return float(_largest_relative(dq, q, len(q) // (self.elements * self.degree + 2), dq[:0]))

    def adapted(self, x: Array) -> "CollocationProblem":
        """On a mesh that follows x, refined to the next size where the estimated error exceeds the tolerance."""
        mesh = adapted_mesh(self.unpack(x), self.tolerance)
        return self if mesh is self.mesh else self.on_mesh(mesh)

    def carried(self, x: Array, other: AbstractProblem) -> Array:
        """x on the mesh of another problem with the same system."""
        assert isinstance(other, CollocationProblem)
        return other.pack(self.unpack(x).on_mesh(other.mesh))

    def on_mesh(self, mesh: Array) -> "CollocationProblem":
        """The same problem on another mesh."""
        return replace(self, mesh=mesh)

    def refined(self) -> "CollocationProblem":
        """On a mesh with every element halved."""
        return self.on_mesh(np.sort(np.concatenate([self.mesh, 0.5 * (self.mesh[1:] + self.mesh[:-1])])))

    @cached_property
    def _symmetry(self) -> Symmetry | None:
        return self.system.symmetry

    def reflected(self, x: Array, increment: bool = False) -> Array | None:
        """The mirror image of a state, or of an increment, under the system's symmetry."""
        symmetry = self._symmetry
        if symmetry is None:
            return None
        return self.pack(self.unpack(x).reflected(symmetry, increment).on_mesh(self.mesh))
