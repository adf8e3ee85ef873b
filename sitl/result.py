"""How a run ended and what it scored, from the plant's truth."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field

import numpy as np

from sitl.gripped import PayloadUse
from sitl.limits import LimitUse
from sitl.plant.vector import Array
from sitl.scenario import V3
from sitl.touch import TouchUse


class EndKind(enum.Enum):
    """Why a run ended."""

    DURATION = "duration"  # the scenario's time is over
    MISSION = "mission"  # the pilot finished its plan before that
    COLLISION = "collision"
    CRASH = "crash"
    DIVERGED = "diverged"
    REFUSED = "refused"  # the vehicle denied the pilot
    INTERRUPTED = "interrupted"  # a signal; the regular end of an endless flight
    STOPPED = "stopped"  # from outside: lost peer


@dataclass(frozen=True, slots=True)
class EndReason:
    """The end of a run in one sentence."""

    kind: EndKind
    sentence: str
    time_s: float  # since the start of the simulation


@dataclass(frozen=True, slots=True)
class TruthResult:
    """The score of a run."""

    completed: bool
    end_reason: str
    duration_s: float
    tracking_error_rms_m: float | None  # None before the first sample
    tracking_error_max_m: float | None
    margins_m: dict[str, float]  # intersample minimum per zone and part
    surfaces_m: dict[str, float]  # the same to the surface itself, without the clearance
    beyond_s: dict[str, float]  # how long a part was beyond a surface, if it was
    min_margin_m: float | None  # None without constraints
    min_margin_key: str | None
    min_margin_time_s: float | None
    limits: dict[str, LimitUse] = field(default_factory=dict)  # use of the vehicle's limits
    touches: dict[str, TouchUse] = field(default_factory=dict)  # per zone that may be touched
    force_error_rms_n: float | None = None  # while a force was asked for; None if none was
    force_asked_rms_n: float | None = None  # over the same time
    payload: PayloadUse | None = None


class TrackingError:
    """Root mean square and maximum of the end-effector's distance from its reference.

    Source: TE of the paper, one sample per planning step; docs/equations.md E13.
    """

    def __init__(self) -> None:
        self._squares = 0.0
        self._count = 0
        self.maximum: float | None = None

    def add(self, p: V3, target: V3) -> None:
        """Add a sample: true position p [m, NED] and desired position target [m, NED]."""
        error = math.dist(p, target)
        self._squares += error * error
        self._count += 1
        self.maximum = error if self.maximum is None else max(error, self.maximum)

    @property
    def rms(self) -> float | None:
        """Root mean square [m], None before the first sample."""
        return math.sqrt(self._squares / self._count) if self._count else None


class MarginRecord:
    """Smallest value of every margin and when it was reached."""

    def __init__(self, keys: tuple[str, ...], clearances: Array) -> None:
        """Begin without any, for ``keys`` with clearances (keys,) [m]."""
        self.keys = keys
        self._clearances = clearances
        self._beyond_s = np.zeros(len(keys))
        self._lowest = np.full(len(keys), math.inf)
        self._when_s = np.zeros(len(keys))

    @property
    def minimum(self) -> list[float]:
        """Smallest value of each so far [m]; infinite before the first."""
        return self._lowest.tolist()

    @property
    def time_s(self) -> list[float]:
        """When each was reached [s]."""
        return self._when_s.tolist()

    @property
    def arrays(self) -> tuple[Array, Array]:
        """The memory behind both, for kernels."""
        return self._lowest, self._when_s

    @property
    def surfaces(self) -> list[float]:
        """Smallest distance to the surface of each so far [m]; infinite before the first."""
        distances: list[float] = (self._lowest + self._clearances).tolist()
        return distances

    @property
    def beyond_s(self) -> list[float]:
        """How long each was beyond the surface [s]."""
        return self._beyond_s.tolist()

    def add(self, values: tuple[float, ...], time_s: float, step_s: float = 0.0) -> None:
        """Take the margins [m] at one time, in the order of ``keys``, after a ``step_s``."""
        self._beyond_s[np.array(values) + self._clearances < 0.0] += step_s
        for i, value in enumerate(values):
            # Written so that NaN is recorded, not passed over.
            if not (value >= self._lowest[i]):
                self._lowest[i] = value
                self._when_s[i] = time_s

    def worst(self) -> int | None:
        """Index of the smallest margin, None while there is none."""
        minimum = self.minimum
        seen = [i for i, value in enumerate(minimum) if value != math.inf]
        return min(seen, key=lambda i: minimum[i], default=None)


def violation(record: MarginRecord) -> str | None:
    """A sentence about the deepest violated margin, None if all held."""
    worst = record.worst()
    if worst is None or record.minimum[worst] >= 0.0:
        return None
    depth = -1000.0 * record.minimum[worst]
    return (
        f"the {record.keys[worst]} margin was violated by {depth:.1f} mm "
        f"at {record.time_s[worst]:.2f} s"
    )


def beyond(record: MarginRecord) -> str | None:
    """A sentence about the part that was beyond a surface for longest, None if none was."""
    longest = max(range(len(record.keys)), key=lambda i: record.beyond_s[i], default=None)
    if longest is None or not record.beyond_s[longest] > 0.0:
        return None
    depth = -1000.0 * record.surfaces[longest]
    return (
        f"{record.keys[longest]} was beyond the surface for {record.beyond_s[longest]:.3f} s, "
        f"by up to {depth:.1f} mm"
    )


def score(
    end: EndReason | None,
    time_s: float,
    error: TrackingError,
    record: MarginRecord,
    whole: EndKind,
    flaws: tuple[str, ...] = (),
) -> TruthResult:
    """The result of a run, up to ``time_s``; ``end`` is None while it goes on.

    ``whole`` is the end that such a run should have; ``flaws`` say, each in a sentence, what else
    was not as in a completed run.
    """
    broken = violation(record)
    worst = record.worst()
    flown = end is not None and end.kind in (whole, EndKind.MISSION)
    parts = [end.sentence if end is not None else "still flying"]
    if whole is EndKind.MISSION and end is not None and end.kind is EndKind.DURATION:
        parts.append("the vehicle had not landed and disarmed by then")
    parts += flaws
    if broken is not None:
        parts.append(broken)
    behind = beyond(record)
    if behind is not None:
        parts.append(behind)
    return TruthResult(
        completed=flown and broken is None and not flaws,
        end_reason="; ".join(parts),
        duration_s=time_s,
        tracking_error_rms_m=error.rms,
        tracking_error_max_m=error.maximum,
        margins_m={k: m for k, m in zip(record.keys, record.minimum, strict=True) if m != math.inf},
        surfaces_m={
            k: m for k, m in zip(record.keys, record.surfaces, strict=True) if m != math.inf
        },
        beyond_s={k: s for k, s in zip(record.keys, record.beyond_s, strict=True) if s > 0.0},
        min_margin_m=None if worst is None else record.minimum[worst],
        min_margin_key=None if worst is None else record.keys[worst],
        min_margin_time_s=None if worst is None else record.time_s[worst],
    )
