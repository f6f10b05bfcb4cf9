"""Which versions of what compute here."""

import platform
from importlib import metadata


def own_versions() -> dict[str, str]:
    """Of Python and of the packages that results depend on."""
    versions = {"python": platform.python_version()}
    for package in ("shapespace", "jax", "numpy"):
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return versions


def own_version() -> str:
    """Of this package."""
    return own_versions()["shapespace"]
