"""Where the parameters of a flight are kept: the file of the vehicle, and the record of the run."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fsw.parameters.storage import Loaded, load, save
from fsw.parameters.store import ParameterStore


class ParameterFile:
    """Takes over what was kept at the start of a flight, and writes after each change.

    The vehicle's file holds what differs from the configuration, so that a better default reaches
    a vehicle on which it was never changed; the record holds everything, to say what flew.
    """

    def __init__(self, store: ParameterStore, path: Path | None, record: Path) -> None:
        """Take over what was kept in the vehicle's file; without one changes end with the flight.

        Raises:
            ValueError: What was kept contradicts itself.
            OSError: It cannot be read or written.
        """
        loaded = load(path) if path is not None and path.exists() else Loaded({}, ())
        self.complaints = loaded.complaints  # about lines of the file
        self.restored = store.restore(loaded.values)  # values that are not the default
        self._store, self._path, self._record = store, path, record
        self._spoilt = bool(loaded.complaints)  # whether part of the file was of no use
        self._executor: ThreadPoolExecutor | None = None
        self._save(store.values)

    def start(self) -> None:
        """Allow changes; begins a thread, so processes are to be forked before.

        Call it before the loop's thread asks for a priority, which a new thread would inherit.
        """
        self._executor = ThreadPoolExecutor(1, "parameters")
        self._executor.submit(int).result()  # the thread begins with the first call
        self._store.open(self._executor, self._save)

    def close(self) -> None:
        """Finish writing."""
        if self._executor is not None:
            self._executor.shutdown()

    def _save(self, values: Mapping[str, float]) -> None:
        """Write both files; where the vehicle's cannot be written, the old one is untouched."""
        if self._path is not None:
            if self._spoilt:
                shutil.copy2(self._path, self._path.with_name(f"{self._path.name}.old"))
                self._spoilt = False
            defaults = self._store.defaults
            save(self._path, {n: v for n, v in values.items() if v != defaults[n]})
        save(self._record, values)
