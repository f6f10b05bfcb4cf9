"""One stored state of a branch: all that is needed to look at it, to go on from it and to leave it another way."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shapespace.study.frame import Array, Frame, Layout

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """A point of a branch in one key of its scenario.

    frame: the state, at time zero, with its observables. parameter: the key's value, with the estimated error of a located
    one. arclength: from the start, in the branch's own metric; step: the next one to try; test: function of branch points.
    leg: 0 on the way to the stop, 1 on the way back. tangent (n + 1,); directions (2, n + 1): of both branches through a
    branch point, else (0, n + 1). growth_rates (m, 2): real and imaginary parts, leading first, in the scenario's units, with
    errors (m,), parities and names of neutral ones by place; modes (m, n), of labelled points only. n_unstable: None where
    unknown. label, kind: of special points, else empty. is_step: one of the continuation's own points, not one located
    between them. ends: outcome with which the leg ends here, else empty. missed: brackets before this point in which nothing
    was found. spectrum: how the search for growth rates ended, empty where there was none. began: of the first point, the name
    of the state, or the store, that it comes from. freed: value of the key that answers where an observable is the parameter.
    """

    frame: Frame
    parameter: float
    arclength: float
    step: float
    test: float
    tangent: Array
    growth_rates: Array
    growth_rate_errors: Array
    next_shift: float
    parameter_error: float = 0.0
    directions: Array = field(default_factory=lambda: np.zeros((0, 0)))
    modes: ComplexArray = field(default_factory=lambda: np.zeros((0, 0), np.complex128))
    parities: tuple[str | None, ...] = ()
    neutral: dict[int, str] = field(default_factory=dict)
    n_unstable: int | None = None
    n_unstable_before: int | None = None
    n_unstable_after: int | None = None
    leg: int = 0
    label: str = ""
    kind: str = ""
    is_step: bool = True
    ends: str = ""
    missed: tuple[dict[str, Any], ...] = ()
    began: str = ""
    spectrum: str = ""
    freed: float | None = None

    @property
    def observables(self) -> dict[str, float]:
        """In the scenario's units."""
        return self.frame.observables

    @property
    def value(self) -> float:
        """Of the scenario's key that changes along the branch."""
        return self.parameter if self.freed is None else self.freed

    @property
    def place(self) -> float:
        """Arclength, negative on the leg that goes back."""
        return -self.arclength if self.leg else self.arclength


_LAYOUT = Layout(
    block="branch",
    numbers=("parameter", "parameter_error", "arclength", "step", "test", "next_shift"),
    arrays=("tangent", "directions", "growth_rates", "growth_rate_errors", "modes"),
    words=(
        "parities", "neutral", "n_unstable", "n_unstable_before", "n_unstable_after", "leg", "label", "kind", "is_step", "ends",
        "missed", "began", "freed", "spectrum",
    ),
)  # fmt: skip


def encode_point(point: BranchPoint) -> bytes:
    """The bytes of a point's file: the arrays of a frame, and those of the branch."""
    return _LAYOUT.encode(point)


def decode_point(data: bytes) -> BranchPoint:
    """The point in the bytes of a file; one of DAMAGE where the bytes are not what was written."""
    values = _LAYOUT.decode(data)
    values |= {name: tuple(values[name]) for name in ("parities", "missed")}
    values["neutral"] = {int(place): name for place, name in values["neutral"].items()}
    return BranchPoint(**values)
