"""What tests ask of a page."""

from tests.app.browser import Browser

from shapespace.app.explore import Explorer

RUN, BRANCH, MAP, DIVISION, FOLDS, FORKS, SEARCH, STATES = range(8)
"""Numbers of the stores; the first three are those of the small explorer."""


def address(explorer: Explorer, store: int, **view: object) -> str:
    """Of a view of a store."""
    return explorer.address + "#" + "&".join(f"{key}={value}" for key, value in {"store": store, **view}.items())


def open_page(browser: Browser, explorer: Explorer, store: int, **view: object) -> None:
    """Look at a store."""
    browser.open(address(explorer, store, **view))
    browser.settle()


def go_to(browser: Browser, link: str) -> None:
    """Follow a link of the page that is open, as if it were pasted into its address."""
    browser.run(f"new Promise((done) => {{ addEventListener('hashchange', () => setTimeout(done), {{ once: true }});"
                f"const old = location.href; location.href = {link!r}; if (location.href === old) done(); }})")  # fmt: skip
    browser.settle()


def shown(browser: Browser) -> dict[str, float]:
    """The numbers on the page, by name."""
    return {
        name: float(value) for name, value in browser.all("#facts [data-name]", "[e.dataset.name, e.dataset.value]")
    }


def title(browser: Browser) -> str:
    """Of the state."""
    return text(browser, "#facts .title b")


def text(browser: Browser, selector: str) -> str:
    """Of an element."""
    return str(browser.run(f"document.querySelector({selector!r}).textContent"))


def has(browser: Browser, selector: str) -> bool:
    """Whether there is such an element, and it is to be seen."""
    return bool(browser.run(f"document.querySelector({selector!r})?.checkVisibility() ?? false"))


def has_shape(browser: Browser) -> bool:
    """Whether the outline is drawn."""
    return has(browser, "#outline .shape")


def pixels(browser: Browser) -> int:
    """How many pixels of the three-dimensional view something is drawn on."""
    return int(
        browser.run(
            "(async () => { const c = document.querySelector('#stage canvas'), d = document.createElement('canvas');"
            "await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));"
            "[d.width, d.height] = [c.width, c.height]; const p = d.getContext('2d'); p.drawImage(c, 0, 0);"
            "const a = p.getImageData(0, 0, d.width, d.height).data; let n = 0;"
            "for (let i = 3; i < a.length; i += 4) n += a[i] > 0; return n; })()"
        )
    )


def middle(browser: Browser, selector: str) -> tuple[float, float]:
    """Of an element, in the window."""
    x, y = browser.run(
        f"(() => {{ const b = document.querySelector({selector!r}).getBoundingClientRect();"
        "return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    return x, y


def along(browser: Browser, selector: str, share: float) -> tuple[float, float]:
    """A point of a line, at this share of its length, in the window."""
    x, y = browser.run(
        f"(() => {{ const e = document.querySelector({selector!r}), p = e.getPointAtLength({share} * e.getTotalLength());"
        "const m = e.getScreenCTM(); return [m.a * p.x + m.e, m.d * p.y + m.f]; })()"
    )
    return x, y


def click_in_map(browser: Browser, across: float, up: float) -> None:
    """Click at these shares of the width and the height of a map."""
    x, y, width, height = browser.run(
        "(({x, y, width, height}) => [x, y, width, height])(document.querySelector('#diagram canvas').getBoundingClientRect())"
    )
    browser.click_at(x + across * width, y + (1.0 - up) * height)
    browser.settle()


def focused(browser: Browser) -> str:
    """What the keyboard is at: its id, or what it is called."""
    return str(
        browser.run(
            "(({activeElement: e}) => e.id || e.dataset.index || e.textContent.trim().slice(0, 40) || e.tagName)(document)"
        )
    )
