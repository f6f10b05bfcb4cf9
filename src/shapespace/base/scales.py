"""Quantities, their dimensions, and the scales that turn the user's numbers into the solver's dimensionless ones.

The solver only ever sees numbers in units of four scales (c0 = reference_concentration),

                   length               energy                     time                               concentration
    closed surface R0 = sphere_radius   kappa = bending_rigidity   tau = bulk_viscosity R0^2/kappa    c0
    open membrane  R_b = base_radius    kappa = bending_rigidity   tau = shear_viscosity R_b^2/kappa  none
    vesicle        R_A = area_radius    kappa = bending_rigidity   tau = bulk_viscosity R_A^2/kappa   none

so two statements of one experiment in different units are the same computation, to round-off.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from shapespace.base.errors import InputError
from shapespace.base.units import Dimension, Units, write_factors

Value = TypeVar("Value", float, NDArray[np.float64])


class Quantity(NamedTuple):
    """One name of the public interface: its symbol in formulas, its meaning, its dimension."""

    symbol: str
    meaning: str
    dimension: Dimension


_NUMBER = Dimension()
_LENGTH = Dimension(1)
_AREA = Dimension(2)
_CURVATURE = Dimension(-1)
_ENERGY = Dimension(energy=1)
_TIME = Dimension(time=1)
_RATE = Dimension(time=-1)
_TENSION = Dimension(-2, 1)
_VISCOSITY = Dimension(-2, 1, 1)
_FORCE = Dimension(-1, 1)
_POWER = Dimension(0, 1, -1)
_VELOCITY = Dimension(1, 0, -1)
_CONCENTRATION = Dimension(concentration=1)

QUANTITIES: dict[str, Quantity] = {
    # keys of scenarios
    "bending_rigidity": Quantity("kappa", "bending rigidity", _ENERGY),
    "mean_curvature_rigidity": Quantity("kappa_H", "rigidity of the bending energy kappa_H (H - C)^2", _ENERGY),
    "spontaneous_curvature": Quantity("C0", "spontaneous curvature", _CURVATURE),
    "spontaneous_mean_curvature": Quantity("C", "spontaneous value of H in kappa_H (H - C)^2", _CURVATURE),
    "shear_viscosity": Quantity("eta_s", "surface shear viscosity", _VISCOSITY),
    "bulk_viscosity": Quantity("eta_b", "surface bulk viscosity", _VISCOSITY),
    "friction": Quantity("Gamma", "tangential friction with the surroundings", Dimension(-4, 1, 1)),
    "normal_friction": Quantity("Gamma_n", "friction with the surroundings along the normal", Dimension(-4, 1, 1)),
    "tension": Quantity("gamma", "isotropic tension, given or holding the area", _TENSION),
    "boundary_tension": Quantity("gamma0", "tension of the reservoir at the rim", _TENSION),
    "active_tension": Quantity("(xi Delta mu)_0", "active tension at saturation", _TENSION),
    "peclet": Quantity("Pe", "Peclet number (xi Delta mu)_0 R0^2 / (D eta_b)", _NUMBER),
    "inverse_hydrodynamic_length": Quantity(
        "R0/L_h", "ratio of R0 to the hydrodynamic length sqrt(eta_b/Gamma)", _NUMBER
    ),
    "diffusivity": Quantity("D", "diffusivity of the stress regulator", Dimension(2, 0, -1)),
    "turnover_rate": Quantity("k", "turnover rate of the stress regulator", _RATE),
    "reference_concentration": Quantity("c0", "reference concentration", _CONCENTRATION),
    "saturation_concentration": Quantity("c_s", "concentration at half saturation", _CONCENTRATION),
    "ring_amplitude": Quantity("Delta_c", "relative amplitude of the preferred ring", _NUMBER),
    "ring_width": Quantity("w", "width of the ring in u", _NUMBER),
    "sphere_radius": Quantity("R0", "radius of the sphere of the enclosed volume", _LENGTH),
    "enclosed_volume": Quantity("V0", "enclosed volume", Dimension(3)),
    "area_radius": Quantity("R_A", "radius of the sphere of the same area", _LENGTH),
    "base_radius": Quantity("R_b", "radius of the clamped rim", _LENGTH),
    "coat_area": Quantity("A_p", "area of the coat per 2 pi", _AREA),
    "coat_sharpness": Quantity("sigma_p", "sharpness of the coat's edge per 2 pi", Dimension(-2)),
    "pulled_area": Quantity("A_f", "area of the pulled patch per 2 pi", _AREA),
    "pulled_sharpness": Quantity("sigma_f", "sharpness of the pulled patch's edge per 2 pi", Dimension(-2)),
    "initial_background": Quantity("c_b", "initial uniform concentration over c0", _NUMBER),
    "initial_ring_amplitude": Quantity("c_r", "initial ring concentration over c0", _NUMBER),
    "seed_amplitude": Quantity("epsilon", "relative antisymmetric perturbation of the initial concentration", _NUMBER),
    "initial_oblate": Quantity("oblate", "switch that makes the initial spheroid a flat one", _NUMBER),
    "initial_leaning": Quantity("e", "antisymmetric part of the initial shape", _NUMBER),
    "until": Quantity("t_end", "end time", _TIME),
    "dt": Quantity("Delta_t", "fixed time step, 0 for adaptive steps", _TIME),
    "time_tolerance": Quantity("tol_t", "relative local error of one adaptive step", _NUMBER),
    "stationary_rate": Quantity("rate", "largest relative rate of change per tau that counts as stationary", _NUMBER),
    "max_steps": Quantity("n_max", "largest number of time steps", _NUMBER),
    "elements": Quantity("N", "number of collocation elements", _NUMBER),
    "degree": Quantity("k_G", "Gauss points per element", _NUMBER),
    "mesh_tolerance": Quantity("tol_u", "relative discretisation error aimed at", _NUMBER),
    "azimuthal_flow": Quantity("v_phi", "switch that makes the azimuthal flow an unknown", _NUMBER),
    "parameterization": Quantity("q^u", "how the mesh follows the surface: sle, eulerian or lagrangian", _NUMBER),
    # observables
    "time": Quantity("t", "time", _TIME),
    "height": Quantity("d", "height z(0) - z(1)", _LENGTH),
    "neck_radius": Quantity("r_n", "neck radius", _LENGTH),
    "equator_radius": Quantity("r(1/2)", "radius at u = 1/2", _LENGTH),
    "length": Quantity("L", "length of the generating curve", _LENGTH),
    "area": Quantity("A", "area", _AREA),
    "volume": Quantity("V", "enclosed volume", Dimension(3)),
    "pressure": Quantity("p", "pressure difference, inside minus outside", Dimension(-3, 1)),
    "tension_pole": Quantity("T(0)", "isotropic tension at u = 0", _TENSION),
    "velocity": Quantity("v0", "axial swimming speed", _VELOCITY),
    "polarity": Quantity("P", "shape polarity 1 - H(0)/H(1)", _NUMBER),
    "max_concentration": Quantity("max c", "largest concentration", _CONCENTRATION),
    "ring_position": Quantity("u_m", "mesh coordinate of the largest concentration", _NUMBER),
    "pulling_force": Quantity("F_pull", "true pulling force", _FORCE),
    "pulling_force_per_2pi": Quantity("F_pull/2pi", "pulling force over 2 pi", _FORCE),
    "bending_energy": Quantity("F_kappa", "bending energy", _ENERGY),
    "energy": Quantity("F", "free energy: bending plus passive tension", _ENERGY),
    "energy_rate": Quantity("dF/dt", "rate of change of the free energy", _POWER),
    "dissipation": Quantity("2 D", "dissipation rate, temperature times entropy production", _POWER),
    "shear_dissipation": Quantity("2 D_s", "dissipation by shear viscosity", _POWER),
    "bulk_dissipation": Quantity("2 D_b", "dissipation by bulk viscosity", _POWER),
    "bending_dissipation": Quantity("2 D_c", "dissipation by changes of curvature", _POWER),
    "friction_dissipation": Quantity("2 D_f", "dissipation by friction with the surroundings", _POWER),
    "chemical_dissipation": Quantity("2 D_r", "dissipation by the chemical reaction", _POWER),
    "external_power": Quantity("P_ext", "power of external forces and of the ends", _POWER),
    "force_power": Quantity("P_f", "power of external forces", _POWER),
    "boundary_power": Quantity("P_b", "power of what drives the ends, such as a reservoir", _POWER),
    "chemical_power": Quantity("P_chem", "power of the active tension", _POWER),
    "reaction_rate": Quantity("R_p", "rate of the reaction, of the whole surface", _RATE),
    "energy_residual": Quantity("R_E", "rest of the energy law", _POWER),
    "amount": Quantity("M", "total amount of the stress regulator", Dimension(2, 0, 0, 1)),
    "amount_supply": Quantity("dM/dt", "exchange of regulator with the surroundings", Dimension(2, 0, -1, 1)),
    "discretisation_error": Quantity("eps_u", "estimated error of the discretisation", _NUMBER),
    "boundary_residual": Quantity("R_B", "residual of the boundary and integral conditions", _NUMBER),
    "max_meridional_curvature": Quantity("max |C_u^u|", "largest meridional curvature", _CURVATURE),
    "reduced_volume": Quantity("v", "reduced volume", _NUMBER),
    # fields along the curve
    "mesh_coordinate": Quantity("u", "mesh coordinate", _NUMBER),
    "radius": Quantity("r", "distance from the axis", _LENGTH),
    "axial_position": Quantity("z", "position along the axis in the lab frame", _LENGTH),
    "tangent_angle": Quantity("psi", "tangent angle", _NUMBER),
    "meridional_curvature": Quantity("C_u^u", "meridional curvature", _CURVATURE),
    "azimuthal_curvature": Quantity("C_phi^phi", "azimuthal curvature", _CURVATURE),
    "tangential_velocity": Quantity("v_u", "tangential velocity in the lab frame", _VELOCITY),
    "normal_velocity": Quantity("v_n", "normal velocity in the lab frame", _VELOCITY),
    "concentration": Quantity("c", "concentration of the stress regulator", _CONCENTRATION),
    "second_concentration": Quantity("c_2", "concentration of the second species", _CONCENTRATION),
    "azimuthal_velocity": Quantity("v_phi", "velocity about the axis", _VELOCITY),
    "local_spontaneous_curvature": Quantity("C0(u)", "local spontaneous curvature", _CURVATURE),
    "local_tension": Quantity("gamma_H", "local tension", _TENSION),
}


_RADII = {"sphere_radius": "R0", "base_radius": "R_b", "area_radius": "R_A"}


@dataclass(frozen=True)
class Scales:
    """The four scales of one scenario, in the user's units. All finite and > 0.

    A unit string is in the units that the scenario declares (`um/s`). Without them it names a scale where it is the unit (its
    value is 1: `R0/tau`) and otherwise says in words that the number is in the units of the scenario (`length/time`).
    """

    length: float
    energy: float
    time: float
    concentration: float = 1.0
    length_symbol: str = "R0"
    units: Units | None = None

    def __post_init__(self) -> None:
        for name in Dimension._fields:
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(
                    f"{name} scale = {value:g}: must be finite and > 0; choose units in which the parameters "
                    "are neither huge nor tiny."
                )

    @classmethod
    def of(cls, parameters: Mapping[str, float], units: Units | None = None) -> Self:
        """The scales of a set of parameters, of the model to which its radius belongs; units: what their numbers are in."""
        radius, symbol = next((name, symbol) for name, symbol in _RADII.items() if name in parameters)
        length = parameters[radius]
        viscosity = parameters["shear_viscosity" if radius == "base_radius" else "bulk_viscosity"]
        energy = parameters["bending_rigidity"]
        return cls(
            length=length,
            energy=energy,
            time=viscosity * length / energy * length,
            concentration=parameters.get("reference_concentration", 1.0),
            length_symbol=symbol,
            units=units,
        )

    def factor(self, name: str) -> float:
        """The unit of a quantity: its value in the user's units is this times its dimensionless value."""
        if name not in self._factors:
            self._factors[name] = self._factor(name)
        return self._factors[name]

    @cached_property
    def _factors(self) -> dict[str, float]:
        """Those asked for so far."""
        return {}

    def _factor(self, name: str) -> float:
        dimension = QUANTITIES[name].dimension
        try:
            factor = math.prod(getattr(self, base) ** exponent for base, exponent in dimension._asdict().items())
        except (OverflowError, ZeroDivisionError):
            factor = math.inf
        if not (math.isfinite(factor) and factor > 0):
            raise InputError(
                f"{name}: its unit {self._symbols(dimension, words=True)} over- or underflows; choose units in which "
                "the parameters are neither huge nor tiny."
            )
        return factor

    def to_dimensionless(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Dimensionless values of any named quantities, times and steps included."""
        values = {name: value / self.factor(name) for name, value in parameters.items()}
        for name, value in values.items():
            if not math.isfinite(value):
                raise InputError(
                    f"{name} = {parameters[name]:g}: is {value} in units of the scales; choose other units."
                )
        return values

    def from_dimensionless(self, name: str, value: Value) -> Value:
        """A dimensionless number or array in the user's units."""
        return value * self.factor(name)

    def unit(self, name: str) -> str:
        """The unit of a quantity as text: `R0/tau`, `kappa/R0^2`, `um/s`, `rad`, `1`."""
        return "rad" if name == "tangent_angle" else self._symbols(QUANTITIES[name].dimension)

    def _symbols(self, dimension: Dimension, *, words: bool = False) -> str:
        if self.units is not None and not words:
            return self.units.label(dimension)
        symbols = {"length": self.length_symbol, "energy": "kappa", "time": "tau", "concentration": "c0"}
        return write_factors(
            (base if words or getattr(self, base) != 1.0 else symbols[base], getattr(dimension, base))
            for base in ("energy", "length", "time", "concentration")
        )
