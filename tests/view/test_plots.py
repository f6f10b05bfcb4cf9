"""`plot` and `movie` of every kind of store, by Python and by the command: what is drawn, where it goes, and what is refused."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from tests.app.stores import make_map
from tests.pages import PRINTED, assert_apart, assert_legends_clear, assert_on_page
from tests.shell import Shell, one_complaint

import shapespace as ss
from shapespace.study.regimes import Regime
from shapespace.view.movie import find_ffmpeg
from shapespace.view.show import film_of, movie, plot
from shapespace.view.states import plot_states

pytestmark = pytest.mark.usefixtures("pages_checked")


@pytest.fixture(scope="module")
def stores(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One small store of each kind."""
    folder = tmp_path_factory.mktemp("stores")
    case = ss.scenario("polar-swimmer", elements=20, peclet=24)
    ss.run(case.with_overrides({"until": 2e-3}), out=folder / "run")
    ss.branch(case, "peclet", 23.0, start=21.0, state="trivial", out=folder / "branch")
    ss.search_states(case, max_tries=3, out=folder / "search")
    ss.curve(f"{folder / 'branch'}:pitchfork-1", "saturation_concentration", 1.02, start=1.0, out=folder / "curve")
    make_map(folder / "map", 4)
    return folder


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, stores: Path) -> Shell:
    monkeypatch.chdir(stores)
    return Shell(capsys)


def words(figure: Figure) -> set[str]:
    return {text.get_text() for text in figure.findobj(Text)}


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("run", {}, "time $t$ ($\\tau$)"),
        ("run", {"budget": True}, "energy $F$ ($\\kappa$)"),
        ("run:1", {}, "concentration $c$ ($c_{0}$)"),
        ("branch", {}, "Péclet number $\\mathrm{Pe}$"),
        ("branch", {"observable": "pressure"}, "pitchfork-1"),
        ("branch:pitchfork-1", {}, "branch:pitchfork-1, $\\mathrm{Pe}$ = 22"),
        ("branch:pitchfork-1", {"mode": 0}, "mesh coordinate $u$"),
        ("search", {}, "velocity ($R_{0}/\\tau$)"),
        ("search:state-1", {}, "search:state-1"),
        ("curve", {}, "pitchforks"),
        ("curve:end-1", {}, "curvature ($1/R_{0}$)"),
        ("map", {}, "velocity $v_{0}$ ($R_{0}/\\tau$)"),
        ("map", {"observable": "pressure"}, "pressure $p$ ($\\kappa/R_{0}^{3}$)"),
        ("map", {"observable": "regime"}, "swimming"),
        ("map:trivial-0", {}, "curvature ($1/R_{0}$)"),
    ],
)
def test_whatever_is_stored_is_drawn(stores: Path, name: str, options: dict, said: str):
    figure = plot(str(stores / name), **options)
    assert said in words(figure)
    assert_on_page(figure)
    assert_on_page(figure, figure.dpi)
    assert_apart(figure)
    assert_legends_clear(figure)


def test_the_command_says_where_the_picture_is(shell: Shell):
    for words, picture in (
        (("run",), "run/figure.png"),
        (("run", "--budget"), "run/budget.png"),
        (("branch:pitchfork-1",), "branch/pitchfork-1.png"),
        (("branch:pitchfork-1", "--mode", "0"), "branch/pitchfork-1-mode-0.png"),
        (("search",), "search/figure.png"),
        (("search:state-1",), "search/state-1.png"),
    ):
        assert shell("plot", *words) == (0, f"{picture}\n", "")
        assert Path(picture).stat().st_size > 5_000
    for words, complaint in (
        (("branch:fork-1",), "fork-1: is no label"),
        (("search:state-7",), "state-7: is no state of this search"),
        (("search", "--of", "height"), "is for the figure of a branch or a diagram"),
        (("branch", "--budget"), "budget: is for the figure of a run"),
        (("branch:pitchfork-1", "--budget"), "budget: is for the figure of a run"),
        (("branch", "--mode", "0", "--of", "height"), "mode 0: is drawn from a stored state"),
        (("nothing",), "nothing: is not a directory"),
    ):
        told = one_complaint(shell("plot", *words))
        assert complaint in told
        assert "how-to/draw-figures.md" in told


def test_a_stored_state_is_drawn_and_is_no_run(shell: Shell, tmp_path: Path):
    state = str(tmp_path / "state")
    arguments = ("polar-swimmer", "-s", "elements=20", "peclet=30", "--out", state)
    assert shell("steady", *arguments).status == 0
    assert shell("plot", state) == (0, f"{state}/figure.png\n", "")
    assert "1 frame(s); its picture needs 2" in one_complaint(shell("movie", state))
    run = ss.open_run(state)
    assert (run.outcome, run.steps) == ("converged", 0)
    assert run.plot().get_suptitle() == "" or run.plot().axes


@pytest.mark.parametrize("is_of_all", [False, True])
def test_counts_of_states_are_drawn_in_steps(stores: Path, is_of_all: bool):
    """Also where there is one map of all states, without a state for each."""
    diagram = ss.open_diagram(stores / "map")
    data = diagram.dataset.assign(n_states=(diagram.request.grid.keys[::-1], np.arange(16).reshape(4, 4) % 3))
    if is_of_all:
        data["outcome"] = data["outcome"].expand_dims(state=["state-1", "state-2"])
    diagram.__dict__["dataset"] = data
    figure = diagram.plot("n_states")
    assert len(figure.axes) == 2
    assert [label.get_text() for label in figure.axes[-1].get_yticklabels()] == ["0", "1", "2"]
    assert figure.axes[-1].get_ylabel() == "states"
    assert_on_page(figure)


def test_boundaries_show_on_any_map_and_are_explained(stores: Path):
    """A white rim around the line, and an entry in the legend, also beside points without a state."""
    diagram = ss.open_diagram(stores / "map")
    curve = ss.open_curve(stores / "curve")
    object.__setattr__(curve, "keys", diagram.request.grid.keys)
    diagram.__dict__["boundaries"] = (curve, curve)
    for observable in ("velocity", "pressure", "regime"):
        figure = diagram.plot(observable)
        (legend,) = figure.legends
        assert [text.get_text() for text in legend.get_texts()].count("pitchforks") == 1
        assert all(line.get_path_effects() for line in figure.axes[0].get_lines())
        assert_on_page(figure)


def test_a_branch_movie_can_be_written(stores: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Its frames, their size, and what it says."""
    monkeypatch.setattr("shapespace.view.show.save_movie", shortened)
    path = movie(stores / "branch", tmp_path / "branch.mp4")
    command = [find_ffmpeg(), "-i", path, "-f", "null", "-"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    assert "1024x576" in told
    assert [*map(int, re.findall(r"frame=\s*(\d+)", told))][-1] == 5


def shortened(data: object, path: Path, progress: object = None) -> Path:
    from shapespace.view.movie import save_movie

    return save_movie(data, path, progress, seconds=0.5, fps=10)


@pytest.mark.parametrize("name", ["curve", "map", "search", "nothing"])
def test_what_has_no_course_has_no_movie(shell: Shell, name: str):
    told = one_complaint(shell("movie", name))
    assert "give a directory that `shapespace run` or `shapespace branch` made" in told
    assert "how-to/make-movies.md" in told


def test_states_keep_one_scale(stores: Path):
    """Of a search all surfaces at one scale, each with its own title."""
    found = ss.open_search(stores / "search")
    figure = found.plot()
    titles = [part.get_suptitle() for part in figure.subfigs]
    assert titles == [
        f"{one.label}: {'stable' if one.n_unstable == 0 else f'{one.n_unstable} growing'}" for one in found.states
    ]
    surfaces = [part.axes[0] for part in figure.subfigs]
    assert len({axes.get_xlim() for axes in surfaces}) == 1
    with pytest.raises(ss.InputError, match="lacks"):
        plot_states(film_of(stores / "branch").drop_vars("radius"), ["one"])


def test_a_picture_of_the_command_is_fine_enough(shell: Shell, tmp_path: Path):
    from PIL import Image

    shell("plot", "branch", "--out", tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert image.width == pytest.approx(0.75 * 180.0 / 25.4 * PRINTED, abs=2)
    assert Regime.SWIMMING.words == "swimming"
