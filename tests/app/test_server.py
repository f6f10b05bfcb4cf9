"""What the explorer's server refuses, and what it says about stores that cannot be read."""

import http.client
import json
import shutil
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from tests.app.served import Stores

from shapespace.app.explore import Explorer
from shapespace.base.errors import InputError


def request(
    explorer: Explorer, path: str, *, method: str = "GET", token: str | None = None, **headers: str
) -> tuple[int, str, dict[str, str]]:
    """Status, text and headers of an answer; a path is taken as it is, dots and all."""
    parts = urlsplit(explorer.address)
    connection = http.client.HTTPConnection(parts.netloc, timeout=30)
    token = parts.path.strip("/") if token is None else token
    connection.putrequest(method, f"/{token}/{path}" if token else f"/{path}", skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text, dict(answer.getheaders())


def ask(explorer: Explorer, question: str) -> tuple[int, Any]:
    """Status and content of an answer to a question."""
    status, text, headers = request(explorer, f"api/{question}")
    assert headers["content-type"] == "application/json"
    return status, json.loads(text)


def test_page_comes_with_a_policy_that_keeps_it_here(explorer: Explorer):
    status, text, headers = request(explorer, "")
    assert status == 200
    assert "<title>shapespace</title>" in text
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "script-src 'self';" in policy
    assert "connect-src 'self'" in policy
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["x-content-type-options"] == "nosniff"
    assert "access-control-allow-origin" not in headers


@pytest.mark.parametrize("path", ["", "main.js", "api/stores", "api/state?store=0&place=0"])
@pytest.mark.parametrize("token", ["", "wrong", "%00", "x" * 200])
def test_nothing_comes_without_the_token(explorer: Explorer, path: str, token: str):
    status, text, _ = request(explorer, path, token=token)
    assert status == 403
    assert "token" in text
    assert urlsplit(explorer.address).path.strip("/") not in text


@pytest.mark.parametrize(
    "path",
    [
        "../../etc/passwd",
        "..%2f..%2fetc%2fpasswd",
        "%2e%2e/%2e%2e/etc/passwd",
        "vendor/../../explore.py",
        "/etc/passwd",
        "..\\explore.py",
        "vendor/%2e%2e/%2e%2e/server.py",
        "vendor",
        "index.html%00.js",
    ],
)
def test_no_file_but_the_page_s_own_is_readable(explorer: Explorer, path: str):
    status, text, _ = request(explorer, path)
    assert status == 404
    assert "root:" not in text


@pytest.mark.parametrize(
    "question",
    [
        "state?store=../../etc&place=0",
        "state?store=-1&place=0",
        "state?store=99&place=0",
        "state?store=0&place=../../store.json",
        "state?store=0&place=999999999999999999999",
        "state?store=0&place=-1",
        "state?store=0&place=%C2%B2",
        "state?store=0",
        "state?store=2&place=0,1",
        "state?store=2&place=0,100,0",
        "state?store=2&place=1,0,0",
        "values?store=2&name=../run/store.json",
        "values?store=2&name=peclet",
        "values?store=0&name=velocity",
        "mode?store=1&place=0&index=99",
        "mode?store=1&place=0&index=x",
        "shape?store=1&place=0",
        "nothing",
        "..%2fstores",
    ],
)
def test_a_question_about_what_is_not_there_is_answered_in_a_line(explorer: Explorer, question: str):
    status, text, _ = request(explorer, f"api/{question}")
    assert status in (200, 404), text
    if status == 200:
        (words,) = json.loads(text).items()
        assert words[0] == "error"
        assert words[1].count("\n") == 0
        assert "Traceback" not in text


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "[::1", ""])
def test_other_names_for_this_machine_are_refused(explorer: Explorer, host: str):
    status, text, _ = request(explorer, "api/stores", Host=host)
    assert status in (400, 421)
    assert "stores" not in text


def test_localhost_is_this_machine(explorer: Explorer):
    port = urlsplit(explorer.address).port
    assert request(explorer, "api/stores", Host=f"localhost:{port}")[0] == 200


@pytest.mark.parametrize(
    "origin", ["https://evil.example", "null", "http://localhost:1", "http://127.0.0.1", "file://"]
)
def test_pages_of_others_may_not_ask(explorer: Explorer, origin: str):
    assert request(explorer, "api/stores", Origin=origin)[0] == 403


def test_its_own_page_may_ask(explorer: Explorer):
    parts = urlsplit(explorer.address)
    assert request(explorer, "api/stores", Origin=f"{parts.scheme}://{parts.netloc}")[0] == 200


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"])
def test_only_reading_is_done(explorer: Explorer, method: str):
    assert request(explorer, "api/stores", method=method, Content_Length="0")[0] == 405


def test_huge_questions_are_refused(explorer: Explorer):
    assert request(explorer, "api/state?store=0&place=" + "0" * 5000)[0] == 414
    assert request(explorer, "api/stores", X_Long="x" * 100_000)[0] in (400, 431)


def test_it_listens_on_this_machine_only(explorer: Explorer):
    port = urlsplit(explorer.address).port
    assert explorer.address.startswith("http://127.0.0.1:")
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1"}
    for address in others:
        if not address.startswith("127."):
            with socket.socket() as one:
                one.settimeout(2)
                assert one.connect_ex((address, port)) != 0


def test_a_taken_port_is_told(explorer: Explorer, stores: Stores):
    with pytest.raises(InputError, match="--port"):
        Explorer([stores.run], port=int(urlsplit(explorer.address).port or 0))
    with pytest.raises(InputError, match="--port"):
        Explorer([stores.run], port=70000)


def test_tokens_are_not_the_same(stores: Stores):
    tokens = set()
    for _ in range(3):
        explorer = Explorer([stores.run])
        tokens.add(urlsplit(explorer.address).path)
        explorer.close()
    assert len(tokens) == 3
    assert all(len(token) > 30 for token in tokens)


def test_damaged_stores_are_named_and_leave_the_others_alone(
    serve: Callable[..., Explorer], stores: Stores, tmp_path: Path
):
    cut, empty, foreign, half, torn = (tmp_path / name for name in ("cut", "empty", "foreign", "half", "torn"))
    for copy in (cut, half):
        shutil.copytree(stores.branch, copy)
    (cut / "store.json").write_bytes((cut / "store.json").read_bytes()[:200])
    frame = sorted((half / "points").iterdir())[3]
    frame.write_bytes(frame.read_bytes()[:1000])
    empty.mkdir()
    foreign.mkdir()
    (foreign / "store.json").write_text('{"format": "shapespace-dream", "format_version": 2}')
    shutil.copytree(stores.map, torn)
    (torn / "zarr.json").unlink()
    explorer = serve(stores.run, cut, empty, foreign, half, torn)
    status, answer = ask(explorer, "stores")
    assert status == 200
    assert ["error" in one for one in answer["stores"]] == [False, True, True, True, False, False]
    for number, word in ((1, "damaged"), (2, "missing"), (3, "dream"), (5, "zarr.json")):
        assert word in ask(explorer, f"overview?store={number}")[1]["error"]
    for number in (1, 2):
        # Of any kind, as it cannot be told.
        assert (
            "of a run, a branch, a curve, a search or a diagram"
            in ask(explorer, f"overview?store={number}")[1]["error"]
        )
    overview = ask(explorer, "overview?store=4")[1]
    assert [frame.name in one for one in overview["damage"]] == [True]
    assert len(overview["table"]["places"]) == len([*(half / "points").iterdir()]) - 1
    assert ask(explorer, "overview?store=0")[1]["damage"] == []
    assert "error" not in ask(explorer, "state?store=4&place=2")[1]
    assert frame.name in ask(explorer, "state?store=4&place=3")[1]["error"]


def test_a_store_that_is_being_written_shows_what_there_is(
    serve: Callable[..., Explorer], stores: Stores, tmp_path: Path
):
    growing = tmp_path / "growing"
    shutil.copytree(stores.run, growing)
    about = json.loads((growing / "store.json").read_text())
    (growing / "store.json").write_text(json.dumps(about | {"status": "running", "outcome": None, "frames": None}))
    frames = sorted((growing / "frames").iterdir())
    last = frames[-1].read_bytes()
    frames[-1].unlink()
    frames[-1].with_suffix(".tmp").write_bytes(last[:100])
    explorer = serve(growing)
    _, overview = ask(explorer, "overview?store=0")
    assert overview["outcome"] is None
    assert len(overview["table"]["places"]) == len(frames) - 1
    frames[-1].write_bytes(last)
    assert len(ask(explorer, "overview?store=0")[1]["table"]["places"]) == len(frames)
