"""Linear laws: what Onsager and the second law allow, the flip, and the functional from which the laws come back."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tests.physics.test_terms import random_site
from tests.surfaces import make_engine, march

from shapespace.base.arrays import Array
from shapespace.models import closed_surface
from shapespace.numerics.newton import Newton
from shapespace.physics.activity import ActiveTension, Reaction, ReactionDissipation, ReactionSupply
from shapespace.physics.onsager import REACTION, LinearLaws, Pair, reaction_laws
from shapespace.study.observables import measure

PAIRS = (
    Pair("stress", "shear", -1),
    Pair("tension", "dilation", -1),
    Pair("rate", "potential", 1),
    Pair("flow", "heat", 1),
)
SIGNS = np.array([pair.signature for pair in PAIRS])
examples = settings(max_examples=40, deadline=None)


def random_laws(seed: int, lowest: float) -> LinearLaws:
    """Reciprocal laws: the smallest eigenvalue of the dissipative part is `lowest`; the reactive part is any."""
    rng = np.random.default_rng(seed)
    same = np.outer(SIGNS, SIGNS) > 0
    raw = rng.normal(size=(4, 4))
    symmetric = np.where(same, raw @ raw.T, 0.0)
    symmetric += (lowest - np.linalg.eigvalsh(symmetric)[0]) * np.eye(4)
    return LinearLaws(PAIRS, symmetric + np.where(same, 0.0, raw - raw.T))


@examples
@given(seed=st.integers(0, 10**6), lowest=st.floats(0.05, 2.0))
def test_allowed_laws_pass_and_come_back_from_their_functional(seed: int, lowest: float):
    laws = random_laws(seed, lowest)
    laws.check()
    odd = laws.dissipative()
    odd.check()
    matrix = np.asarray(odd.coefficients)
    assert_allclose(matrix, matrix.T, rtol=1e-9, atol=1e-9)
    assert np.linalg.eigvalsh(matrix)[0] > 0.0, "every coupling dissipates"
    forces = np.random.default_rng(seed + 1).normal(size=4)
    assert_allclose(jax.grad(odd.rayleigh)(forces), odd.fluxes(forces), rtol=1e-9, atol=1e-9)
    back = odd.flipped("rate", "flow")
    assert back.pairs == laws.pairs
    assert_allclose(back.coefficients, laws.coefficients, rtol=1e-8, atol=1e-8)
    # The same state of the same laws: the fluxes of one statement are forces of the other, the entropy is one number.
    fluxes = np.asarray(laws.fluxes(forces))
    other = np.where(SIGNS > 0, fluxes, forces)
    assert_allclose(odd.fluxes(other), np.where(SIGNS > 0, forces, fluxes), rtol=1e-8, atol=1e-8)
    assert_allclose(odd.entropy_production(other), laws.entropy_production(forces), rtol=1e-8, atol=1e-8)


@examples
@given(seed=st.integers(0, 10**6), lowest=st.floats(-2.0, -0.05))
def test_laws_that_destroy_entropy_are_refused(seed: int, lowest: float):
    with pytest.raises(ValueError, match="entropy"):
        random_laws(seed, lowest).check()


@examples
@given(seed=st.integers(0, 10**6), place=st.sampled_from([(i, j) for i in range(4) for j in range(4) if i != j]))
def test_laws_without_reciprocity_are_refused(seed: int, place: tuple[int, int]):
    laws = random_laws(seed, 0.5)
    matrix = np.array(laws.coefficients)
    matrix[place] += 0.1
    with pytest.raises(ValueError, match=r"partner.*\(Onsager\)"):
        LinearLaws(PAIRS, matrix).check()


MIXED = (
    r"of dilation in reaction_rate is 2: its partner, the coefficient of potential in tension, is 2\..*"
    r"opposite signatures, reactive and antisymmetric.*must be -2"
)
MESSAGES: list[tuple[list[list[float]], str]] = [
    ([[1.0, 2.0], [2.0, 1.0]], MIXED),
    ([[-1.0, 2.0], [-2.0, 1.0]], "of dilation in tension is -1: it destroys entropy; it must be >= 0"),
    ([[1.0, 2.0], [-2.0, -3.0]], "of potential in reaction_rate is -3: it destroys entropy; it must be >= 0"),
    ([[1.0, np.nan], [-2.0, 3.0]], "must be finite"),
    ([[1.0, 2.0, 3.0]], r"must be 2 by 2 for 2 pairs, came as \(1, 3\)"),
]  # fmt: skip


@pytest.mark.parametrize(("matrix", "message"), MESSAGES)
def test_errors_name_coefficient_partner_and_sign(matrix: list[list[float]], message: str):
    with pytest.raises(ValueError, match=message):
        LinearLaws(REACTION, np.array(matrix)).check()


def test_couplings_within_one_signature_have_a_largest_size():
    odd = (Pair("a", "x", -1), Pair("b", "y", -1))
    LinearLaws(odd, np.array([[1.0, 2.0], [2.0, 4.0]])).check()
    with pytest.raises(ValueError, match="within -2 and 2"):
        LinearLaws(odd, np.array([[1.0, 2.1], [2.1, 4.0]])).check()
    with pytest.raises(ValueError, match=r"symmetric under.*must be -1"):
        LinearLaws(odd, np.array([[1.0, -1.0], [1.0, 4.0]])).check()
    three = (*odd, Pair("c", "w", -1))
    with pytest.raises(ValueError, match="every two forces are allowed"):
        LinearLaws(three, np.array([[1.0, -0.9, -0.9], [-0.9, 1.0, -0.9], [-0.9, -0.9, 1.0]])).check()
    with pytest.raises(ValueError, match="signature of x: must be 1"):
        LinearLaws((Pair("a", "x", 0),), np.eye(1)).check()
    with pytest.raises(ValueError, match="z: is no force of these laws; it is one of x, y"):
        LinearLaws(odd, np.eye(2)).flipped("z")


def test_the_flip_of_the_active_surface_is_that_of_the_paper():
    """Eqs. CR1, CR2: eta_b + xi^2/Lambda, xi/Lambda, 1/Lambda; the naive functional is refused."""
    laws = reaction_laws(0.7, 1.3, viscosity=0.4)
    laws.check()
    expected: Array = np.array([[0.4 + 0.7**2 / 1.3, 0.7 / 1.3], [0.7 / 1.3, 1 / 1.3]])
    assert_allclose(laws.dissipative().coefficients, expected, rtol=1e-14)
    with pytest.raises(ValueError, match="odd forces only"):
        laws.rayleigh(np.ones(2))


def test_reaction_at_its_stationary_rate_is_an_active_tension_and_a_constant():
    """(r_p + xi div v)^2/(2 Lambda) - r_p Delta mu = xi Delta mu div v - Lambda Delta mu^2/2."""
    site, active = random_site(4), ActiveTension(5.0, 0.4)
    reaction = Reaction(active, 1.3, 0.6)
    both = ReactionDissipation(reaction).power(site) + ReactionSupply(reaction).power(site)
    constant = 0.5 * 1.3 * 0.6**2 * site.geometry.r * site.geometry.h
    assert_allclose(both, active.power(site) - constant, rtol=1e-10, atol=1e-10)


def test_both_forms_of_the_active_coupling_move_a_surface_alike():
    """Fixed Delta mu, or r_p with flipped laws: one trajectory; budgets that differ by Lambda Delta mu^2 A and close."""
    fixed = make_engine("polar-swimmer", seed_amplitude=0.3)
    potential, mobility = 0.6, 1.3

    def terms(p):  # as models have them
        reaction = Reaction(ActiveTension(p.active_tension, p.saturation_concentration), mobility, potential)
        return ReactionDissipation(reaction), ReactionSupply(reaction)

    system = closed_surface.RECIPE.extended((), terms, without=("ActiveTension",)).system()
    rates = replace(fixed, problem=replace(fixed.problem, system=system))
    moments = [march(engine, 0.02, order=1, fixed_step=2e-3, newton=Newton(1e-12))[0] for engine in (fixed, rates)]
    assert len(moments[0]) == len(moments[1]) == 11
    for first, second in zip(*moments, strict=True):
        assert np.abs(second.x - first.x).max() < 1e-11 * np.abs(first.x).max()
    found = [path[-1] for path in moments]
    one, other = (measure(engine, m.x, m.rate) for engine, m in zip((fixed, rates), found, strict=True))
    # The largest unknowns are some hundred: what agrees to 1e-11 of them agrees to 1e-9 here.
    heat = mobility * potential**2 * one["area"]
    assert other["chemical_dissipation"] == pytest.approx(heat, rel=1e-9)
    assert other["chemical_power"] - one["chemical_power"] == pytest.approx(heat, rel=1e-8)
    assert potential * other["reaction_rate"] == pytest.approx(other["chemical_power"], rel=1e-12)
    assert "reaction_rate" not in one
    assert other["dissipation"] - one["dissipation"] == pytest.approx(heat, rel=1e-8)
    rests = [v["dissipation"] - v["chemical_power"] - v["external_power"] for v in (one, other)]
    assert rests[1] == pytest.approx(rests[0], abs=1e-9 * one["dissipation"])
