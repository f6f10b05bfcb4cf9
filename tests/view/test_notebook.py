"""What notebooks show: pages that say what a result says, pictures in them, movies that play and are saved."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from tests.app.stores import make_map

import shapespace as ss
from shapespace.base.errors import InputError
from shapespace.study.searching import search_states
from shapespace.view.movie import Scene
from shapespace.view.notebook import Animation, outline_svg
from shapespace.view.show import film_of
from shapespace.view.typeset import html_of, symbol_tex, units_tex


class Balanced(HTMLParser):
    """Reads a page; `open` holds the elements that were not closed, `text` what is shown."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        if tag not in ("img", "path"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert tag == "path" or self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def shown(thing: object) -> str:
    page = thing._repr_html_()
    read = Balanced(page)
    assert read.open == []
    assert "http" not in page.replace("http://www.w3.org", "")
    return " ".join(read.text)


@pytest.fixture(scope="module")
def stores(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stores")
    ss.branch(
        ss.scenario("polar-swimmer", elements=20), "peclet", 23.0, start=21.0, state="trivial", out=folder / "branch"
    )
    return folder


def test_a_scenario_shows_its_keys():
    text = shown(ss.scenario("guided-division", peclet=300))
    assert "Scenario guided-division" in text
    assert "peclet Pe 300" in text
    assert "until" in text


def test_symbols_and_units_are_typeset_as_in_figures():
    page = ss.scenario("guided-division")._repr_html_()
    assert "(<i>ξ</i><i>Δ</i><i>μ</i>)<sub>0</sub>" in page
    assert "<i>κ</i>\N{THIN SPACE}<i>τ</i>/<i>R</i><sub>0</sub><sup>2</sup>" in page
    assert not re.search(r"kappa|tau\b|Delta_|\^2|\\", page)
    assert html_of(symbol_tex("C_phi^phi")) == "<i>C</i><sub><i>φ</i></sub><sup><i>φ</i></sup>"
    assert html_of(symbol_tex("max c")) == "max\N{THIN SPACE}<i>c</i>"
    assert html_of(units_tex("pN nm/um^2")) == "pN\N{THIN SPACE}nm/μm<sup>2</sup>"
    assert html_of(r"\frac{a}{<b>}") == r"\frac{a}{&lt;b&gt;}"


def test_a_run_shows_how_it_ended_and_plays():
    run = ss.run(ss.scenario("polar-swimmer", until=1e-3, elements=20))
    text = shown(run)
    assert "reached-end" in text
    assert f"{run.observables['bending_energy']:.6g}" in text
    assert run._repr_html_().count("<path") == 2
    assert run.plot().axes
    with pytest.raises(InputError, match="observable"):
        run.plot("pressure")
    movie = run.animate(seconds=0.2)
    assert movie.data[4:8] == b"ftyp"
    assert "<video" in movie._repr_html_()


def test_a_stored_run_is_itself_again(tmp_path: Path):
    """Its page, its figure and its movie; also of a run that is not finished."""
    run = ss.run(ss.scenario("polar-swimmer", until=1e-3, elements=20), out=tmp_path / "run")
    again = ss.open_run(tmp_path / "run")
    assert (again.outcome, again.steps, again.observables) == (run.outcome, run.steps, run.observables)
    assert again.scenario == run.scenario
    assert "reached-end" in shown(again)
    assert again.plot().axes
    assert again.animate(seconds=0.2).ending == ".mp4"
    manifest = json.loads((tmp_path / "run" / "store.json").read_text())
    (tmp_path / "run" / "store.json").write_text(json.dumps(manifest | {"status": "running", "outcome": None}))
    assert ss.open_run(tmp_path / "run").outcome is None
    assert "unfinished" in shown(ss.open_run(tmp_path / "run"))
    with pytest.raises(ss.StoreError, match="made"):
        ss.open_run(tmp_path)


def test_curves_and_maps_show_their_figures(stores: Path):
    key = "saturation_concentration"
    curve = ss.curve(f"{stores / 'branch'}:pitchfork-1", key, 1.02, start=1.0, out=stores / "curve")
    text = shown(curve)
    assert f"pitchfork in the plane of peclet and {key}" in text
    assert "end-1" in text
    make_map(stores / "map", 3)
    text = shown(ss.open_diagram(stores / "map"))
    assert "9, 9 with a state" in text
    for thing in (curve, ss.open_diagram(stores / "map")):
        assert 'src="data:image/png;base64,' in thing._repr_html_()
        assert thing.plot().axes


def test_a_branch_shows_its_diagram_and_special_points(stores: Path):
    branch = ss.open_branch(stores / "branch")
    text = shown(branch)
    assert "pitchfork-1 22" in text
    assert "0, 1" in text
    assert 'src="data:image/png;base64,' in branch._repr_html_()
    assert branch.plot("pressure").axes[0].get_ylabel().startswith("pressure")


def test_a_film_of_a_branch_goes_along_its_key_or_along_its_arc(stores: Path):
    branch = ss.open_branch(stores / "branch")
    film = film_of(stores / "branch")
    values = {point.parameter: point.observables["pressure"] for point in branch.points}
    np.testing.assert_array_equal(film["time"], sorted(values))
    np.testing.assert_array_equal(film["pressure"], [values[one] for one in sorted(values)])
    assert film["time"].attrs["words"] == "peclet"
    # The middle one is where the branch turns.
    points = branch.points[:3]
    turned = replace(
        branch, points=tuple(replace(one, parameter=at) for one, at in zip(points, (1.0, 2.0, 1.5), strict=True))
    )
    turning = film_of(turned)
    np.testing.assert_array_equal(turning["time"], [point.place for point in points])
    assert turning["time"].attrs["words"] == "arclength"
    # Both are shown: how far along the branch, and at which value of the key.
    for data, symbols in ((film, ["$\\mathrm{Pe}$ = "]), (turning, ["$s$ = ", "$\\mathrm{Pe}$ = "])):
        scene = Scene(data, 3, 64)
        assert [clock.symbol for clock in scene._clocks[: len(symbols)]] == symbols
    for frame, key in ((0, 1.0), (2, 1.5)):
        scene.show(frame)
        assert float(scene._clocks[1]._digits.get_text()) == key


def test_a_search_shows_its_states():
    found = search_states(ss.scenario("polar-swimmer", elements=20, peclet=24), max_tries=3)
    text = shown(found)
    assert f"{len(found.states)} new state" in text
    for state in found.states:
        assert f"{state.label} " in text
        assert f"{state.growth_rates[0][0]:.6g}" in text


def test_states_and_failures_show_what_they_are():
    assert "converged" in shown(ss.steady(ss.scenario("polar-swimmer", elements=20), state="trivial"))
    assert "no-state" in shown(ss.steady(ss.scenario("polar-swimmer", peclet=15, elements=20)))


def test_a_movie_is_saved_with_its_own_ending(tmp_path: Path):
    movie = Animation(b"GIF89a", ".gif")
    assert movie.save(tmp_path / "a.gif").read_bytes() == b"GIF89a"
    with pytest.raises(InputError, match=r"\.gif"):
        movie.save(tmp_path / "a.mp4")
    assert "data:image/gif" in movie._repr_html_()
    assert "<video" in Animation(b"", ".mp4")._repr_html_()


def test_an_outline_keeps_proportions():
    u = np.linspace(0.0, np.pi, 50)
    picture = outline_svg(np.sin(u), 2.0 * np.cos(u))
    assert 'width="88" height="168"' in picture


def test_names_load_no_picture_library():
    """The front door supplies the presenter without waiting for what it draws with."""
    code = "import sys, shapespace as ss; ss.scenario('vesicle')._repr_html_(); assert 'matplotlib' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
