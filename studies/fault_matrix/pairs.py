"""Two faults at once, drawn at random beside walls: what is hit, or lost in silence, is found."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import Any, Final, cast, get_args

import numpy as np

from command_line.bounded_file import read_bounded
from command_line.bounded_toml import toml_table
from sitl.faults.keys import KINDS, LINKS, SENSORS, Fault, Kind, Unit, instances
from sitl.scenario_file import SUITE_NAMES
from sitl.scenario_validation import fault_problem
from sitl.seeds import stream
from studies.fault_matrix.expectations import ACTIONS, Expectation, Expected, NotFlown
from studies.fault_matrix.flights import SITUATIONS, FaultFlight, fly, is_believed
from studies.fault_matrix.matrix import Cell, Judged, sound_seed, without_natural
from vehicles.vehicle_file import load_vehicle

KNOWN_LIMITS: Final = Path(__file__).with_name("known_limits.toml")
FINDINGS: Final = ("wall", "ground", "lost", "silent", "no flight")
_FURTHEST_M: Final = 10.0  # from the start; no situation goes further than 2 m
_TOLD_ANYHOW: Final = Expectation(then=ACTIONS, contact="any", why="findings are judged otherwise")
_MAX_BYTES: Final = 1 << 20
# Processes, datagrams and the disk do not fail in process, and no suite has a camera for the flow.
_ELSEWHERE: Final = (*LINKS, "simulator", "flight software", "disk", "optical flow")
UNITS: Final = tuple(unit for unit in get_args(Unit) if unit not in _ELSEWHERE)
_AXES: Final = ("gyro", "accel", "mag", "gps", "vio")
_DEFAULT: Final = Fault("gyro", "off")


@dataclass(frozen=True, slots=True)
class Limit:
    """A way to end that stands in the safety manual."""

    name: str
    faults: tuple[str, ...]  # regular expressions, each of another fault of the pair
    ends: tuple[str, ...]  # of FINDINGS
    suites: tuple[str, ...]
    modes: tuple[str, ...]
    sentence: str  # as it stands in the manual

    def fits(self, cell: Cell, end: str) -> bool:
        """Whether an end of a pair is of this kind."""
        words = [str(fault) for fault in cell.expected.faults]
        return (
            end in self.ends
            and cell.expected.suite in self.suites
            and cell.mode in self.modes
            and any(
                all(re.fullmatch(one, word) for one, word in zip(self.faults, order, strict=False))
                for order in permutations(words)
            )
        )


class Pair(Cell):
    """A drawn pair in one mode; its own warnings are asked for only where that matters."""

    __slots__ = ()

    def key(self) -> str:
        """See :class:`studies.campaign.ports.Flight`."""
        return "pair " + super().key()

    def _flown(self) -> FaultFlight:
        suite = self.expected.suite
        seed = sound_seed(self.mode, suite, self.seed)
        flight = fly(self.mode, self.expected.faults, suite, seed)
        if flight.problem and (other := sound_seed(self.mode, suite, seed, surely=True)) != seed:
            seed = other
            flight = fly(self.mode, self.expected.faults, suite, seed)
        if "silent" in findings(without_texts(flight)):
            flight = without_natural(flight, self.mode, suite, seed)
        return flight


def without_texts(flight: FaultFlight) -> FaultFlight:
    """The same flight as one of which nothing was told."""
    return replace(flight, texts=())


def draw(seed: int, number: int, not_flown: NotFlown) -> Pair:
    """Pair ``number`` of a ``seed``: mode, suite, faults, and the seed of the flight."""
    random = stream(seed, "pairs", str(number))
    while True:
        mode = str(random.choice(list(SITUATIONS)))
        suite = str(random.choice(SUITE_NAMES))
        faults = (_fault(random, 3.0), _fault(random, 6.0))
        if suite not in not_flown.get(mode, {}) and _can_fail(mode, suite, faults):
            break
    name = f"pair {number}: {suite}, {' + '.join(map(words, faults))}"
    expected = Expected(name, faults, suite, False, {mode: _TOLD_ANYHOW})
    return Pair(mode, expected, int(random.integers(1 << 31)))


def _can_fail(mode: str, suite: str, faults: tuple[Fault, ...]) -> bool:
    """Whether all faults exist with a suite, and none is of what is believed there."""
    if any(is_believed(one, suite) for one in faults):
        return False
    situation = SITUATIONS[mode]
    scenario = _scenario(mode, suite)
    return not any(fault_problem(one, scenario) for one in situation.placed(faults))


@cache
def _scenario(mode: str, suite: str) -> Any:
    return SITUATIONS[mode].scenario(suite)


def _fault(random: np.random.Generator, latest_s: float) -> Fault:
    """A fault that begins within ``latest_s`` [s]; its numbers have three digits."""

    def between(low: float, high: float) -> float:
        """As likely in each decade."""
        return float(f"{math.exp(random.uniform(math.log(low), math.log(high))):.3g}")

    unit = cast(Unit, str(random.choice(UNITS)))
    kind = cast(Kind, str(random.choice(KINDS[unit])))
    sensor = unit in SENSORS
    sign = float(random.choice((-1.0, 1.0))) if sensor else 1.0
    most = instances(unit, load_vehicle("paper"))
    drawn = {
        "start_s": round(float(random.uniform(0.0, latest_s)), 2),
        "duration_s": between(0.05, 6.0) if random.random() < 0.5 else 0.0,
        "instance": float(random.integers(unit == "motor", most + 1)) if most else 0.0,
        "axis": float(random.integers(4)) if unit in _AXES and random.random() < 0.5 else 0.0,
        "share": round(float(random.uniform(0.05, 0.95)), 2),
        "size": sign * between(*_SIZES.get(kind, (0.1, 5.0))),
        "delay_ms": 2.0 * round(between(5.0, 500.0)),
        "rate_hz": between(0.5, 50.0),
        "forgets_s": between(0.02, 2.0),
        # What passes the link; it makes an even time of longer ones, and in process there is none.
        "jump_s": float(random.choice((-1.0, 1.0))) * between(0.002, 0.05),
    }
    late = kind == "delayed" or (unit, kind) == ("motor", "slow")
    used = {"start_s", "duration_s", "instance", *(("delay_ms",) if late else _USED.get(kind, ()))}
    used |= {"axis"} if sensor else set()
    return Fault(unit, kind, **{name: drawn[name] for name in used})


_SIZED: Final = ("wrong", "noisy", "wandering", "drifting", "turning", "tilting")
_SIZES: Final = {"noisy": (0.5, 10.0), "wandering": (0.5, 50.0)}
_USED: Final[dict[str, tuple[str, ...]]] = {
    **dict.fromkeys(_SIZED, ("size",)),
    **dict.fromkeys(("weak", "intermittent"), ("share",)),
    "slow": ("rate_hz",),
    "wandering": ("size", "forgets_s"),
    "jump": ("jump_s",),
}


def words(fault: Fault) -> str:
    """A fault with its numbers, but for those that are as by default."""
    names = [one.name for one in fields(Fault) if one.name not in ("unit", "kind", "instance")]
    said = [f"{k}={v:g}" for k in names if (v := getattr(fault, k)) != getattr(_DEFAULT, k)]
    return " ".join((str(fault), *said))


def findings(flight: FaultFlight) -> tuple[str, ...]:
    """How a flight ended where it must not; of ``FINDINGS``."""
    if flight.problem:
        return ("no flight",)
    found = [flight.contact] if flight.contact else []
    if flight.away_m is None or flight.away_m > _FURTHEST_M:
        found.append("lost")
    breach = flight.least_m is not None and not flight.least_m >= 0.0  # NaN is one
    hard = not flight.force_share <= 1.0
    if (found or breach or hard) and flight.warning is None:
        found.append("silent")
    return tuple(found)


def judge_pair(cell: Cell, flight: FaultFlight, limits: Sequence[Limit]) -> Judged:
    """The findings of a pair; those of a known limit are named, and are no difference."""
    known, differs = [], []
    for end in findings(flight):
        limit = next((one for one in limits if one.fits(cell, end)), None)
        if limit is None:
            differs.append(_sentence(end, flight))
        else:
            known.append(limit.name)
    return Judged(cell, flight, tuple(differs), tuple(known))


def _sentence(end: str, flight: FaultFlight) -> str:
    if end == "no flight":
        return flight.problem
    if end == "lost":
        return "position lost" if flight.away_m is None else f"{flight.away_m:.0f} m away"
    return "silent" if end == "silent" else f"{end}: {flight.ended}"


def known_limits() -> tuple[Limit, ...]:
    """The table of known limits.

    Raises:
        ValueError: It is not one.
    """
    found = []
    for table in toml_table(read_bounded(KNOWN_LIMITS, _MAX_BYTES).decode("utf-8"))["limits"]:
        every = {"suites": SUITE_NAMES, "modes": tuple(SITUATIONS)} | table
        keys: dict[str, Any] = {k: v if isinstance(v, str) else tuple(v) for k, v in every.items()}
        limit = Limit(**keys)
        if not set(limit.ends) <= set(FINDINGS) or not limit.faults or not limit.sentence:
            raise ValueError(
                f"{KNOWN_LIMITS}: {limit.name} needs faults, a sentence and ends of {FINDINGS}"
            )
        found.append(limit)
    return tuple(found)
