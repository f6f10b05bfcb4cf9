"""The directory of a run: `frames/NNNNNN.npz` hold one time step each, the first the initial state; see `records`."""

from pathlib import Path
from typing import Self

from shapespace.base.errors import StoreError
from shapespace.study.files import storage
from shapespace.study.frame import Frame, decode_frame, encode_frame
from shapespace.study.manifests import read_manifest, scenario_of
from shapespace.study.records import AbstractRecordStore
from shapespace.study.scenario import FREE_ON_RESUME, Scenario


class RunStore(AbstractRecordStore[Frame]):
    """The frames of one run. `create` and `resume` give a store to write, `open` one to read; use it as a context manager."""

    noun = "run"
    folder = "frames"
    note = (
        "arrays of frames are dimensionless, in units of the scales; times and observables are in the scenario's units"
    )

    encode = staticmethod(encode_frame)
    decode = staticmethod(decode_frame)

    @classmethod
    def create(cls, path: str | Path, scenario: Scenario) -> Self:
        """A new store in a directory that is empty or does not exist; StoreError, and nothing written, otherwise."""
        return cls._create(path, scenario, {})

    @classmethod
    def resume(cls, path: str | Path, scenario: Scenario) -> Self:
        """A stored run to continue. Checks every frame; only `until` and `max_steps` may differ."""
        path = Path(path)
        stored = scenario_of(path, cls.noun, read_manifest(path, cls.noun, cls.folder))
        if difference := stored.difference(scenario):
            raise StoreError(
                f"{path}: holds a run whose {difference}; resume with the same value or choose another --out."
            )
        return cls._reopen(path, stored.with_overrides({key: getattr(scenario.run, key) for key in FREE_ON_RESUME}))

    def _disorder(self, previous: Frame, record: Frame) -> str | None:
        ordered = record.time > previous.time
        return None if ordered else f"time {record.time:g} after {previous.time:g}"


def is_free(path: str | Path) -> bool:
    """Whether a new store can be created in this directory; StoreError where that cannot be found out."""
    with storage(Path(path)):
        try:
            RunStore.check_free(path)
        except StoreError:
            return False
    return True
