"""What notebooks show: pages that say what a result says, pictures in them, movies that play and are saved."""

import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import shapespace as ss
from shapespace.base.errors import InputError
from shapespace.study.searching import search_states
from shapespace.view.notebook import Animation, outline_svg
from shapespace.view.show import film_of


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


def test_a_run_shows_how_it_ended_and_plays():
    run = ss.run(ss.scenario("polar-swimmer", until=1e-3, elements=20))
    text = shown(run)
    assert "reached-end" in text
    assert f"{run.observables['bending_energy']:.6g}" in text
    assert run._repr_html_().count("<path") == 2
    assert run.plot().axes
    with pytest.raises(InputError, match="observable"):
        run.plot("pressure")


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
    film = film_of(turned)
    np.testing.assert_array_equal(film["time"], [point.place for point in points])
    assert film["time"].attrs["words"] == "arclength"


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
