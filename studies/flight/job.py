"""One flight of a campaign: what to fly, and the flat row it leaves."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, Final, Literal

import numpy as np

import fsw
import sitl
from fsw.autopilot.parameters.flight_config import FlightConfig
from sitl.result import TruthResult
from sitl.scenario import EncoderErrors, ImuErrors, PoseErrors, Scenario, identity
from sitl.sensors.keys import MeasuredSensors
from studies.flight import (
    closed_loop,
    double_integrator,
    mission,
    own_parts,
    samples,
    sensor_faults,
)
from studies.flight.kept_row import kept_row
from studies.flight.result import FlightResult
from studies.flight.sensor_faults import Fault

PlantName = Literal["double-integrator", "full"]
# What a configuration calls the inner loop that ``--tracking`` names.
INNER: Final[dict[str, Literal["tracking", "pid"]]] = {"lqr": "tracking", "pid": "pid"}


@dataclass(frozen=True, slots=True)
class Job:
    """Everything a flight depends on; equal jobs fly equal flights."""

    plant: PlantName
    scenario: Scenario
    config: FlightConfig
    seed: int
    fault: Fault | None = None  # of a sensor; of the full plant only

    @property
    def random(self) -> bool:
        """Whether the seed changes anything: calm air and exact sensors draw no number.

        Nor does a fault, unless it is one of chance.
        """
        sensors = self.scenario.sensors
        if self.fault is not None:
            return True  # the seed chooses when
        if isinstance(sensors, MeasuredSensors):
            return True
        punctual = (
            replace(sensors.imu, latency_ms=0.0),
            replace(sensors.pose, latency_ms=0.0),
            replace(sensors.encoders, latency_ms=0.0),
        )
        noisy = punctual != (ImuErrors(), PoseErrors(), EncoderErrors())
        gusts = self.scenario.air.turbulence_m_s > 0.0
        return (
            noisy
            or gusts
            or any(one.random for one in self.scenario.faults)
            or any(it.kind not in ("wind", "sequence") for it in self.scenario.disturbances)
        )

    def key(self) -> str:
        """Name of the flight: same flight, same name, in any process, while the code is the same.

        Seeds that change nothing are left out, so that calm air is flown once.
        """
        distinct = self if self.random else replace(self, seed=0)
        scenario, vehicle = identity(self.scenario)
        text = repr((replace(distinct, scenario=scenario), vehicle)) + sources()
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def row(self) -> Outcome:
        """See :class:`studies.campaign.ports.Flight`."""
        began_s = time.thread_time()
        try:
            return replace(score(self, fly_job(self)), took_s=time.thread_time() - began_s)
        except Exception as error:
            return self.broken(f"{type(error).__name__}: {error}")

    def broken(self, reason: str) -> Outcome:
        """See :class:`studies.campaign.ports.Flight`."""
        return Outcome(self.seed, completed=False, reason=reason, error=True)

    def from_line(self, line: Mapping[str, Any]) -> Outcome:
        """See :class:`studies.campaign.ports.Flight`."""
        return kept_row(Outcome, line)


@dataclass(frozen=True, slots=True)
class Outcome:
    """The flat result of one flight; also of one that failed with an error."""

    seed: int
    completed: bool
    reason: str
    duration_s: float = 0.0
    te_m: float | None = None
    margin_m: float | None = None
    limits_kept: bool = True
    angle_margin_deg: float | None = None  # least, to a limit; None on a plant without limits
    angle_margin_of: str | None = None  # which: of a joint, of several coupled, or the tilt
    cs_sum: float = 0.0
    cs_mean: float = 0.0
    ce_sum: float = 0.0
    ce_mean: float = 0.0
    tc_p50_us: float = 0.0
    tc_p99_us: float = 0.0
    plans: int = 0
    failures: int = 0  # planning steps without a plan
    contact: bool = False  # with a wall or the ground
    modes: str = ""  # that the vehicle changed to by itself, in their order
    reported: str = ""  # the text that names the sensor at fault; empty if there was none
    error: bool = False  # the flight itself broke, not the vehicle
    took_s: float = field(default=0.0, compare=False)  # processor time


def fly_job(job: Job, *, traced: bool = False) -> FlightResult:
    """Fly one job here and now."""
    if job.plant == "double-integrator":
        return double_integrator.simulate(job.scenario, job.seed, job.config, traced=traced)
    return closed_loop.simulate(job.scenario, job.seed, job.config, fault=job.fault, traced=traced)


def score(job: Job, result: FlightResult) -> Outcome:
    """The row of a flight."""
    fault = job.fault
    truth, planner = result.truth, result.planner
    steps, totals = np.array(planner.step_us or (0.0,)), planner.metrics.as_json()
    angle, room = _nearest_angle(truth)
    smoothness, effort = totals["control_smoothness"], totals["control_effort"]
    return Outcome(
        seed=job.seed,
        completed=truth.completed,
        reason=truth.end_reason,
        duration_s=truth.duration_s,
        te_m=truth.tracking_error_rms_m,
        margin_m=truth.min_margin_m,
        limits_kept=all(use.kept for use in truth.limits.values()),
        angle_margin_deg=room,
        angle_margin_of=angle,
        cs_sum=smoothness["sum"],
        cs_mean=smoothness["mean"],
        ce_sum=effort["sum"],
        ce_mean=effort["mean"],
        tc_p50_us=float(np.median(steps)),
        tc_p99_us=float(np.quantile(steps, 0.99)),
        plans=planner.plans,
        failures=planner.failures,
        contact=result.contact,
        modes=", ".join(planner.modes),
        reported="" if fault is None else fault.reported(planner.texts, job.seed),
    )


def _nearest_angle(truth: TruthResult) -> tuple[str | None, float | None]:
    """The angle that came nearest to its limit, and how near [deg]; negative: beyond."""
    left = {key: use.most - use.largest for key, use in truth.limits.items() if use.unit == "rad"}
    if not left:
        return None, None
    nearest = min(left, key=left.__getitem__)
    return nearest, math.degrees(left[nearest])


@cache
def sources(*shells: ModuleType) -> str:
    """Digest of the code that decides how a flight goes: the stack, and what flies it."""
    folders = [Path(str(package.__file__)).parent for package in (fsw, sitl)]
    files = [path for folder in folders for path in sorted(folder.rglob("*.py"))]
    files += [Path(str(shell.__file__)) for shell in shells or _SHELLS]
    digest = hashlib.sha256()
    for path in files:
        digest.update(path.read_bytes())
    return digest.hexdigest()


_SHELLS: Final = (closed_loop, double_integrator, sensor_faults, mission, samples, own_parts)
