"""The explorer's server: this machine only, nothing without the token, no question that names a file.

Every address begins with the token. What else a request may be is checked before anything is looked up: the method, its
length, the host it was sent to (another name that leads here is no reason to answer) and the page it came from.
"""

import re
import secrets
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from shapespace.app.catalogue import Catalogue
from shapespace.app.encoding import as_json
from shapespace.app.page import POLICY, files, kind_of
from shapespace.base.errors import InputError

HOST = "127.0.0.1"
_HERE = re.compile(r"(127\.0\.0\.1|localhost)(:\d{1,5})?")
LONGEST = 1000
"""Characters of an address."""
LONGEST_HEAD = 16 * 1024
"""Characters of all headers."""
METHODS = ("GET", "HEAD")
_LOCAL = "http://localhost:* http://127.0.0.1:*"
HEADERS = {
    "Content-Security-Policy": POLICY.format(
        script="'self'", style="'self' 'unsafe-inline'", image="'self' data:", connect="'self'"
    )
    + f"; frame-ancestors 'self' {_LOCAL}",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-site",
    "Cache-Control": "no-store",
}

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]


class Guard:
    """Lets through what the explorer's own page asks, and refuses the rest."""

    def __init__(self, app: Any, token: str) -> None:
        self._app, self._token = app, token

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(scope) if scope["type"] == "http" else (400, "only http is spoken here.")
        if refusal is None:
            await self._app(scope, receive, send)
        elif scope["type"] == "http":
            await PlainTextResponse(f"shapespace: {refusal[1]}\n", refusal[0], HEADERS)(scope, receive, send)

    def _refusal(self, scope: Message) -> tuple[int, str] | None:
        """Status and reason, None where there is none."""
        request = Request(scope)
        if scope["method"] not in METHODS:
            return 405, "the explorer only reads."
        if len(scope["raw_path"]) + len(scope["query_string"]) > LONGEST:
            return 414, "the question is too long."
        if sum(len(name) + len(value) for name, value in scope["headers"]) > LONGEST_HEAD:
            return 431, "the headers are too long."
        host = request.headers.get("host", "")
        if not _HERE.fullmatch(host):
            return 421, "the explorer answers on this machine only."
        origin = request.headers.get("origin")
        if origin is not None and origin != f"http://{host}":
            return 403, "another page may not ask."
        token = scope["path"].split("/")[1]
        if not secrets.compare_digest(token.encode(), self._token.encode()):
            return 403, "open the address that `shapespace explore` printed: it ends in a token."
        return None


def make_app(catalogue: Catalogue, token: str) -> Guard:
    """The application that serves the stores of a catalogue to who knows the token."""

    async def file(request: Request) -> Response:
        name = request.path_params["name"] or "index.html"
        known = files()
        if name not in known:
            return PlainTextResponse("shapespace: there is no such file.\n", 404, HEADERS)
        return Response(known[name], headers=HEADERS | {"Content-Type": kind_of(name)})

    async def api(request: Request) -> Response:
        def answer() -> bytes:
            try:
                return as_json(catalogue.answer(request.path_params["name"], request.query_params))
            except InputError as error:
                # An answer too: a browser would report another status as a fault of the page.
                return as_json({"error": str(error)})

        content = await run_in_threadpool(answer)
        return Response(content, headers=HEADERS | {"Content-Type": "application/json"})

    routes = [
        Route("/{token}/api/{name}", api, methods=["GET"]),
        Route("/{token}/{name:path}", file, methods=["GET"]),
    ]
    return Guard(Starlette(routes=routes), token)


def open_socket(port: int) -> socket.socket:
    """A socket that listens on this machine only, on any free port for 0. InputError where it is taken."""
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((HOST, port))
        # From now on a browser may come; it is answered as soon as `serve` is called.
        made.listen()
    except (OSError, OverflowError) as error:
        made.close()
        raise InputError(
            f"--port {port}: cannot be listened on ({error}); choose another one, or leave it away."
        ) from None
    return made
