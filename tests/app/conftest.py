"""Stores to explore, made once, and explorers that serve them. Imports come late: jax must find its cache configured."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.app.browser import Browser
    from tests.app.served import MoreStores, Stores

    from shapespace.app.explore import Explorer


@pytest.fixture(scope="session")
def stores(tmp_path_factory: pytest.TempPathFactory) -> "Stores":
    """To be read only."""
    from tests.app.stores import make_stores

    return make_stores(tmp_path_factory.mktemp("explored"))


@pytest.fixture(scope="session")
def more(stores: "Stores", tmp_path_factory: pytest.TempPathFactory) -> "MoreStores":
    """To be read only, as those above."""
    from tests.app.stores import make_more

    return make_more(tmp_path_factory.mktemp("more"), stores.branch)


@pytest.fixture(scope="session")
def explorer(stores: "Stores") -> "Iterator[Explorer]":
    """Serving all of them."""
    from tests.app.served import serving

    with serving(*stores) as found:
        yield found


@pytest.fixture(scope="session")
def whole(stores: "Stores", more: "MoreStores") -> "Iterator[Explorer]":
    """Serving these and those, in their order."""
    from tests.app.served import serving

    with serving(*stores, *more) as found:
        yield found


@pytest.fixture
def serve() -> "Iterator[Callable[..., Explorer]]":
    """Serves stores until the test ends."""
    from tests.app.served import serving

    with ExitStack() as stack:
        yield lambda *paths: stack.enter_context(serving(*paths))


@pytest.fixture(scope="session")
def program() -> "Iterator[Browser]":
    """A browser for all tests."""
    from tests.app.browser import PROGRAM, chromium

    if PROGRAM is None:
        # No package of Python's brings a browser, and all but these tests do without.
        pytest.skip("needs Chromium (Debian: apt install chromium)")
    with chromium() as found:
        yield found


@pytest.fixture
def browser(program: "Browser") -> "Iterator[Browser]":
    """The same; no test leaves an error on its console."""
    program.errors.clear()
    program.requests.clear()
    program.resize(1280, 800)
    yield program
    # A page left open may go on moving, at the cost of all tests after it.
    program.send("Page.navigate", url="about:blank")
    assert not program.errors
