"""Files that ground stations have open over FTP: few, and not for ever."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from fsw.link.served_file import OpenFile

Client = tuple[int, int]
"""System and component id."""

_MAX_SESSIONS: Final = 8
_EXPIRY_US: Final = 30_000_000  # without a read: its client has gone without a word


@dataclass(slots=True)
class Session:
    """An open file."""

    owner: Client
    file: OpenFile
    used_us: int


class Sessions:
    """Open files by session number."""

    def __init__(self) -> None:
        self._open: dict[int, Session] = {}

    def room(self, t_us: int) -> int | None:
        """A free number, taken from whoever has not used it for long; None if there is none."""
        for number in range(_MAX_SESSIONS):
            session = self._open.get(number)
            if session is None:
                return number
            if t_us - session.used_us > _EXPIRY_US:
                self.close(number)
                return number
        return None

    def add(self, number: int, session: Session) -> None:
        """Put an open file at a free number."""
        self._open[number] = session

    def of(self, client: Client, number: int) -> Session | None:
        """The session of this number if it is this client's."""
        session = self._open.get(number)
        return session if session is not None and session.owner == client else None

    def close(self, number: int) -> None:
        """Close a file."""
        self._open.pop(number).file.close()

    def numbers_of(self, client: Client) -> list[int]:
        """The sessions that a client has open."""
        return [number for number, session in self._open.items() if session.owner == client]
