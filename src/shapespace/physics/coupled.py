"""Linear laws that users write as a coefficient matrix between fluxes and forces (Sec. IV C, D), as terms of the functional.

Forces that are motions (strain rates, velocities) are odd under time reversal, all others (parameters, concentrations) even.
With odd forces X_1, even ones X_2 and the blocks of `onsager`, flipping the even pairs and eliminating the rates J_2 at held
X_2 leaves the Rayleigh density X_1 A X_1/2 + X_1 B X_2 and a constant: a dissipation, and a power that the couplings supply.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from shapespace.base.arrays import Array, Traced
from shapespace.physics.laws import Law, dissipation, power
from shapespace.physics.onsager import LinearLaws, Pair
from shapespace.physics.quantities import LOCAL_QUANTITIES
from shapespace.physics.term import Ledger

Matrix = Callable[..., Sequence[Sequence[Any]]]


def linear_laws(channel: str = "bulk", source: str = "chemical", **forces: str) -> Callable[[Matrix], list[Law]]:
    """Decorate a function that returns L of J = L X, rows of numbers: [L_11, L_12], [L_21, L_22].

    forces: for each flux its force, a local quantity or a parameter, in the order of the rows. The function's arguments are
    parameters and quantities that are no motion. Where the dissipation is booked says `channel`, where the couplings' power
    `source`. A flux `reaction_rate` of an even force, an energy, is a reaction's rate per area [1/(L^2 T)], and becomes an
    observable. Reciprocity and the second law are checked where a model is defined, and with the values of every scenario.
    """
    pairs = tuple(Pair(flux, force, 1 - 2 * _is_motion(force)) for flux, force in forces.items())
    reacting = [i for i, pair in enumerate(pairs) if pair.signature > 0 and pair.flux == Ledger.RATE]
    if not any(pair.signature < 0 for pair in pairs):
        raise ValueError(
            f"forces = {list(forces.values())}: none of them is a motion, so that no work is done; add one."
        )

    def decorate(function: Matrix) -> list[Law]:
        given = tuple(inspect.signature(function).parameters)
        moving = [name for name in given if _is_motion(name)]
        if moving:
            raise ValueError(f"{function.__name__}: coefficients cannot depend on the motion ({moving[0]}).")

        def quadratic(**values: Traced) -> Traced:
            return _form(pairs, function, given, values, -1, 1.0)

        def bilinear(**values: Traced) -> Traced:
            return _form(pairs, function, given, values, 1, -1.0)

        def rate(**values: Traced) -> Traced:
            row = function(**{name: values[name] for name in given})[reacting[0]]
            return sum((row[j] * values[pair.force] for j, pair in enumerate(pairs)), start=jnp.zeros(()))

        def check(arguments: Mapping[str, Array], constants: Mapping[str, float]) -> None:
            local = {name: np.ravel(arguments[name]) for name in given if name in arguments}
            for i in range(max((len(one) for one in local.values()), default=1)):
                at = {name: constants[name] if name in constants else float(local[name][i]) for name in given}
                LinearLaws(pairs, np.array(function(**at), dtype=float)).check()

        odd = tuple(pair.force for pair in pairs if pair.signature < 0)
        even = tuple(pair.force for pair in pairs if pair.signature > 0)
        _name(quadratic, function.__name__, (*given, *odd))
        laws = [Law(quadratic, dissipation(channel)(quadratic).ledger, check)]
        if even:
            _name(bilinear, f"{function.__name__}_coupling", (*given, *odd, *even))
            laws.append(power(source)(bilinear))
        if reacting:
            _name(rate, f"{function.__name__}_rate", (*given, *odd, *even))
            laws.append(Law(rate, Ledger.RATE))
        return laws

    return decorate


def _is_motion(name: str) -> bool:
    return name in LOCAL_QUANTITIES and LOCAL_QUANTITIES[name].is_motion


def _name(function: Callable[..., Traced], name: str, arguments: tuple[str, ...]) -> None:
    """Of what is made of a matrix: laws are known by the names of their functions and of their arguments."""
    function.__name__ = name
    keyword = inspect.Parameter.KEYWORD_ONLY
    unique = dict.fromkeys(arguments)
    vars(function)["__signature__"] = inspect.Signature([inspect.Parameter(one, keyword) for one in unique])


def _form(
    pairs: tuple[Pair, ...],
    function: Matrix,
    given: tuple[str, ...],
    values: Mapping[str, Traced],
    signature: int,
    factor: float,
) -> Traced:
    """factor X_1 L_1j X_j summed over forces j of one signature."""
    matrix = function(**{name: values[name] for name in given})
    total = jnp.zeros(())
    for i, row in enumerate(pairs):
        for j, column in enumerate(pairs):
            if row.signature < 0 and column.signature == signature:
                total = total + factor * matrix[i][j] * values[row.force] * values[column.force]
    return total
