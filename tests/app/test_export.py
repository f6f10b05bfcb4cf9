"""One file to send, and the command that writes it or serves."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from urllib.request import urlopen

import pytest
from tests.app.browser import Browser
from tests.app.pages import click_in_map, has, has_shape, pixels, shown, text, title
from tests.app.served import MoreStores, Stores
from tests.shell import Shell

from shapespace.app.explore import export
from shapespace.study.branch_store import open_branch
from shapespace.study.diagram_store import open_diagram
from shapespace.study.store import RunStore

NOWHERE, SOMEWHERE = "1,0,3", "1,5,0"


def test_an_exported_branch_and_run_work_from_disk(browser: Browser, stores: Stores, tmp_path: Path):
    file = export([stores.branch, stores.run], tmp_path / "explored.html")
    branch = open_branch(stores.branch)
    browser.open(file.as_uri())
    browser.settle()
    assert title(browser) == "pitchfork-1"
    assert shown(browser) == {**branch["pitchfork-1"].observables, "peclet": branch["pitchfork-1"].parameter}
    assert has_shape(browser)
    browser.press("1")
    assert browser.wait("!!document.querySelector('#outline .moved')")
    browser.press("s")
    browser.settle()
    last = RunStore.open(stores.run).read(-1)
    assert shown(browser) == {**last.observables, "time": last.time}
    assert {one for one in browser.requests if not one.startswith(("data:", "about:"))} == {file.as_uri()}


def test_an_exported_map_works_from_disk(browser: Browser, more: MoreStores, tmp_path: Path):
    """With all shapes where there are so few, colours and boundaries; a point without a state says why."""
    told: list[tuple[int, int]] = []
    file = export([more.states], tmp_path / "map.html", lambda done, total: told.append((done, total)))
    assert told[-1] == (48, 48)
    data = open_diagram(more.states).dataset.isel(state=1)
    browser.open(f"{file.as_uri()}#state=1&place={SOMEWHERE}")
    browser.settle()
    assert has_shape(browser)
    assert shown(browser)["velocity"] == float(data["velocity"].isel(peclet=5, turnover_rate=0))
    assert has(browser, "#diagram .boundary.fold")
    browser.choose("#choose-of", "polarity")
    browser.settle()
    assert text(browser, "#legend").startswith("polarity")
    click_in_map(browser, 0.05, 0.95)
    assert "not reached" in text(browser, "#facts")
    assert shown(browser).keys() == {"peclet", "turnover_rate"}
    assert not has_shape(browser)
    assert pixels(browser) == 0
    assert browser.run("document.getElementById('trouble').hidden")
    assert {one for one in browser.requests if not one.startswith(("data:", "about:"))} == {file.as_uri()}


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Shell:
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def test_the_command_writes_one_file(shell: Shell, stores: Stores, tmp_path: Path):
    answer = shell("explore", str(stores.branch), "--export", "branch.html")
    assert answer.status == 0, answer
    assert answer.out.strip() == "branch.html"
    assert (tmp_path / "branch.html").read_text().startswith("<!doctype html>")
    answer = shell("explore", str(stores.branch), "--export", "branch.txt")
    assert answer.status != 0
    assert "end it in .html" in answer.err


def test_the_command_serves_on_the_port_that_it_is_given(stores: Stores):
    """Until it is interrupted, which is no failure."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "shapespace", "explore", str(stores.branch), "--port", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ) as server:
        assert server.stdout is not None
        try:
            address = server.stdout.readline().strip()
            assert address.startswith(f"http://127.0.0.1:{port}/")
            with urlopen(address + "api/stores") as answer:
                assert b'"branch"' in answer.read()
        finally:
            server.send_signal(signal.SIGINT)
        assert server.wait(20) in (0, 130)


def test_a_port_that_is_none_is_told(shell: Shell, stores: Stores):
    answer = shell("explore", str(stores.branch), "--port", "70000")
    assert answer.status != 0
    assert "--port 70000" in answer.err
