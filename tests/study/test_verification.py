"""`verify`: rows judged by their tolerance, benchmarks that find nothing, the page, and a few of the benchmarks themselves."""

import json
import re

import pytest
from tests.shell import Shell

from shapespace.analysis.bifurcation import Kind
from shapespace.analysis.continuation import Arclength
from shapespace.study.verification import classic, continuation, table
from shapespace.study.verification.paths import begin, singular
from shapespace.study.verification.record import Benchmark, Row, Verification
from shapespace.study.verification.states import Absent
from shapespace.study.verification.table import BENCHMARKS, measured
from shapespace.view.verification import verification_html


def good() -> list[Row]:
    return [Row("a < b & c", 1.0 + 1e-9, 1.0, "closed form", 1e-8), Row("nothing", 1e-12, 0.0, "law", 1e-10)]


def bad() -> list[Row]:
    return [Row("off by two", 2.0, 4.0, "elsewhere", 1e-3)]


def absent() -> list[Row]:
    raise Absent("no state\nwas found.")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path) -> Shell:
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def test_rows_are_judged_by_their_error():
    """Relative to the reference, absolute where that is zero; a value that is not there never passes."""
    (wrong,) = bad()
    assert [row.passed for row in good()] == [True, True]
    assert (wrong.error, wrong.passed) == (0.5, False)
    (row,) = measured(Benchmark("lost", absent)).rows
    assert not row.passed
    assert row.note == "no state was found."


def test_the_page_is_whole_and_loads_nothing():
    results = tuple(measured(Benchmark(one.__name__, one)) for one in (good, bad, absent))
    page = verification_html(Verification(results, {"python": "3"}, "a machine", False))
    assert "2 of 4 benchmarks failed" in page
    assert "a &lt; b &amp; c" in page
    assert not re.search(r"(src|href)\s*=|url\(|<script", page)
    assert page.count("✗ failed") == 2


def test_the_command_reports_and_fails(shell: Shell, monkeypatch: pytest.MonkeyPatch, tmp_path):
    benchmarks = (Benchmark("fine", good), Benchmark("broken", bad, is_quick=False))
    monkeypatch.setattr(table, "BENCHMARKS", benchmarks)
    answer = shell("verify", "--quick", "--html", "page.html")
    assert answer.status == 0
    assert "all 2 benchmarks passed" in answer.out
    assert "fine" in (tmp_path / "page.html").read_text()
    answer = shell("verify", "--json")
    assert answer.status == 1
    record = json.loads(answer.out.splitlines()[-1], parse_constant=pytest.fail)
    assert (record["passed"], record["quick"]) == (False, False)
    assert [row["passed"] for result in record["results"] for row in result["rows"]] == [True, True, False]
    assert shell("verify", "--html", "no/page.html").status == 2


def test_every_benchmark_has_its_own_title_and_rows_of_their_own_names():
    titles = [benchmark.title for benchmark in BENCHMARKS]
    assert len({*titles}) == len(titles)
    names = [row.name for row in continuation.integral()]
    assert len({*names}) == len(names)


def test_a_branch_without_what_is_looked_for_says_so():
    problem = classic.chafee_infante(20)
    start = begin(problem, classic.at_rest(problem), [0.5])
    with pytest.raises(Absent, match="pitchfork was found in place of a fold"):
        singular(start, Kind.FOLD, 1)
    with pytest.raises(Absent, match="0 of 1 singular points found; the branch ended so: max-steps"):
        singular(start, Kind.FOLD, 1, Arclength(max_points=3))
    with pytest.raises(Absent, match="no state to start from"):
        begin(classic.bratu(), classic.at_rest(classic.bratu()), [30.0])


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda one: one.title)
def test_every_benchmark_passes(benchmark: Benchmark):
    rows = measured(benchmark).rows
    assert rows
    for row in rows:
        assert row.passed, f"{row.name}: {row.value} not {row.reference}, {row.note}"
