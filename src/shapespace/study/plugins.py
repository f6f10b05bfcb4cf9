"""Where models that users make come from: files given by hand, and packages with the entry point `shapespace.models`."""

import importlib.util
import os
import sys
from collections.abc import Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from tempfile import mkdtemp
from threading import Lock

from shapespace.base.errors import InputError

GROUP = "shapespace.models"
VARIABLE = "SHAPESPACE_IMPORT"
"""Of the environment: files that define models, as in PATH; what this process imports, its workers import too."""
_RECEIVING = Lock()


def import_file(path: str | Path) -> None:
    """Run a Python file that defines models. InputError where there is none, or where it is not Python or not admissible."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"--import {path}: there is no such file; give a Python file that defines models.")
    name = f"shapespace_import_{path.stem}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise InputError(f"--import {path}: is no Python file; end its name in .py.")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (SyntaxError, ImportError, ValueError) as error:
        del sys.modules[name]
        raise InputError(f"--import {path}: {' '.join(str(error).split())}") from None
    os.environ[VARIABLE] = os.pathsep.join(dict.fromkeys([*_imported(), str(path.resolve())]))


def files_here() -> list[tuple[str, str]]:
    """Names and texts of the files that were imported, for workers elsewhere."""
    return [(path.name, path.read_text(encoding="utf-8")) for path in map(Path, _imported())]


def receive_files(files: Sequence[tuple[str, str]]) -> None:
    """Import files that came by name and text, those that this process does not know. InputError as of `import_file`."""
    with _RECEIVING:
        known = {text for _, text in files_here()}
        for name, text in files:
            if text not in known:
                path = Path(mkdtemp(prefix="shapespace-")) / name
                path.write_text(text, encoding="utf-8")
                import_file(path)


def _imported() -> list[str]:
    return [file for file in os.environ.get(VARIABLE, "").split(os.pathsep) if file]


@cache
def load_installed() -> None:
    """Load the files of the environment and every installed package that registers models, once."""
    for file in _imported():
        import_file(file)
    for entry in metadata.entry_points(group=GROUP):
        try:
            entry.load()
        except (SyntaxError, ImportError, AttributeError, ValueError) as error:
            raise InputError(f"entry point {entry.name} of {GROUP}: {error}; mend or uninstall its package.") from None
