"""Show stores in a browser: served until interrupted, or written to one file."""

import secrets
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

from shapespace.app.catalogue import Catalogue
from shapespace.app.page import question, single_file
from shapespace.base.errors import InputError
from shapespace.study.files import storage, write_atomically

UNDISTURBED = 3.0
"""Seconds after which what computes is loaded though no page has come yet."""
FIRST = 1.5
"""Seconds to read the first store in before the address is told: together with a browser that opens it takes longer."""
MOST_STATES = 4000
"""Of all stores in one file: each state takes some kilobytes."""


class Explorer:
    """A served explorer: `address` to open, `serve` to answer until `stop`."""

    def __init__(self, stores: Sequence[str | Path], port: int = 0) -> None:
        # Imported late, as a file is written without them.
        try:
            import uvicorn

            from shapespace.app.server import HOST, LONGEST_HEAD, make_app, open_socket
        except ImportError as error:
            raise InputError(
                f"explore: needs {error.name}; install it with `pip install 'shapespace[explore]'`."
            ) from None
        self.catalogue = Catalogue([Path(one) for one in stores])
        token = secrets.token_urlsafe(24)
        self._socket = open_socket(port)
        self.address = f"http://{HOST}:{self._socket.getsockname()[1]}/{token}/"
        config = uvicorn.Config(
            make_app(self.catalogue, token),
            log_level="error",
            access_log=False,
            lifespan="off",
            ws="none",
            http="h11",
            h11_max_incomplete_event_size=LONGEST_HEAD,
            timeout_graceful_shutdown=1,
            server_header=False,
            proxy_headers=False,
        )
        self._server = uvicorn.Server(config)
        first = threading.Thread(target=self._read, args=(0,), daemon=True)
        first.start()
        first.join(FIRST)

    def serve(self) -> None:
        """Answer until interrupted or stopped."""
        threading.Thread(target=self._prepare, daemon=True).start()
        self._server.run(sockets=[self._socket])

    def stop(self) -> None:
        """End `serve` in another thread."""
        self._server.should_exit = True

    def close(self) -> None:
        """Listen no longer, where `serve` was never called."""
        self._socket.close()

    def _read(self, number: int) -> None:
        """Read what the page shows first of a store; what is wrong with it the page tells."""
        with suppress(InputError):
            self.catalogue.source(number).overview()

    def _prepare(self) -> None:
        """Read the other stores while the page opens; load what computes when that is shown."""
        self.catalogue.is_shown.wait(UNDISTURBED)
        for number in range(1, len(self.catalogue.paths)):
            self._read(number)
        for number in range(len(self.catalogue.paths)):
            with suppress(InputError, StopIteration):
                self.catalogue.source(number).warm()


def export(stores: Sequence[str | Path], file: str | Path, progress: Callable[[int, int], None] | None = None) -> Path:
    """Write the explorer of these stores as one HTML file that needs neither this program nor a network.

    progress: told how many states are in of how many. InputError where the stores hold more than MOST_STATES states.
    """
    file = Path(file)
    if file.suffix != ".html":
        raise InputError(f"{file}: is not named as a page; end it in .html.")
    catalogue = Catalogue([Path(one) for one in stores])
    answers: dict[str, Any] = {question("stores"): catalogue.stores()}
    sources = [catalogue.source(number) for number in range(len(stores))]
    count = sum(sum(1 for _ in source.places()) for source in sources)
    if count > MOST_STATES:
        raise InputError(f"{file}: {count} states are too many for one file, at most {MOST_STATES}; give fewer stores.")
    done = 0
    for number, source in enumerate(sources):
        for name, about in chain([("overview", {})], source.questions()):
            asked = {"store": str(number), **about}
            answers[question(name, **asked)] = catalogue.answer(name, asked)
            done += name == "state"
            if name == "state" and progress is not None:
                progress(done, count)
    with storage(file):
        write_atomically(file, single_file(answers))
    return file
