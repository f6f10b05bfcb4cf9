"""Sphinx: pages in Markdown, run before they are built, with the pictures that they make; nothing is loaded from elsewhere."""

import hashlib
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(ROOT / "src"), str(HERE)]

from executed import blocks_of
from sphinx.errors import ExtensionError
from sphinx.util import logging

project = "shapespace"
author = "the shapespace developers"
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
    "sphinx-mathjax-offline",
]
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = "shapespace"
html_show_sourcelink = False
html_show_copyright = False
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
# Links to files of the repository that are no pages.
suppress_warnings = ["myst.xref_missing"]

RUN = ROOT / "build" / "docs" / "pages"
MADE = HERE / "made"


def run_changed(app: Any) -> None:
    """Run every page that changed, or whose package did, and keep the pictures that it makes."""
    if not app.config.run_pages:
        return
    MADE.mkdir(exist_ok=True)
    package = hashlib.sha256()
    for file in sorted((ROOT / "src").rglob("*.*")):
        if file.suffix in (".py", ".toml"):
            package.update(file.read_bytes())
    failures = []
    for page in [*sorted(HERE.rglob("*.md")), ROOT / "README.md"]:
        if not any(block.note != "not run" for block in blocks_of(page)):
            continue
        name = "-".join(page.relative_to(ROOT).with_suffix("").parts)
        folder, mark = RUN / name, RUN / f"{name}.done"
        digest = hashlib.sha256(package.digest() + page.read_bytes()).hexdigest()
        if not mark.exists() or mark.read_text() != digest:
            logging.getLogger(__name__).info(f"running {page.relative_to(ROOT)} ...")
            command = [sys.executable, str(HERE / "executed.py"), str(page), str(folder)]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                failures.append(f"{page.relative_to(ROOT)} does not run:\n{done.stderr}")
                continue
            mark.write_text(digest)
        for picture in folder.rglob("*.png"):
            if f"made/{picture.name})" in page.read_text(encoding="utf-8"):
                shutil.copy(picture, MADE / picture.name)
    if failures:
        raise ExtensionError("\n".join(failures))


def expect_no_pictures(app: Any, config: Any) -> None:
    """Pages that are not run make no pictures."""
    del app
    if not config.run_pages:
        config.suppress_warnings = [*config.suppress_warnings, "image.not_readable"]


def plain_docstring(app: Any, what: str, name: str, of: Any, options: Any, lines: list[str]) -> None:
    """Docstrings are plain text with formulas: what reStructuredText would take for markup is escaped."""
    del app, what, name, of, options
    lines[:] = [re.sub(r"([*|]|(?<=\w)_(?!\w))", r"\\\1", line) for line in lines]


def setup(app: Any) -> None:
    """Called by Sphinx; `-D run_pages=0` builds the pages without running them."""
    app.add_config_value("run_pages", True, "env", bool)
    app.connect("config-inited", expect_no_pictures)
    app.connect("builder-inited", run_changed)
    app.connect("autodoc-process-docstring", plain_docstring)
