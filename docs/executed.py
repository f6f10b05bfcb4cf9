"""Runs what a page shows: its Python blocks as one session, its shell lines as commands, in the order of the page.

`python docs/executed.py PAGE FOLDER` works in FOLDER, which it makes anew. Comments in the page that no reader sees steer it:

<!-- not run: WHY -->    before a block: it is only shown
<!-- file: NAME -->       before a block: it is also saved as NAME
<!-- run first            commands that make what the page takes for given, a line each, up to -->
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
_FENCE = re.compile(
    r"(?:^<!-- (not run|file): ([^\n]*?) -->\n)?^```(python|sh)\n(.*?)^```|^<!-- run first\n(.*?)^-->",
    re.MULTILINE | re.DOTALL,
)
_SERVER_SECONDS = 120.0


class Block(NamedTuple):
    """A block of a page. note: what a comment before it says, `not run` or `file`, and of what."""

    language: str
    text: str
    note: str
    of: str


def blocks_of(page: Path) -> Iterator[Block]:
    """The Python and shell blocks of a page."""
    for note, of, language, text, hidden in _FENCE.findall(page.read_text(encoding="utf-8")):
        yield Block(language or "sh", text or hidden, note, of)


def lines_of(block: Block) -> Iterator[list[str]]:
    """The commands of a shell block as words, comments removed."""
    for line in block.text.replace("\\\n", " ").splitlines():
        if words := shlex.split(line, comments=True):
            yield words


def run_page(page: Path) -> None:
    """Run the blocks of a page in the current directory; what fails is raised with the page and the block."""
    names: dict[str, Any] = {"__name__": "docs"}
    for number, block in enumerate(blocks_of(page), start=1):
        place = f"{page.name}, block {number}"
        if block.note == "not run":
            continue
        if block.note == "file":
            Path(block.of).write_text(block.text, encoding="utf-8")
        if block.language == "python":
            exec(compile(block.text, place, "exec"), names)
            continue
        for words in lines_of(block):
            _run_line(words, place)


def _run_line(words: list[str], place: str) -> None:
    if words[0] == "make":
        subprocess.run(["make", "--dry-run", *words[1:]], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        return
    if words[0] != "shapespace":
        raise ValueError(f"{place}: {words[0]} is no command that pages run.")
    command = [sys.executable, "-m", *words]
    if words[1] == "explore" and "--export" not in words:
        _serve(command, place)
        return
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{place}: {shlex.join(words)}: exit status {done.returncode}\n{done.stderr}")


def _serve(command: list[str], place: str) -> None:
    """Start what serves until it is ended; it must print its address."""
    log, deadline = Path("served.txt"), time.monotonic() + _SERVER_SECONDS
    with log.open("w") as file, subprocess.Popen(command, stdout=file, stderr=file) as server:
        while "http://127.0.0.1" not in log.read_text() and server.poll() is None and time.monotonic() < deadline:
            time.sleep(0.1)
        server.terminate()
    if "http://127.0.0.1" not in log.read_text():
        raise RuntimeError(f"{place}: {shlex.join(command)} printed no address: {log.read_text()}")


def main(page: str, folder: str) -> None:
    """Run one page in a folder of its own."""
    source, place = Path(page).resolve(), Path(folder).resolve()
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    os.environ |= {"MPLBACKEND": "agg", "PYTHONUNBUFFERED": "1"}
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT / "src"), os.environ.get("PYTHONPATH", "")]))
    os.chdir(place)
    run_page(source)


if __name__ == "__main__":
    main(*sys.argv[1:])
