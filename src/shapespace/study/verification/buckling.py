"""Rods, rings, films and liquid columns by the continuation that branches of surfaces use."""

from collections.abc import Iterator

import numpy as np
from scipy.integrate import simpson
from scipy.special import ellipk

from shapespace.analysis.bifurcation import Kind
from shapespace.analysis.tracing import side_branches
from shapespace.study.verification import classic
from shapespace.study.verification.classic import at_rest, circle, constant
from shapespace.study.verification.paths import begin, follow, singular, state_at
from shapespace.study.verification.record import Row

FORM = "closed form"
MEETING = 2.183379046
"""Load over pi^2 at which the ends of the elastica meet."""
CONTACT = 5.24688696
"""Pressure at which opposite sides of the buckled ring touch; nothing is transmitted there but k^2/2 - s = 0, with k = -1."""


def elastica() -> Iterator[Row]:
    """A rod with hinged ends under a load: where it buckles, and its end angle beyond."""
    problem = classic.elastica()
    _, located = follow(begin(problem, at_rest(problem), [5.0]), 45.0)
    for n, one in enumerate(located, start=1):
        yield Row(f"load {n} at which it buckles, over pi^2", one.point.parameter / np.pi**2, float(n**2), FORM, 1e-9)
    start = side_branches(located[0].point, located[0].bracket.after.tangent, 0.05)[0]
    for angle in (20.0, 90.0, 120.0):
        load = (2.0 * float(ellipk(np.sin(0.5 * np.radians(angle)) ** 2)) / np.pi) ** 2
        points, _ = follow(start, load * np.pi**2)
        end = abs(np.degrees(state_at(points[-1]).nodes[0, 0]))
        yield Row(f"end angle at {load:.9f} pi^2, in degrees", float(end), angle, f"{FORM}; Timoshenko & Gere", 1e-8)
    points, _ = follow(start, MEETING * np.pi**2)
    u = np.linspace(0.0, 1.0, 4001)
    span = float(simpson(np.cos(state_at(points[-1]).values(u)[:, 0]), x=u))
    yield Row(f"distance of the ends at {MEETING} pi^2", span, 0.0, FORM, 1e-8)


def ring() -> Iterator[Row]:
    """The circle buckles under pressure, and the sides of the two-lobed ring come to touch."""
    problem = classic.ring(120)
    _, located = follow(begin(problem, circle(problem, 0.5), [0.5]), 16.0)
    for n, one in enumerate(located, start=2):
        yield Row(f"pressure of the pitchfork into {n} lobes", one.point.parameter, n**2 - 1.0, FORM, 1e-9)
    source = "Flaherty, Keller & Rubinow 1972: 5.247"
    start = side_branches(located[0].point, located[0].bracket.after.tangent, 0.05)[0]
    points, _ = follow(start, CONTACT)
    state = state_at(points[-1])
    yield Row(f"tension s at p = {CONTACT}, where sides touch", float(state.scalars[0]), 0.5, source, 1e-7)
    least = float(state.values(np.linspace(0.0, 1.0, 9))[:, 0].min())
    yield Row("curvature at the contact", least, -1.0, source, 1e-7)


def films() -> Iterator[Row]:
    """A soap film between two rings breaks, a cylinder of liquid forms beads."""
    problem = classic.soap_film()
    (fold,) = singular(begin(problem, constant(problem, (1.0, 0.0)), [0.1]), Kind.FOLD, 1)
    yield Row("catenoid: half the distance of the rings at the fold", 0.5 * fold.parameter, 0.662743419349, FORM, 1e-9)
    neck = float(state_at(fold).values(np.array([0.5]))[0, 0])
    yield Row("catenoid: neck radius there", neck, 0.552434124531, FORM, 1e-8)
    problem = classic.liquid_column()
    (fork,) = singular(begin(problem, constant(problem, (1.0, 0.0), (1.0,)), [5.0]), Kind.PITCHFORK, 1)
    yield Row("liquid column: length of the pitchfork", fork.parameter, 2.0 * np.pi, f"{FORM}, Plateau", 1e-9)
