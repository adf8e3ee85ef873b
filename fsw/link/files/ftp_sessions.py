"""Open FTP sessions: limited in number, and with a timeout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from fsw.link.files.served_file import OpenFile

Client = tuple[int, int]
"""System and component id."""

_MAX_SESSIONS: Final = 8
_EXPIRY_US: Final = 30_000_000  # without a read: its client has gone without a word


@dataclass(slots=True)
class Session:
    """An open file."""

    file: OpenFile
    used_us: int


class Sessions:
    """Open files by client and number.

    Some clients choose the number of a session when they open a file, others take the one that is
    answered; so the wanted number is given unless the client has it open already.
    """

    def __init__(self) -> None:
        self._open: dict[tuple[Client, int], Session] = {}

    def room(self, client: Client, wanted: int, t_us: int) -> int | None:
        """A number for a further session; None if there are as many as there may be."""
        for key, session in list(self._open.items()):
            if t_us - session.used_us > _EXPIRY_US:
                self.close(*key)
        if len(self._open) >= _MAX_SESSIONS:
            return None
        numbers: tuple[int, ...] = (wanted, *range(_MAX_SESSIONS))
        return next(number for number in numbers if (client, number) not in self._open)

    def add(self, client: Client, number: int, session: Session) -> None:
        """Keep an open file under a number that there is room for."""
        self._open[client, number] = session

    def of(self, client: Client, number: int) -> Session | None:
        """The session of this number of this client."""
        return self._open.get((client, number))

    def close(self, client: Client, number: int) -> None:
        """Close a file."""
        self._open.pop((client, number)).file.close()

    def numbers_of(self, client: Client) -> list[int]:
        """The sessions that a client has open."""
        return [number for owner, number in self._open if owner == client]
