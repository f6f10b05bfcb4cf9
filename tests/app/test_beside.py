"""The explorer beside a notebook: served by its process, framed in its page, gone when it is stopped."""

import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import pytest
from tests.app.browser import PATIENCE, Browser
from tests.app.served import Stores

import shapespace as ss
from shapespace.base.errors import InputError


def test_one_line_serves_a_result_until_it_is_stopped(stores: Stores):
    beside = ss.explore(ss.open_branch(stores.branch), stores.run)
    with urlopen(beside.address + "api/stores") as answer:
        assert answer.status == 200
        assert answer.read().count(b'"noun"') == 2
    assert f'src="{beside.address}"' in beside._repr_html_()
    assert beside.address in repr(beside)
    beside.stop()
    with pytest.raises(URLError):
        urlopen(beside.address)


def test_what_is_not_stored_is_told(tmp_path: Path):
    with pytest.raises(InputError, match="in memory only"):
        ss.explore(ss.Run(ss.Outcome.STATIONARY, ss.scenario("vesicle"), None, {}, 0, 0.0))
    with pytest.raises(InputError, match="is not a directory"):
        ss.explore(tmp_path / "none")


def test_a_page_of_this_machine_frames_it(browser: Browser, stores: Stores, tmp_path: Path):
    """As a notebook does, whose server has a port of its own."""
    beside = ss.explore(stores.branch)
    (tmp_path / "notebook.html").write_text(f"<!doctype html><link rel=icon href=data:,>{beside._repr_html_()}")
    browser.errors.clear()
    browser.requests.clear()
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(SimpleHTTPRequestHandler, directory=tmp_path)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        page = f"http://127.0.0.1:{server.server_address[1]}/notebook.html"
        browser.open(page, "!!document.querySelector('iframe')")
        until = time.monotonic() + PATIENCE
        while not any("api/state" in one for one in browser.requests) and time.monotonic() < until:
            browser.run("new Promise((done) => setTimeout(done, 50))")
        server.shutdown()
    # Before its server ends, so that nothing is still being loaded.
    browser.send("Page.navigate", url="about:blank")
    browser.wait("location.href === 'about:blank'")
    beside.stop()
    assert not browser.errors
    assert any("api/state" in one for one in browser.requests)
