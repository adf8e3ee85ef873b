"""Where the parameters of a flight are kept: the file of the vehicle, and the record of the run."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fsw.parameters.storage import Loaded, load, save
from fsw.parameters.store import ParameterStore


class KeptFile:
    """Reads at the start, writes after each change.

    The vehicle's file holds what differs from the configuration, so that a better default reaches
    a vehicle on which it was never changed; the record holds everything, to say what flew.
    """

    def __init__(self, path: Path | None, record: Path, defaults: Mapping[str, float]) -> None:
        """Nothing is read or written yet.

        Args:
            path: Of the vehicle; None: changes end with the flight.
            record: In the run's directory.
            defaults: Values that need not be kept.
        """
        self._path = path
        self._record = record
        self._defaults = defaults
        self._spoilt = False  # whether part of the file was of no use

    def load(self) -> Loaded:
        """What the vehicle's file says; nothing where there is none yet.

        Raises:
            OSError: It is there and cannot be read.
        """
        if self._path is None:
            return Loaded({}, ())
        if not self._path.exists():
            return Loaded({}, ())
        loaded = load(self._path)
        self._spoilt = bool(loaded.complaints)
        return loaded

    def save(self, values: Mapping[str, float]) -> None:
        """Write both files.

        Raises:
            OSError: The vehicle's file cannot be written; the old one is untouched.
        """
        if self._path is not None:
            if self._spoilt:
                shutil.copy2(self._path, self._path.with_name(f"{self._path.name}.old"))
                self._spoilt = False
            differing = {n: v for n, v in values.items() if v != self._defaults[n]}
            save(self._path, differing)
        save(self._record, values)


class ParameterFile:
    """A store whose changes are kept, from the start of a flight to its end."""

    def __init__(self, store: ParameterStore, file: KeptFile) -> None:
        """Take over what was kept.

        Raises:
            ValueError: What was kept contradicts itself.
            OSError: It cannot be read or written.
        """
        loaded = file.load()
        self.complaints = loaded.complaints  # about lines of the file
        self.restored = store.restore(loaded.values)  # values that are not the default
        file.save(store.values)
        self._store, self._file = store, file
        self._executor: ThreadPoolExecutor | None = None

    def start(self) -> None:
        """Allow changes; begins a thread, so processes are to be forked before.

        Call it before the loop's thread asks for a priority, which a new thread would inherit.
        """
        self._executor = ThreadPoolExecutor(1, "parameters")
        self._executor.submit(int).result()  # the thread begins with the first call
        self._store.open(self._executor, self._file.save)

    def close(self) -> None:
        """Finish writing."""
        if self._executor is not None:
            self._executor.shutdown()
