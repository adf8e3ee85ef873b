"""Sentences on their way to one link: a repeated one is counted, not said again and again.

An operator reads a handful of texts, and a ground station speaks them. A program that repeats a
command that cannot be carried out, twice a second, must not bury the texts that matter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from fsw.signals import Severity, StatusText

REPEAT_US: Final = 5_000_000  # the same sentence is said once in this time
_MOST: Final = 32  # sentences remembered
_RATE_PER_S: Final = 5  # of different sentences, in the long run
_BURST: Final = 20


@dataclass(slots=True)
class _Said:
    text: StatusText
    at_us: int
    held_back: int = 0


class TextLimiter:
    """One link's."""

    def __init__(self) -> None:
        self._said: dict[str, _Said] = {}  # oldest first
        self._room = float(_BURST)
        self._room_us = 0
        self._dropped = 0

    def admit(self, text: StatusText, t_us: int) -> StatusText | None:
        """The sentence if it is to be said now; None if it is counted only.

        Args:
            text: The sentence.
            t_us: Sensor time [us].
        """
        before = self._said.get(text.text)
        if before is not None and t_us - before.at_us < REPEAT_US:
            before.held_back += 1
            return None
        self._room = min(self._room + 1e-6 * _RATE_PER_S * (t_us - self._room_us), float(_BURST))
        self._room_us = t_us
        if self._room < 1.0:
            self._dropped += 1
            return None
        self._room -= 1.0
        self._said.pop(text.text, None)
        self._said[text.text] = _Said(text, t_us)
        if len(self._said) > _MOST:
            del self._said[next(iter(self._said))]
        return _counted(before) if before is not None and before.held_back else text

    def overdue(self, t_us: int) -> Iterator[StatusText]:
        """What was held back and has not come again, as information; call it now and then."""
        for said in self._said.values():
            if said.held_back and t_us - said.at_us >= REPEAT_US:
                yield replace(_counted(said), severity=Severity.INFO)
                said.at_us, said.held_back = t_us, 0
        if self._dropped and self._room + 1e-6 * _RATE_PER_S * (t_us - self._room_us) >= 1.0:
            yield StatusText(Severity.WARNING, f"{self._dropped} more texts were left out")
            self._dropped = 0


def _counted(said: _Said) -> StatusText:
    times = "once" if said.held_back == 1 else f"{said.held_back} times"
    return replace(said.text, text=f"{said.text.text} (again, {times})")
