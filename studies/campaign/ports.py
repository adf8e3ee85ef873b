"""What a campaign needs: flights, rows, and the scheduler that hands flights out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar


class Row(Protocol):
    """What a flight leaves: a dataclass, whose fields a journal keeps."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def error(self) -> bool:
        """Whether the flight itself broke, not the vehicle: it is flown again on resuming."""


RowT = TypeVar("RowT", bound=Row)
RowT_co = TypeVar("RowT_co", bound=Row, covariant=True)


class Flight(Protocol[RowT_co]):
    """What is flown; it and its row can be pickled."""

    def key(self) -> str:
        """Its name: same flight, same name, in any process, while the code is the same."""

    def row(self) -> RowT_co:
        """Fly it here and now; an exception becomes a row with the error."""

    def broken(self, reason: str) -> RowT_co:
        """The row that stands for it if it cannot be flown."""

    def from_line(self, line: Mapping[str, Any]) -> RowT_co:
        """Its row as it was kept; a TypeError or KeyError if another version kept it."""


@dataclass(frozen=True, slots=True)
class Scheduler:
    """A running scheduler of Dask; files of TLS as Dask's own options have them."""

    address: str | None = None
    file: Path | None = None
    tls_ca_file: Path | None = None
    tls_cert: Path | None = None
    tls_key: Path | None = None


class SchedulerGoneError(Exception):
    """No scheduler answers, in one sentence; what was flown is kept."""
