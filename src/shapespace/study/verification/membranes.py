"""Open membranes and vesicles: buckling, pulling, and published shapes."""

from collections.abc import Iterator

import numpy as np

from shapespace.study.branching import branch
from shapespace.study.dataset import profile_of
from shapespace.study.scenario import scenario
from shapespace.study.steady import Steady, follow, steady
from shapespace.study.verification.closed_forms import buckling_tension, point_response, tether_force, tube_radius
from shapespace.study.verification.record import Row
from shapespace.study.verification.states import Absent, found_state, special_point

FORM = "closed form"
SEIFERT = "Seifert, Berndl & Lipowsky 1991, two digits"
BALL = 4.0 * np.pi / 3.0
COATED = 2.0
"""C0 R_b of the coated tube."""
THROUGHOUT = 10.0
"""Area of the coat over 2 pi, more than any of these surfaces has."""


def buckling() -> Iterator[Row]:
    """A clamped disc without coat and pull."""
    case = scenario("membrane-protrusion", spontaneous_curvature=0.0)
    found = branch(case, "boundary_tension", -15.0, start=-14.0, state="trivial", stability=False)
    yield Row("tension of the pitchfork", special_point(found, "pitchfork").parameter, buckling_tension(), FORM, 1e-9)


def pull() -> Iterator[Row]:
    """A force on a small patch of area a at the centre; the miss is O(a ln a)."""
    area = 8e-5
    case = scenario(
        "membrane-protrusion", spontaneous_curvature=0.0, boundary_tension=12.5, elements=80,
        pulled_area=area, pulled_sharpness=2.0 / area, pulling_force=0.01,
    )  # fmt: skip
    seen = found_state(steady(case)).observables
    yield Row(
        "height per force", seen["height"] / seen["pulling_force"], point_response(12.5), f"{FORM}, patch to 0", 3e-3
    )


def tether() -> Iterator[Row]:
    """Long tubes under a prescribed height, bare and coated throughout; what the ends add dies away exponentially."""
    source = f"{FORM}, long tube"
    for name, curvature in (("bare", 0.0), ("coated", COATED)):
        case = scenario(
            "membrane-protrusion", spontaneous_curvature=curvature, boundary_tension=12.5, coat_area=THROUGHOUT,
        )  # fmt: skip
        held = branch(case, "height", 8.0, start=0.5, free="pulling_force", stability=False)
        end = special_point(held, "end")
        profile = profile_of(held.scenario_at(end), end.frame)
        half = 0.5 * profile["axial_position"][0]
        radius = np.interp(-half, -profile["axial_position"], profile["radius"])
        yield Row(f"{name} tube: plateau of the force", end.value, tether_force(12.5, curvature), source, 1e-6)
        yield Row(f"{name} tube: radius half way up", float(radius), tube_radius(12.5, curvature), source, 1e-5)


def crossings() -> Iterator[Row]:
    """Two shapes of equal bending energy at C0 = 0."""
    for first, second, guess, published in (("prolate", "oblate", 0.652, 0.65), ("oblate", "stomatocyte", 0.592, 0.59)):
        found = _crossing(*(_vesicle(guess, name) for name in (first, second)))
        yield Row(f"reduced volume where {first} = {second}", found, published, SEIFERT, 5e-3 / published)


def near_sphere(share: float = 1e-4) -> Iterator[Row]:
    """A vesicle of nearly the volume of the sphere: it yields to l = 2. Both signs averaged, what is linear in 1 - v removed."""
    means = [
        np.mean([_vesicle(1.0 - part, name).observables["tension"] for name in ("prolate", "oblate")])
        for part in (10.0 * share, share)
    ]
    yield Row("tension as v tends to 1", float(10.0 * means[1] - means[0]) / 9.0, -6.0, FORM, 1e-6)


def tubes() -> Iterator[Row]:
    """The middle of a long prolate of radius rho."""
    seen = _vesicle(0.3, "prolate").observables
    radius = seen["equator_radius"]
    yield Row("p rho^3/kappa of a long prolate", seen["pressure"] * radius**3, -2.0, f"{FORM}, long tube", 1e-5)
    yield Row("sigma rho^2/kappa of a long prolate", seen["tension"] * radius**2, -1.5, f"{FORM}, long tube", 1e-5)


def _vesicle(volume: float, name: str) -> Steady:
    return found_state(steady(scenario("vesicle", reduced_volume=volume), state=name))


def _crossing(one: Steady, other: Steady) -> float:
    """Where two states have the same energy, by Newton's method with dF/dv = 4 pi p/3."""
    volume = float(one.found.p[0])
    for _ in range(10):
        a, b = one.observables, other.observables
        change = (a["bending_energy"] - b["bending_energy"]) / (BALL * (b["pressure"] - a["pressure"]))
        volume += change
        if abs(change) < 1e-10:
            return volume
        one, other = (found_state(follow(state, "reduced_volume", volume)) for state in (one, other))
    raise Absent(f"no crossing near the reduced volume {volume:.4g}.")
