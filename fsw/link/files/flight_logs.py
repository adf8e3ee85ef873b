"""Which flights' logs are offered, and under which numbers.

The list is made once, when the vehicle starts: a number must mean the same file for as long as a
ground station may ask for it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fsw.link.files.served_file import DiskFile

NAMES: Final = ("flight.ulg", "flight.tlog")  # the first that a flight has is *the* log of it
_MAX_FLIGHTS: Final = 1000  # the newest; more would take a ground station minutes to list


@dataclass(frozen=True, slots=True)
class FlightLog:
    """The files of one flight."""

    flight: str  # name of its directory
    files: tuple[DiskFile, ...]  # in the order of NAMES; at least one

    @property
    def log(self) -> DiskFile:
        """The file that stands for the flight."""
        return self.files[0]


def flight_logs(directory: Path) -> tuple[FlightLog, ...]:
    """List this flight and those in the directories beside it, oldest first, this one last.

    Args:
        directory: Where the present flight writes; its logs must exist already.
    """
    directory = directory.absolute()
    dated = []
    with os.scandir(directory.parent) as entries:
        for entry in entries:
            # A link may lead anywhere, so it leads nowhere.
            if entry.is_dir(follow_symlinks=False) and entry.name != directory.name:
                earlier = _flight(Path(entry.path))
                if earlier is not None:
                    dated.append((earlier.log.status().st_mtime, entry.name, earlier))
    earlier_flights = [flight for _, _, flight in sorted(dated, key=lambda item: item[:2])]
    present = _flight(directory)
    return tuple([*earlier_flights, *([present] if present else [])][-_MAX_FLIGHTS:])


def _flight(directory: Path) -> FlightLog | None:
    paths = [directory / name for name in NAMES]
    files = tuple(DiskFile(path) for path in paths if path.is_file() and not path.is_symlink())
    return FlightLog(directory.name, files) if files else None
