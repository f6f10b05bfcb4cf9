"""What a verification says: one row for each number that was computed and is known."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Row:
    """A computed value beside its reference. tolerance: of `error`. note: why there is no value, where there is none."""

    name: str
    value: float
    reference: float
    source: str
    tolerance: float
    note: str = ""

    @property
    def error(self) -> float:
        """|value - reference|, relative to the reference where that is not zero."""
        return abs(self.value - self.reference) / (abs(self.reference) or 1.0)

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance; never without a value."""
        return self.error <= self.tolerance


@dataclass(frozen=True)
class Benchmark:
    """A computation by the public path and the rows that it gives. is_quick: also part of `verify --quick`."""

    title: str
    compute: Callable[[], Iterable[Row]]
    is_quick: bool = True


@dataclass(frozen=True)
class Result:
    """The rows of one benchmark and the seconds that they took."""

    title: str
    rows: tuple[Row, ...]
    seconds: float


@dataclass(frozen=True)
class Verification:
    """All results, with the versions and the machine that gave them."""

    results: tuple[Result, ...]
    versions: dict[str, str]
    machine: str
    is_quick: bool

    @property
    def rows(self) -> tuple[Row, ...]:
        """Of all benchmarks."""
        return tuple(row for result in self.results for row in result.rows)

    @property
    def passed(self) -> bool:
        """Whether every row is within its tolerance."""
        return all(row.passed for row in self.rows)

    @property
    def verdict(self) -> str:
        """One line: how many passed, and in what time."""
        count, failed = len(self.rows), sum(not row.passed for row in self.rows)
        seconds = sum(result.seconds for result in self.results)
        said = f"{failed} of {count} benchmarks failed" if failed else f"all {count} benchmarks passed"
        return f"{said} in {seconds:.0f} s"

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON; what is not a number is null."""
        return {
            "passed": self.passed,
            "quick": self.is_quick,
            "versions": self.versions,
            "machine": self.machine,
            "results": [
                {"title": result.title, "seconds": result.seconds, "rows": [_plain(row) for row in result.rows]}
                for result in self.results
            ],
        }


def _plain(row: Row) -> dict[str, Any]:
    numbers = {name: getattr(row, name) for name in ("value", "reference", "error", "tolerance")}
    finite = {name: number if math.isfinite(number) else None for name, number in numbers.items()}
    return {"name": row.name, **finite, "source": row.source, "passed": row.passed, "note": row.note}
