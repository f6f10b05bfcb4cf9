"""The explorer in Chromium on a map of 500 x 500 points, a branch and a run: how long until it shows, how long a click takes.

The map is made of spheres, written by the store's own writer, so that only reading and showing it is measured; its shapes are
computed again at each click, as the store has numbers only. Times are wall-clock, on two cores with Chromium drawing in software.
Run from the root: python -m benchmarks.bench_explore [COUNT]   (COUNT x COUNT points, 500 without; needs Chromium; a minute)
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from benchmarks.timing import machine
from tests.app.browser import PROGRAM, Browser, chromium
from tests.app.stores import make_branch, make_map, make_run

CLICKS = 20
PATIENCE = 300.0
SHOWN = "!!document.querySelector('#diagram svg .here')"
SHAPE = "!!document.querySelector('#outline .shape') && document.body.dataset.busy === 'false'"
CLICK = """(async () => {
  const host = document.getElementById('diagram'), box = host.getBoundingClientRect();
  const told = () => [...document.querySelectorAll('#facts .title [data-value]')].map((e) => e.dataset.value).join();
  const before = told(), began = performance.now();
  const once = (test) => new Promise((done) => {
    const watch = new MutationObserver(() => test() && end()), limit = setTimeout(() => end(), 5000);
    const end = () => { watch.disconnect(); clearTimeout(limit); done(performance.now() - began); };
    watch.observe(document.body, { subtree: true, childList: true, attributes: true });
  });
  // Of a map anywhere, else on the line: elsewhere a click finds no record.
  const line = host.querySelector('svg path.stable, svg path.unstable, svg path.first');
  const place = line?.getPointAtLength(%f * line.getTotalLength()).matrixTransform(line.getScreenCTM());
  const at = host.querySelector('canvas')?.checkVisibility() || !place
    ? { clientX: box.left + %f * box.width, clientY: box.top + %f * box.height, bubbles: true }
    : { clientX: place.x, clientY: place.y, bubbles: true };
  const numbers = once(() => told() !== before);
  const shape = once(() => told() !== before && document.body.dataset.busy === 'false');
  host.dispatchEvent(new MouseEvent('click', at));
  const times = [await numbers, await shape];
  await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  return told() === before ? null : [...times, performance.now() - began];
})()"""


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    if PROGRAM is None:
        print("left out: needs Chromium")
        return
    print(machine())
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        there = Path(folder)
        stores = {
            f"map of {count} x {count}": make_map(there / "map", count),
            "branch": make_branch(there / "branch"),
            "run": make_run(there / "run", 0.1),
        }
        for name, path in stores.items():
            print(name)
            show(browser, path)


def show(browser: Browser, path: Path) -> None:
    """Times of one store, from the command to the last click."""
    began = time.perf_counter()
    command = [sys.executable, "-m", "shapespace", "explore", str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        try:
            watch(browser, server, began)
        finally:
            server.terminate()


def watch(browser: Browser, server: "subprocess.Popen[str]", began: float) -> None:
    """Times from the address to the last click."""
    assert server.stdout is not None
    address = server.stdout.readline().strip()
    print(f"    command to address: {time.perf_counter() - began:.2f} s")
    for words in ("opens at once", "opens again"):
        began, worked = time.perf_counter(), processor_seconds(server)
        browser.open(address, SHOWN)
        shown, work = time.perf_counter() - began, processor_seconds(server) - worked
        browser.wait(SHAPE, PATIENCE)
        print(f"    {words}: states drawn {shown:.2f} s, processor time of the server till then {work:.2f} s; "
              f"first shape {time.perf_counter() - began:.2f} s")  # fmt: skip
    browser.wait("!!document.body.dataset.stage")
    size = browser.run("performance.getEntriesByType('resource').reduce((sum, one) => sum + one.encodedBodySize, 0)")
    print(f"    transferred: {size / 1e6:.1f} MB")
    began, worked = time.perf_counter(), processor_seconds(server)
    wait_until_idle(server)
    print(
        f"    idle {time.perf_counter() - began:.1f} s later, processor time {processor_seconds(server) - worked:.1f} s"
    )
    random = np.random.default_rng(1)
    places, worked = random.uniform(0.15, 0.85, (CLICKS, 2)), processor_seconds(server)
    times = np.array([one for x, y in places if (one := browser.run(CLICK % (x, x, y))) is not None])
    if len(times):
        middle, worst = np.median(times, axis=0), times.max(axis=0)
        work = 1e3 * (processor_seconds(server) - worked) / CLICKS
        print(f"    {len(times)} clicks, processor time of the server {work:.0f} ms each")
        print(f"    numbers: median {middle[0]:.0f} ms, longest {worst[0]:.0f} ms; "
              f"shape: median {middle[1]:.0f} ms, longest {worst[1]:.0f} ms; "
              f"on the screen, drawn in software: median {middle[2]:.0f} ms, longest {worst[2]:.0f} ms")  # fmt: skip


def wait_until_idle(server: "subprocess.Popen[str]", quiet: float = 0.5) -> None:
    """Until the server has loaded all that it does in the background."""
    before = -1.0
    while processor_seconds(server) > before:
        before = processor_seconds(server)
        time.sleep(quiet)


def processor_seconds(server: "subprocess.Popen[str]") -> float:
    """Of all threads of the server, which a busy machine changes little."""
    fields = Path(f"/proc/{server.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
