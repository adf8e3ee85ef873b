"""Flights of a campaign file, and the flat row that each leaves."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from studies.campaign import keys, plan, values
from studies.campaign.plan import CampaignPlan
from studies.flight import closed_loop, job, mission, own_parts, samples, sensor_faults
from studies.flight.closed_loop import RefusedError
from studies.flight.job import Outcome, fly_job, score, sources
from studies.flight.kept_row import kept_row
from studies.flight.result import FlightResult


def code() -> str:
    """Digest of everything but the packages that decides how a flight of a plan goes."""
    shells = (keys, plan, values, closed_loop, own_parts, sensor_faults, job, mission, samples)
    return sources(*shells)


def row_key(plan_digest: str, number: int, code_digest: str) -> str:
    """Under which a journal keeps the row of a flight of a plan that a state of the code flew."""
    text = f"{plan_digest} {number} {code_digest}"
    return hashlib.sha256(text.encode()).hexdigest()[:32]


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignRow:
    """One flight: what was flown, and what became of it.

    Fields without comparison are of the machine; all others are the same wherever it is flown.
    """

    flight: int
    scenario: str
    suite: str
    controller: str
    fault: str  # its name; empty: none
    seed: int
    values: dict[str, float]  # of the varied keys, in the file's units
    completed: bool = False  # to its end, without violation
    reason: str = ""  # how it ended, in a sentence; why it could not be flown if ``error``
    error: bool = False  # the flight itself broke, not the vehicle
    refused: bool = False  # the vehicle refused to arm or to follow: nothing was flown
    duration_s: float = 0.0
    margin_m: float | None = None  # least, to the safe set with its clearance, of any part
    margin_of: str | None = None  # zone and part
    margin_time_s: float | None = None
    te_m: float | None = None  # RMS
    te_max_m: float | None = None
    contact: bool = False  # with a wall or the ground
    limits_kept: bool = True
    angle_margin_deg: float | None = None  # least, of a joint, of several coupled, or the tilt
    angle_margin_of: str | None = None
    cs_mean: float = 0.0
    ce_mean: float = 0.0
    plans: int = 0
    failures: int = 0  # planning steps without a plan
    modes: str = ""  # that the vehicle changed to by itself, in their order
    took_s: float = field(default=0.0, compare=False)  # processor time
    tc_p50_us: float = field(default=0.0, compare=False)
    tc_p99_us: float = field(default=0.0, compare=False)

    @property
    def violated(self) -> bool:
        """Whether the safe set was left or something was touched.

        False as well of a flight that was not flown: see ``error`` and ``refused``.
        """
        return self.contact or self.beyond

    @property
    def beyond(self) -> bool:
        """Whether the margin is below 0; a margin that is no number is."""
        return self.margin_m is not None and not self.margin_m >= 0.0

    def compared(self) -> dict[str, Any]:
        """The fields that are the same wherever the flight is flown."""
        line = asdict(self)
        return {one.name: line[one.name] for one in fields(self) if one.compare}


def row_of(plan: CampaignPlan, line: Mapping[str, Any]) -> CampaignRow:
    """The row of a flight of a plan that a line of a journal holds, without its key.

    Raises:
        TypeError: It holds none: see :func:`kept_row`; or its values are not of what is varied.
    """
    row = kept_row(CampaignRow, line)
    if row.values.keys() != {one.key for one in plan.varied}:
        raise TypeError(f"values are of {', '.join(row.values)}, which is not what is varied")
    if not all(map(math.isfinite, row.values.values())):
        raise TypeError("a value is not finite")
    return row


@dataclass(frozen=True, slots=True)
class CampaignFlight:
    """Flight ``number`` of a plan; see :class:`studies.campaign.ports.Flight`."""

    plan: CampaignPlan
    number: int

    def key(self) -> str:
        """See :class:`studies.campaign.ports.Flight`."""
        return row_key(self.plan.digest, self.number, code())

    def row(self) -> CampaignRow:
        """See :class:`studies.campaign.ports.Flight`."""
        row, _ = self.flown()
        return row

    def flown(self, *, traced: bool = False) -> tuple[CampaignRow, FlightResult | None]:
        """The row and all that the flight left; None if nothing was flown to its end."""
        began_s = time.thread_time()
        try:
            planned = self.plan.flight(self.number).job
            result = fly_job(planned, traced=traced)
            found = score(planned, result)
        except RefusedError as error:
            return self._row(reason=f"refused: {error}", refused=True), None
        except Exception as error:
            return self.broken(f"{type(error).__name__}: {error}"), None
        truth = result.truth
        row = self._row(
            **_same(found),
            margin_of=truth.min_margin_key,
            margin_time_s=truth.min_margin_time_s,
            te_max_m=truth.tracking_error_max_m,
            took_s=time.thread_time() - began_s,
        )
        return row, result

    def broken(self, reason: str) -> CampaignRow:
        """See :class:`studies.campaign.ports.Flight`."""
        return self._row(reason=reason, error=True)

    def from_line(self, line: Mapping[str, Any]) -> CampaignRow:
        """See :class:`studies.campaign.ports.Flight`."""
        row = row_of(self.plan, line)
        if row.flight != self.number:  # or the directory would never have a row of this flight
            raise TypeError(f"flight = {row.flight} under the key of flight {self.number}")
        return row

    def _row(self, **more: Any) -> CampaignRow:
        flight = self.plan.draw(self.number)
        return CampaignRow(
            flight=self.number,
            scenario=flight.case.scenario,
            suite=flight.case.suite,
            controller=flight.case.controller,
            fault=flight.case.fault,
            seed=flight.seed,
            values=dict(flight.values),
            **more,
        )


class CampaignFlights(Sequence[CampaignFlight]):
    """The first ``count`` flights of a plan, each made when it is asked for."""

    def __init__(self, plan: CampaignPlan, count: int) -> None:
        self._plan = plan
        self._count = count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, number: Any) -> Any:
        if isinstance(number, slice):
            return [self[i] for i in range(*number.indices(self._count))]
        if not 0 <= number < self._count:
            raise IndexError(number)
        return CampaignFlight(self._plan, number)

    def __iter__(self) -> Iterator[CampaignFlight]:
        return (CampaignFlight(self._plan, number) for number in range(self._count))


def _same(found: Outcome) -> dict[str, Any]:
    """What a row takes over from the outcome of its job."""
    mine = {one.name for one in fields(CampaignRow)} - {"seed", "took_s"}
    return {one.name: getattr(found, one.name) for one in fields(found) if one.name in mine}
