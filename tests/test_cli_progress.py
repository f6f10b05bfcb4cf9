"""How long work gets on, on stderr: plain lines for files and pipes, a bar on a terminal."""

import pytest

from shapespace.cli.progress import ProgressDisplay, Way


def show(display: ProgressDisplay) -> None:
    """Three points, of which the second is special."""
    way = Way(3.0)
    with display:
        display.start("starting")
        display.update("at 1", way.share(1.0))
        display.update("at 2, fold-1", way.share(2.0), is_notable=True)
        display.update("at 1.8", way.share(1.8))


def test_plain_lines_now_and_then_and_for_what_is_notable(capsys: pytest.CaptureFixture[str]):
    show(ProgressDisplay())
    assert capsys.readouterr().err.splitlines() == [
        "shapespace: starting",
        "shapespace: 0 %: at 1",
        "shapespace: 50 %: at 2, fold-1",
    ]


def test_a_bar_on_a_terminal(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    show(ProgressDisplay())
    text = capsys.readouterr().err
    assert "shapespace: at 2, fold-1\n" in text
    assert "40 %" in text


def test_without_a_range_there_is_no_share(capsys: pytest.CaptureFixture[str]):
    assert Way(None).share(1.0) is None
    display = ProgressDisplay(seconds_between_lines=0.0)
    with display:
        display.update("start 1 (reference): diverged", None)
    assert capsys.readouterr().err == "shapespace: start 1 (reference): diverged\n"
