"""Chromium without a window, driven through the pipe of its DevTools protocol: no driver program and no package needed."""

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

PROGRAM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--no-first-run",
    "--remote-debugging-pipe",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-dev-shm-usage",
    "--disable-sync",
    "--hide-scrollbars",
    "--mute-audio",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
PATIENCE = 60.0
KEYS = {"Enter": (13, "\r"), "Escape": (27, ""), "Tab": (9, ""), " ": (32, " ")}
"""Codes and letters of keys by which a browser does something of its own."""


class Browser:
    """One page. errors: what its console reported; requests: every address that it asked for."""

    def __init__(self, folder: Path) -> None:
        assert PROGRAM is not None
        (ask, self._write), (self._read, answer) = os.pipe(), os.pipe()
        # Chromium takes commands from descriptor 3 and answers on 4.
        script = f'exec "$@" 3<&{ask} 4>&{answer}'
        command = ["/bin/bash", "-c", script, "chromium", PROGRAM, *FLAGS, f"--user-data-dir={folder}", "about:blank"]
        self._process = subprocess.Popen(command, pass_fds=(ask, answer), stderr=subprocess.DEVNULL)
        os.close(ask)
        os.close(answer)
        self._buffer = b""
        self._number = 0
        self._events: deque[dict[str, Any]] = deque()
        self.errors: list[str] = []
        self.requests: list[str] = []
        self._session = ""
        target = self._first_page()
        self._session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.send(f"{domain}.enable")
        self.resize(1280, 800)

    def _first_page(self) -> str:
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            pages = [one for one in self.send("Target.getTargets")["targetInfos"] if one["type"] == "page"]
            if pages:
                return str(pages[0]["targetId"])
            time.sleep(0.05)
        raise TimeoutError("Chromium opened no page")

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """A command of the protocol and its result."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                return dict(answer["result"])

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            part = os.read(self._read, 1 << 20)
            assert part, "Chromium has ended"
            self._buffer += part
        line, _, self._buffer = self._buffer.partition(b"\0")
        message: dict[str, Any] = json.loads(line)
        self._note(message)
        return message

    def _note(self, message: dict[str, Any]) -> None:
        method, about = message.get("method"), message.get("params", {})
        if method == "Network.requestWillBeSent":
            self.requests.append(about["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            details = about["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Log.entryAdded" and about["entry"]["level"] == "error":
            self.errors.append(f"{about['entry']['text']} {about['entry'].get('url', '')}")
        elif method == "Runtime.consoleAPICalled" and about["type"] in ("error", "assert"):
            self.errors.append(str([one.get("value", one.get("description")) for one in about["args"]]))

    def run(self, script: str) -> Any:
        """The value of an expression in the page, which may be a promise."""
        result = self.send("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in result, result["exceptionDetails"].get("exception", result)
        return result["result"].get("value")

    def wait(self, script: str, patience: float = PATIENCE) -> Any:
        """The value of an expression once it is true."""
        until = time.monotonic() + patience
        while time.monotonic() < until:
            if value := self.run(script):
                return value
            time.sleep(0.02)
        raise TimeoutError(
            f"{script} stays {self.run(script)!r}; errors: {self.errors}; {self.run('document.body.innerText')}"
        )

    def open(
        self, address: str, ready: str = "document.body?.dataset.busy === 'false' && document.body.dataset.stage"
    ) -> None:
        """Go to an address and wait until the page has settled, the surface drawn."""
        # A change after the hash alone would not load the page again.
        self.send("Page.navigate", url="about:blank")
        self.wait("location.href === 'about:blank'")
        self.send("Page.navigate", url=address)
        self.wait(f"location.href !== 'about:blank' && {ready}")

    def settle(self) -> None:
        """Wait until nothing is being asked and what is due is drawn."""
        self.wait("document.body.dataset.busy === 'false'")
        self.run(
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 30))))"
        )

    def resize(self, width: int, height: int, *, mobile: bool = False) -> None:
        """The size of the window, in pixels."""
        scale = 2 if mobile else 1
        self.send("Emulation.setTouchEmulationEnabled", enabled=mobile)
        self.send(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=mobile
        )

    def click(self, selector: str, number: int = 0) -> None:
        """Click in the middle of an element, as a hand would."""
        box = self.run(
            f"(() => {{ const e = document.querySelectorAll({json.dumps(selector)})[{number}];"
            "e.scrollIntoView({block: 'nearest'}); const b = e.getBoundingClientRect();"
            "return [b.x + b.width / 2, b.y + b.height / 2]; })()"
        )
        self.click_at(*box)

    def click_at(self, x: float, y: float) -> None:
        """Move to a place and click there."""
        self.move(x, y)
        for kind in ("mousePressed", "mouseReleased"):
            self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def move(self, x: float, y: float) -> None:
        """Move the pointer."""
        self.send("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def choose(self, selector: str, value: object) -> None:
        """Set the value of a field, as its user would."""
        self.run(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); e.value = {json.dumps(str(value))};"
            "for (const kind of ['input', 'change']) e.dispatchEvent(new Event(kind, {bubbles: true})); })()"
        )

    def all(self, selector: str, what: str) -> list[Any]:
        """Of all elements, what an expression in `e` says of each."""
        script = f"JSON.stringify([...document.querySelectorAll({json.dumps(selector)})].map((e) => {what}))"
        return list(json.loads(self.run(script)))

    def press(self, key: str, text: str = "") -> None:
        """Press and release a key; what it does where nobody listens for it is done too."""
        code, letter = KEYS.get(key, (0, ""))
        told = {"key": key, "windowsVirtualKeyCode": code}
        self.send("Input.dispatchKeyEvent", type="keyDown", text=text or letter, **told)
        self.send("Input.dispatchKeyEvent", type="keyUp", **told)

    def picture(self, path: Path, *, full: bool = False) -> None:
        """Save what is to be seen."""
        data = self.send("Page.captureScreenshot", format="png", captureBeyondViewport=full)["data"]
        path.write_bytes(base64.b64decode(data))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(10)
        os.close(self._write)
        os.close(self._read)


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser with a profile of its own, gone afterwards."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, Browser(Path(folder)) as browser:
        yield browser
