"""The page's files, which come with the package, and the same page as one file that works from disk."""

import base64
import gzip
import json
import re
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any
from urllib.parse import urlencode

KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
POLICY = (
    "default-src 'none'; script-src {script}; style-src {style}; img-src {image}; connect-src {connect}; base-uri 'none'; "
    "form-action 'none'"
)
_IMPORT = re.compile(r"""(\bfrom\s*|\bimport\s*\(?\s*)(["'])(\.[^"']+)\2""")


@cache
def files() -> dict[str, bytes]:
    """Every file of the page by its path below the page's own address."""
    root = resources.files("shapespace.app").joinpath("static")
    folders = {"": root, "vendor/": root.joinpath("vendor")}
    return {
        f"{prefix}{file.name}": file.read_bytes()
        for prefix, folder in folders.items()
        for file in folder.iterdir()
        if any(file.name.endswith(ending) for ending in KINDS)
    }


def kind_of(name: str) -> str:
    """Media type of a file by its ending."""
    return next(kind for ending, kind in KINDS.items() if name.endswith(ending)) + "; charset=utf-8"


def question(name: str, /, **asked: Any) -> str:
    """A question as the page asks it: what it is known by in a file."""
    return f"{name}?{urlencode(asked)}" if asked else name


def single_file(answers: Mapping[str, Any]) -> bytes:
    """The page with these answers, by question, in one HTML file that asks no other machine and no other file."""
    known = files()
    names = {name: f"@{name}" for name in known if name.endswith(".js")}
    modules = {names[name]: _as_address(_with_plain_imports(name, known[name].decode())) for name in names}
    data = gzip.compress(json.dumps(answers, allow_nan=False, separators=(",", ":")).encode(), mtime=0)
    policy = POLICY.format(script="'unsafe-inline' data:", style="'unsafe-inline'", image="data:", connect="'none'")
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f"<style>{known['page.css'].decode()}</style>\n"
        f'<script type="importmap">{json.dumps({"imports": modules})}</script>\n'
        f'<script type="application/octet-stream" id="answers">{base64.b64encode(data).decode()}</script>\n'
        '<script type="module">import "@main.js";</script>\n'
    )
    text = known["index.html"].decode()
    return re.sub(r"<!-- linked -->.*?<!-- /linked -->\n", lambda _: head, text, flags=re.DOTALL).encode()


def _with_plain_imports(name: str, text: str) -> str:
    """Imports by plain names, since a module in an address of its own has no files beside it."""
    folder = name.rpartition("/")[0]

    def plain(match: re.Match[str]) -> str:
        path = match[3].removeprefix("./")
        while path.startswith("../"):
            path = path.removeprefix("../")
            return f"{match[1]}{match[2]}@{path}{match[2]}"
        return f"{match[1]}{match[2]}@{folder + '/' if folder else ''}{path}{match[2]}"

    return _IMPORT.sub(plain, text)


def _as_address(text: str) -> str:
    return "data:text/javascript;base64," + base64.b64encode(text.encode()).decode()
