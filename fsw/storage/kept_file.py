"""Where the parameters of a flight are kept: the file of the vehicle, and the record of the run."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from fsw.autopilot.parameters.contradictions import agreed
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.storage.parameter_file import Loaded, load, save
from fsw.storage.parameter_store import ParameterStore


class ParameterFile:
    """Takes over what was kept at the start of a flight, and writes after each change.

    The vehicle's file holds what differs from the configuration, so that a better default reaches
    a vehicle on which it was never changed; the record holds everything, to say what flew.
    """

    def __init__(self, path: Path | None, record: Path, config: FlightConfig) -> None:
        """Read the vehicle's file; without one changes end with the flight.

        Nothing is made of it yet: what is of no use is refused before a minute of compiling.

        Raises:
            ValueError: What was kept contradicts itself, in this ``config`` of the start.
            OSError: It cannot be read or written.
        """
        loaded = load(path) if path is not None and path.exists() else Loaded({}, ())
        self.complaints = loaded.complaints  # about lines of the file
        self.restored = 0  # values that are not the default
        self._kept, self._path, self.record = loaded.values, path, record
        self._spoilt = bool(loaded.complaints)  # whether part of the file was of no use
        self._store = ParameterStore(config, partial(agreed, config))
        self._store.restore(self._kept)
        if path is not None:
            with tempfile.TemporaryFile(dir=Path(os.path.realpath(path)).parent):
                pass  # as it is written
        self._executor: ThreadPoolExecutor | None = None

    def restore(self, store: ParameterStore) -> None:
        """Let a store that has not flown yet take over what was kept.

        Raises:
            OSError: It cannot be written.
        """
        self._store = store
        self.restored = store.restore(self._kept)
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
        save(self.record, values)
