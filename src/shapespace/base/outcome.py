"""How a computation ended: a named value with advice, never a bare flag."""

from enum import StrEnum


class Outcome(StrEnum):
    """The end of a solve or of a run. The value is the name users see; `advice` says what to do next."""

    CONVERGED = "converged"
    STATIONARY = "stationary"
    REACHED_END = "reached-end"
    NECK_CLOSED = "neck-closed"
    SELF_CONTACT = "self-contact"
    SELF_INTERSECTING = "self-intersecting"
    MAX_ITERATIONS = "max-iterations"
    DIVERGED = "diverged"
    SINGULAR = "singular"
    NOT_FINITE = "not-finite"
    STEP_UNDERFLOW = "step-underflow"
    MAX_STEPS = "max-steps"
    REACHED_STOP = "reached-stop"
    TURNED_BACK = "turned-back"
    NOT_REACHED = "not-reached"
    NO_STATE = "no-state"
    BRANCH_STALLED = "branch-stalled"
    REPEATED = "repeated"
    NO_MORE_FOUND = "no-more-found"
    CLOSED = "closed"
    REJOINED = "rejoined"
    OUT_OF_RANGE = "out-of-range"
    UNFOLDED = "unfolded"
    INFERRED = "inferred"
    MAX_STARTS = "max-starts"
    COMPLETE = "complete"
    EIGENVALUES_UNCONVERGED = "eigenvalues-unconverged"
    NO_RATES = "no-rates"

    @property
    def is_success(self) -> bool:
        """True where the result is what was asked for, False where the solver gave up."""
        return self in _SUCCESS

    @property
    def advice(self) -> str:
        """One sentence: what happened and what to try."""
        return _ADVICE[self]


_SUCCESS = {
    Outcome.CONVERGED,
    Outcome.STATIONARY,
    Outcome.REACHED_END,
    Outcome.NECK_CLOSED,
    Outcome.SELF_CONTACT,
    Outcome.SELF_INTERSECTING,
    Outcome.REACHED_STOP,
    Outcome.TURNED_BACK,
    Outcome.NO_MORE_FOUND,
    Outcome.CLOSED,
    Outcome.REJOINED,
    Outcome.OUT_OF_RANGE,
    Outcome.MAX_STARTS,
    Outcome.COMPLETE,
}

_ADVICE = {
    Outcome.CONVERGED: "The equations hold to the tolerance.",
    Outcome.STATIONARY: "Shape, flow and concentrations no longer change.",
    Outcome.REACHED_END: "The end time was reached; raise `until` or resume to go on.",
    Outcome.NECK_CLOSED: "The neck became thinner than the closing radius: beyond it the surface would split.",
    Outcome.SELF_CONTACT: "The surface touches itself: shapes beyond would pass through themselves.",
    Outcome.SELF_INTERSECTING: "The surface passes through itself, as no real one can: choose another state or start.",
    Outcome.MAX_ITERATIONS: "Newton ran out of iterations: start from a nearer state or take a smaller step.",
    Outcome.DIVERGED: "Newton could not reduce the residual: start from a nearer state or take a smaller step.",
    Outcome.SINGULAR: (
        "The linear system is singular: this is a fold or a branch point, so start a little beside it; or, in a law of your own, "
        "an unknown is left free or a condition is repeated."
    ),
    Outcome.NOT_FINITE: "A NaN or infinity appeared: check the start and the parameters.",
    Outcome.STEP_UNDERFLOW: (
        "The time step fell below its minimum: raise `elements`, loosen `time_tolerance`, or check the parameters."
    ),
    Outcome.REACHED_STOP: "The branch came to a value where it was to end.",
    Outcome.TURNED_BACK: (
        "The branch did not come to --stop: it turned, or leads the other way, and ended at its bound there; --both goes on, or "
        "give another --stop or --side."
    ),
    Outcome.NOT_REACHED: (
        "Stepping stalled on the way to these parameters: there may be no such state, or a fold lies between; follow the branch."
    ),
    Outcome.INFERRED: (
        "Not computed: the points known around it are all of one kind, which it was given; map without --adaptive for its values."
    ),
    Outcome.NO_STATE: ("No state of this name was found at these parameters: choose others, or another --state."),
    Outcome.BRANCH_STALLED: (
        "The step along the branch fell below its minimum: the branch may end here; if not, refine the mesh or loosen tolerances."
    ),
    Outcome.REPEATED: "The state found, or its mirror image, was known before.",
    Outcome.NO_MORE_FOUND: (
        "None of the starts leads to a further state. That proves nothing of states that other starts may lead to: try more."
    ),
    Outcome.CLOSED: "It came back to its start: this is all of it.",
    Outcome.REJOINED: (
        "The branch came from one symmetric state to another: beyond lies the mirror image of what was passed."
    ),
    Outcome.OUT_OF_RANGE: "Beyond this point a key would have a value that it cannot take.",
    Outcome.UNFOLDED: "The branches part when this key changes, and cross at single values only: choose another key.",
    Outcome.MAX_STARTS: "The limit on starts was reached with others left: raise `--starts` and resume.",
    Outcome.MAX_STEPS: "The limit on steps was reached: resume to go on, a run with a larger `max_steps`.",
    Outcome.COMPLETE: "Every point of the grid was tried; those without a state say why.",
    Outcome.EIGENVALUES_UNCONVERGED: (
        "The leading growth rates did not converge or contradict each other: raise `elements`, or ask for fewer."
    ),
    Outcome.NO_RATES: (
        "Perturbations of this state, such as a flat disc, dissipate nothing to first order and have no finite growth rates: "
        "look at states beside it."
    ),
}
