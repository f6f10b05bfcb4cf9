"""Guided division and the coated membrane: folds of the paper's figures against another program and finer meshes; balances."""

from collections.abc import Iterator

import numpy as np
from scipy.interpolate import CubicSpline

from shapespace.study.branching import branch
from shapespace.study.engine import Engine
from shapespace.study.run import run
from shapespace.study.scenario import scenario
from shapespace.study.steady import steady
from shapespace.study.verification.record import Row
from shapespace.study.verification.states import Absent, found_state, special_point

AUTO = "AUTO-07p 0.9.2 on the same equations, 60 x 4"
AUTO_FOLDS = (2.362474188, 1.293485375)
"""Of guided division at Pe = 450 in the ring amplitude; benchmarks/auto has the equations, benchmarks/README.md the table."""
FINER = {"elements": 80, "degree": 5, "mesh_tolerance": 1e-8}


def folds() -> Iterator[Row]:
    """Fig. 7b: ellipsoid and dumbbell."""
    found = branch(scenario("guided-division"), "ring_amplitude", 4.2, start=0.0, stability=False)
    for number, (name, exact) in enumerate(zip(("ellipsoid", "dumbbell"), AUTO_FOLDS, strict=True)):
        point = special_point(found, "fold", number)
        yield Row(f"ring amplitude where the {name} ends", point.parameter, exact, AUTO, 1e-6)


def neck() -> Iterator[Row]:
    """Fig. 6: the divided state, again on another mesh and of another degree; the amount that flows in balances what decays."""
    usual, finer = (found_state(steady(scenario("guided-division", **keys))) for keys in ({}, FINER))
    source = "the same with degree 5, 80 elements"
    for key, tolerance in (("neck_radius", 1e-6), ("pressure", 1e-6), ("height", 1e-6)):
        yield Row(key.replace("_", " "), usual.observables[key], finer.observables[key], source, tolerance)
    seen = usual.observables
    decay = seen["amount"] * Engine.of(usual.scenario).values["turnover_rate"]
    yield Row(
        "regulator: what flows in less what decays, of that", seen["amount_supply"] / decay, 0.0, "conserved", 1e-7
    )


def gibbs_loop() -> Iterator[Row]:
    """Fig. 3a: the coated membrane's two folds, again on another mesh and of another degree."""
    cases = (scenario("membrane-protrusion", **keys) for keys in ({}, FINER))
    usual, finer = (
        branch(case, "spontaneous_curvature", 12.0, start=0.0, state="trivial", stability=False) for case in cases
    )
    for number, name in enumerate(("upper", "lower")):
        value, reference = (special_point(one, "fold", number).parameter for one in (usual, finer))
        yield Row(f"C0 R_b of the {name} fold", value, reference, "the same with degree 5, 80 elements", 1e-6)


def balances() -> Iterator[Row]:
    """A surface that begins to divide: enclosed volume, and energy against dissipation and power, over the run."""
    done = run(scenario("guided-division", until=0.05))
    assert done.outcome is not None
    if not done.outcome.is_success:
        raise Absent(f"{done.outcome}: {done.outcome.advice}")
    frames = done.frames[1:]
    volume = max(frames, key=lambda frame: abs(frame.observables["volume"] - 4.0 * np.pi / 3.0)).observables["volume"]
    yield Row("enclosed volume, worst of all steps", volume, 4.0 * np.pi / 3.0, "conserved", 1e-10)
    lost, spent = (
        sum(abs(frame.observables[name]) * frame.step for frame in frames)
        for name in ("energy_residual", "dissipation")
    )
    yield Row("energy not accounted for, of that dissipated", lost / spent, 0.0, "first and second law", 1e-3)
    times, supplies = zip(*((frame.time, frame.observables["amount_supply"]) for frame in frames), strict=True)
    gained = float(CubicSpline(times, supplies).integrate(times[0], times[-1]))
    amounts = [frame.observables["amount"] for frame in frames]
    yield Row(
        "regulator: gain over its exchange, integrated", (amounts[-1] - amounts[0]) / gained, 1.0, "conserved", 1e-3
    )
    closed = run(scenario("guided-division", turnover_rate=0.0, peclet=20.0, until=0.05)).frames
    first = closed[0].observables["amount"]
    worst = max((frame.observables["amount"] for frame in closed), key=lambda amount: abs(amount - first))
    yield Row("regulator without turnover, worst of all steps, of the first", worst / first, 1.0, "conserved", 1e-9)
