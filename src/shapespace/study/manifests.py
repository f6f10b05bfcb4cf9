"""The manifest of a store, `store.json`: what was computed and how, with which versions, and whether it is finished."""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from shapespace.base.errors import InputError, StoreError
from shapespace.base.outcome import Outcome
from shapespace.base.scales import QUANTITIES
from shapespace.study.files import storage, sync_directory, write_atomically
from shapespace.study.scenario import Scenario
from shapespace.study.versions import own_versions

FORMAT_VERSION = 3
"""To be raised with every change of what is stored, of records too: others are not read."""

CONVENTIONS = (
    "u = 0 upper pole or apex, u = 1 lower pole or rim; r' = h cos psi, z' = -h sin psi; outward normal "
    "(sin psi, cos psi); curvatures positive on a sphere, H half their sum; bending energy kappa/2 (2H - C0)^2 with "
    "kappa = bending_rigidity and C0 = spontaneous_curvature, the same as kappa_H (H - C)^2 with "
    "kappa_H = mean_curvature_rigidity = 2 kappa and C = spontaneous_mean_curvature = C0/2; "
    "velocities in the lab frame; at the initial time, whose state is "
    "given and not solved for, flow, pressure and powers are those of the first step; a flat disc, whose flow has no limit "
    "there, is at rest"
)

MANIFEST = "store.json"
_FORMAT = "shapespace-"


def new_manifest(noun: str, folder: str, note: str, scenario: Scenario) -> dict[str, Any]:
    """That of a store without records: what it holds, what its folder of records is named, and a note on them for readers."""
    scales = scenario.scales
    return {
        "format": _FORMAT + noun,
        "format_version": FORMAT_VERSION,
        "created": now(),
        "versions": own_versions(),
        "scales": {name: getattr(scales, name) for name in ("length", "energy", "time", "concentration")},
        "units": {name: scales.unit(name) for name in QUANTITIES},
        "conventions": CONVENTIONS,
        "note": note,
        "scenario": scenario.as_dict(),
        "status": "running",
        "outcome": None,
        folder: None,
        "resumed": [],
    }


def read_manifest(path: Path, noun: str, folder: str) -> dict[str, Any]:
    """That of the store in a directory. StoreError where there is none, or one of another kind or version, or damaged."""
    file, made = path / MANIFEST, f"`shapespace {noun}` made"
    with storage(path):
        if not path.is_dir():
            raise StoreError(f"{path}: is not a directory that holds a {noun}; give one that {made}.")
        if not file.exists():
            raise StoreError(f"{path}: holds no {noun} (no {MANIFEST}); give a directory that {made}.")
        data = file.read_bytes()
    remedy = f"restore it, or {noun} again with another --out."
    try:
        manifest = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise StoreError(f"{file}: is damaged ({error}); {remedy}") from None
    if not isinstance(manifest, dict) or manifest.get("format") != _FORMAT + noun:
        raise StoreError(f"{file}: is not of a {_FORMAT}{noun} store; give a directory that {made}.")
    if manifest.get("format_version") != FORMAT_VERSION:
        raise StoreError(
            f"{file}: was written by another version of shapespace (format_version {manifest.get('format_version')}, this "
            f"one reads {FORMAT_VERSION}); use that version, or {noun} again with another --out."
        )
    missing = {"created", "versions", "scenario", "outcome", folder, "resumed", "status"} - manifest.keys()
    if missing:
        raise StoreError(f"{file}: is damaged (no {min(missing)}); {remedy}")
    if not isinstance(manifest[folder], int | None) or manifest["outcome"] not in {None, *Outcome}:
        raise StoreError(f"{file}: is damaged (outcome or {folder}); {remedy}")
    scenario_of(path, noun, manifest)
    return manifest


def scenario_of(path: Path, noun: str, manifest: dict[str, Any]) -> Scenario:
    """What was computed. StoreError where the manifest does not say so."""
    try:
        return Scenario.from_dict(manifest["scenario"])
    except (InputError, KeyError, TypeError, AttributeError) as error:
        if "--import" in str(error):
            raise StoreError(f"{path}: {error}") from None
        raise StoreError(
            f"{path / MANIFEST}: is damaged (scenario: {error}); restore it, or {noun} again with another --out."
        ) from None


def write_manifest(path: Path, manifest: dict[str, Any]) -> None:
    """Put the manifest of a directory in its place in one step, on the disk."""
    write_atomically(path / MANIFEST, (json.dumps(manifest, indent=2, allow_nan=False) + "\n").encode())
    sync_directory(path)


def noun_of(path: str | Path) -> str | None:
    """What a directory holds by its manifest, as `run` or `branch`; None where that cannot be told."""
    try:
        manifest = json.loads((Path(path) / MANIFEST).read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    form = manifest.get("format") if isinstance(manifest, dict) else None
    return form.removeprefix(_FORMAT) if isinstance(form, str) and form.startswith(_FORMAT) else None


def holds_store(path: str | Path) -> bool:
    """Whether there is a manifest in this directory, whatever its state."""
    try:
        return (Path(path) / MANIFEST).is_file()
    except OSError:
        return False


def now() -> str:
    """The time as ISO text to the second, in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")
