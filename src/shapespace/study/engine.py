"""A scenario as a problem: the model's system on a mesh, its parameters and its initial state, all dimensionless."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array
from shapespace.base.errors import InputError
from shapespace.geometry.spheroid import Spheroid
from shapespace.models import closed_surface, open_membrane, vesicle
from shapespace.models.recipe import Recipe
from shapespace.numerics.collocation import CollocationProblem
from shapespace.numerics.gauss import gauss_rule
from shapespace.numerics.mesh import uniform_mesh
from shapespace.numerics.pointwise import name_system
from shapespace.numerics.state import State, state_from_functions
from shapespace.physics.admission import check_second_law
from shapespace.study.frame import Frame
from shapespace.study.keys import MODELS
from shapespace.study.scenario import Scenario
from shapespace.variational.surface import SurfaceSystem

_RECIPES = {
    "closed-surface": closed_surface.RECIPE,
    "open-membrane": open_membrane.RECIPE,
    "vesicle": vesicle.RECIPE,
}


def recipe_of(model: str) -> Recipe:
    """What a model is made of, a shipped one or a user's."""
    own = MODELS[model].recipe
    return _RECIPES[model] if own is None else own


@cache
def _system(recipe: Recipe, azimuthal: bool, parameterization: str) -> SurfaceSystem:
    """Made once: functions are compiled for each system anew, but those of shipped models are kept."""
    system = recipe.system(azimuthal, parameterization)
    for name, shipped in _RECIPES.items():
        if recipe is shipped:
            name_system(system, f"{name}, azimuthal: {azimuthal}, {parameterization}")
    return system


@lru_cache(maxsize=64)
def _admit(recipe: Recipe, values: tuple[tuple[str, float], ...]) -> None:
    """InputError where a law of the user's breaks the second law with these values."""
    for law in recipe.laws:
        try:
            check_second_law(law, dict(values))
        except ValueError as error:
            raise InputError(str(error)) from None


BALL = 4.0 / 3.0 * np.pi


@dataclass(frozen=True)
class Engine:
    """What a scenario computes with. p: parameters (n_p,) in the system's order."""

    problem: CollocationProblem
    p: Array
    values: dict[str, float]

    @property
    def system(self) -> SurfaceSystem:
        """The surface's system."""
        system = self.problem.system
        assert isinstance(system, SurfaceSystem)
        return system

    @classmethod
    def of(cls, scenario: Scenario) -> "Engine":
        """The engine of a scenario on its initial, uniform mesh."""
        numerics = scenario.numerics
        system = _system(recipe_of(scenario.model), numerics.azimuthal_flow, numerics.parameterization)
        values = {"rotation_rate": 0.0, **scenario.dimensionless()}
        if scenario.kind == "closed-surface":
            values["enclosed_volume"] = BALL * values["sphere_radius"] ** 3
        elif scenario.kind == "vesicle":
            values["enclosed_volume"] = BALL * values["area_radius"] ** 3 * values["reduced_volume"]
            values["surface_area"] = 4.0 * np.pi * values["area_radius"] ** 2
            values["initial_oblate"] = float(scenario.values()["initial_oblate"])
        if (choice := numerics.parameterization) != "sle" and values.get("ring_amplitude", 0.0) != 0.0:
            raise InputError(
                f"parameterization = {choice!r}: the ring of the reference concentration lies at u = 1/2, which is the middle of "
                "the surface for sle only; give ring_amplitude=0 or parameterization=sle."
            )
        _admit(recipe_of(scenario.model), tuple(values.items()))
        p = np.array([values[name] for name in system.parameters])
        mesh = uniform_mesh(numerics.elements)
        return cls(CollocationProblem(system, mesh, numerics.degree, numerics.mesh_tolerance), p, values)

    def placed(self, state: State) -> tuple[CollocationProblem, Array]:
        """The problem on a state's mesh and the state on it, resampled where it has another degree or fewer elements."""
        degree, wanted = self.problem.degree, self.problem.elements
        if wanted > len(state.widths):
            mesh = np.interp(np.linspace(0.0, 1.0, wanted + 1), np.linspace(0.0, 1.0, len(state.mesh)), state.mesh)
            state = state.on_mesh(mesh)
        if degree != state.rule.degree:
            points = state.mesh[:-1, None] + state.widths[:, None] * gauss_rule(degree).points
            slopes, algebraic = (
                part(points.ravel()).reshape(*points.shape, -1) for part in (state.derivatives, state.algebraic_values)
            )
            values = state.values(state.mesh)
            state = state_from_functions(state.mesh, degree, values, slopes, algebraic, state.scalars)
        problem = self.problem.on_mesh(state.mesh)
        return problem, problem.pack(state)

    def initial_state(self) -> State:
        """The sphere, flat disc or spheroid at rest, with the initial concentration; multipliers are first guesses."""
        rule, mesh = gauss_rule(self.problem.degree), self.problem.mesh
        stages = mesh[:-1, None] + np.diff(mesh)[:, None] * rule.points
        functions = self._sphere if "sphere_radius" in self.values else self._spheroid
        if "base_radius" in self.values:
            functions = self._disc
        known = functions(mesh)[2]
        scalars = np.array([known.get(name, 0.0) for name in self.system.scalars])
        values = self._columns(functions(mesh)[0] | self._amounts(mesh, functions(mesh)[0]))
        slopes = self._columns(functions(stages)[1] | self._amounts(stages, functions(stages)[1], slope=True))
        known["gamma"] = self.values.get("boundary_tension", known.get("sigma", 0.0))
        even = np.array([known[name] for name in self.system.algebraic])
        algebraic = np.broadcast_to(even, (*stages.shape, len(even))).copy()
        return state_from_functions(mesh, self.problem.degree, values, slopes, algebraic, scalars)

    def _columns(self, functions: dict[str, Array]) -> Array:
        zero = np.zeros_like(functions["r"])
        return np.stack([functions.get(name, zero) for name in self.system.fields], axis=-1)

    def _amounts(self, u: Array, given: dict[str, Array], slope: bool = False) -> dict[str, Array]:
        """Concentrations, or their slopes, that the shape's own functions do not give: what turnover prefers."""
        found = {}
        for name, law in zip(("c", "c_2"), self.system.species_laws(jnp.asarray(self.p)), strict=False):
            if name not in given:
                preferred = jnp.vectorize(jax.grad(law.reference) if slope else law.reference)
                found[name] = np.asarray(preferred(jnp.asarray(u)))
        return found

    def _sphere(self, u: Array) -> tuple[dict[str, Array], dict[str, Array], dict[str, float]]:
        """Fields, their slopes, and h and p of the resting sphere with the scenario's initial concentration."""
        v, radius = self.values, self.values["sphere_radius"]
        angle, width = np.pi * u, v["ring_width"]
        ring = v["initial_ring_amplitude"] * np.exp(-(((u - 0.5) / width) ** 2))
        seed = 1.0 + v["seed_amplitude"] * np.cos(angle)
        c0 = v["reference_concentration"]
        c = c0 * (v["initial_background"] + ring) * seed
        dring = -2.0 * (u - 0.5) / width**2 * ring
        dc = c0 * (dring * seed - (v["initial_background"] + ring) * v["seed_amplitude"] * np.pi * np.sin(angle))
        tension = v["tension"] + v["active_tension"] * c0**2 / (c0**2 + v["saturation_concentration"] ** 2)
        curvature = v["bending_rigidity"] * (2.0 / radius - v["spontaneous_curvature"])
        amplitudes = {"r": radius, "moment": radius * curvature, "meridional_force": radius * tension}
        fields = {name: a * np.sin(angle) for name, a in amplitudes.items()}
        slopes = {name: np.pi * a * np.cos(angle) for name, a in amplitudes.items()}
        fields |= {"z": radius * np.cos(angle), "psi": angle, "c": c}
        slopes |= {"z": -np.pi * radius * np.sin(angle), "psi": np.full_like(u, np.pi), "c": dc}
        c_0 = v["spontaneous_curvature"]
        pressure = 2.0 * tension / radius + v["bending_rigidity"] * c_0 * (c_0 * radius - 2.0) / radius**2
        return fields, slopes, {"h": np.pi * radius, "p": pressure}

    def _spheroid(self, u: Array) -> tuple[dict[str, Array], dict[str, Array], dict[str, float]]:
        """Fields, their slopes, and h, p and sigma: a leaning spheroid at rest, multipliers as near a sphere.

        There the volume yields to l = 2 at p = -2 kappa (6 - C0 R)/R^3 (Ou-Yang and Helfrich, Phys. Rev. Lett. 59, 2486
        (1987)), which sigma = R p/2 - kappa C0 (C0 R - 2)/(2 R) balances.
        """
        v, radius = self.values, self.values["area_radius"]
        leaning = v["initial_leaning"] * np.sqrt(1.0 - v["reduced_volume"])
        shape = Spheroid.of(v["surface_area"], v["enclosed_volume"], bool(v["initial_oblate"]), leaning)
        t, h, c_0, kappa = shape.parameter(u), shape.length, v["spontaneous_curvature"], v["bending_rigidity"]
        (r, z), psi, (meridional, azimuthal) = shape.outline(t), shape.tangent_angle(t), shape.curvatures(t)
        pressure = -2.0 * kappa * (6.0 - c_0 * radius) / radius**3
        tension = 0.5 * radius * pressure - 0.5 * kappa * c_0 * (c_0 * radius - 2.0) / radius
        fields = {"r": r, "z": z, "psi": psi}
        slopes = {"r": h * np.cos(psi), "z": -h * np.sin(psi), "psi": h * meridional}
        fields |= {"moment": r * kappa * (meridional + azimuthal - c_0), "meridional_force": tension * r}
        # A first guess, like the multipliers: that of even curvature.
        slopes |= {"moment": slopes["r"] * kappa * (2.0 / radius - c_0), "meridional_force": tension * slopes["r"]}
        return fields, slopes, {"h": h, "p": pressure, "sigma": tension}

    def _disc(self, u: Array) -> tuple[dict[str, Array], dict[str, Array], dict[str, float]]:
        """Fields, their slopes, and h of the flat disc at the reservoir's tension."""
        radius, tension = self.values["base_radius"], self.values["boundary_tension"]
        fields = {"r": radius * u, "area": 0.5 * (radius * u) ** 2, "meridional_force": tension * radius * u}
        one = np.ones_like(u)
        slopes = {"r": radius * one, "area": radius**2 * u, "meridional_force": tension * radius * one}
        return fields, slopes, {"h": radius}


def state_of(frame: Frame) -> State:
    """The state that a frame holds."""
    return State(frame.mesh, frame.nodes, frame.slopes, frame.algebraic, frame.scalars)


def frame_of(problem: CollocationProblem, x: Array, observables: Mapping[str, float]) -> Frame:
    """A state at rest as a frame."""
    state = problem.unpack(x)
    still = np.zeros((*state.slopes.shape[:2], 2))
    return Frame(
        0.0, 0.0, 0.0, state.mesh, state.nodes, state.slopes, state.algebraic, state.scalars, still, dict(observables)
    )


def even_points(mesh: Array, count: int) -> Array:
    """Points u (count,) from 0 to 1, spread evenly over the elements of a mesh."""
    return np.interp(np.linspace(0.0, len(mesh) - 1.0, count), np.arange(len(mesh)), mesh)
