"""Every mode and every fault: flown as a campaign, compared with what must happen."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

from fsw.autopilot.signals import Severity
from sitl.scenario_file import PERFECT
from studies.fault_matrix import flights
from studies.fault_matrix.expectations import Expected, differences
from studies.fault_matrix.flights import FaultFlight, fly
from studies.flight import closed_loop
from studies.flight.job import sources

_TRIES = 8  # of seeds
_NEXT_SEED = 1_000_003
_NATURAL_S = 0.1  # a warning that comes as early or late without the fault is not about it


@dataclass(frozen=True, slots=True)
class Cell:
    """One mode with one fault, flown in process; a flight of a campaign."""

    mode: str
    expected: Expected
    seed: int

    def key(self) -> str:
        """See :class:`studies.campaign.ports.Flight`; what must happen is not part of it."""
        one = (self.mode, self.expected.faults, self.expected.suite, self.seed)
        code = sources(closed_loop, flights)
        return hashlib.sha256((repr(one) + code).encode()).hexdigest()[:32]

    def row(self) -> FaultFlight:
        """See :class:`studies.campaign.ports.Flight`."""
        began_s = time.monotonic()
        try:
            flight = self._flown()
        except Exception as error:
            flight = self.broken(f"{type(error).__name__}: {error}")
        return replace(flight, took_s=time.monotonic() - began_s)

    def _flown(self) -> FaultFlight:
        faults, suite = self.expected.faults, self.expected.suite
        seed = sound_seed(self.mode, suite, self.seed)
        flight = fly(self.mode, faults, suite, seed)
        if faults and suite != PERFECT:
            flight = without_natural(flight, self.mode, suite, seed)
        return flight

    def broken(self, reason: str) -> FaultFlight:
        """See :class:`studies.campaign.ports.Flight`."""
        return FaultFlight(problem=reason, error=True)

    def from_line(self, line: Mapping[str, Any]) -> FaultFlight:
        """See :class:`studies.campaign.ports.Flight`."""
        return FaultFlight.from_line(line)


@dataclass(frozen=True, slots=True)
class Judged:
    """What became of a cell, and what of it is not as it must be."""

    cell: Cell
    flight: FaultFlight
    differs: tuple[str, ...]
    known: tuple[str, ...] = ()  # limits of the safety manual by which a pair ended

    def as_json(self) -> dict[str, Any]:
        """The row of the cell."""
        cell, flight, warning = self.cell, self.flight, self.flight.warning
        return {
            "mode": cell.mode,
            "fault": cell.expected.name,
            "faults": [asdict(fault) for fault in cell.expected.faults],
            "sensors": cell.expected.suite,
            "seed": cell.seed,
            "told_s": None if warning is None else warning.after_s,
            "told": "" if warning is None else warning.text,
            "actions": list(flight.actions),
            "contact": flight.contact,
            "ended": flight.ended,
            "min_margin_m": flight.least_m,
            "away_m": flight.away_m,
            "force_share": flight.force_share,
            "known_limits": list(self.known),
            "as_expected": not self.differs,
            "differs": list(self.differs),
            "expected": asdict(cell.expected.modes[cell.mode]),
        }


def judge(cell: Cell, flight: FaultFlight) -> Judged:
    """Compare a flight with what must happen."""
    expected = cell.expected.modes[cell.mode]
    return Judged(cell, flight, differences(cell.mode, expected, flight))


def sound_seed(mode: str, suite: str, seed: int, *, surely: bool = False) -> int:
    """This seed, or one of a row of its own with which sensors let the mode be flown at all.

    At the start satellites may be off by so much that the vehicle is not armed, or takes itself to
    be on the ground; without corrections, by more than the wall is away. Other suites let it be
    flown nearly always, and are looked at where that is to be known ``surely``.
    """
    row = (seed + k * _NEXT_SEED for k in range(_TRIES))
    if surely or suite == "rtk":
        return next((one for one in row if not _natural(mode, suite, one).problem), seed)
    if suite == "gnss":
        flown = ((one, _natural(mode, suite, one)) for one in row)
        return next((one for one, it in flown if not (it.problem or it.contact)), seed)
    return seed


@cache
def _natural(mode: str, suite: str, seed: int) -> FaultFlight:
    """The same flight without a fault: its sensors have outliers of their own."""
    return fly(mode, (), suite, seed)


def without_natural(flight: FaultFlight, mode: str, suite: str, seed: int) -> FaultFlight:
    """The flight without warnings that come without its faults as well."""
    natural = _natural(mode, suite, seed)
    kept = [
        said
        for said in flight.texts
        if said.severity > Severity.WARNING
        or not any(
            said.text == one.text and abs(said.after_s - one.after_s) <= _NATURAL_S
            for one in natural.texts
        )
    ]
    return replace(flight, texts=tuple(kept))
