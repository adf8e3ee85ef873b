"""What one flight of a study leaves behind."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from fsw.autopilot.control.control_metrics import ControlMetrics
from fsw.autopilot.signals import Plan, PlanFailure
from sitl.result import EndKind, EndReason, TruthResult
from sitl.scenario import V3

TRACE_STEPS = 20  # 40 ms between points of a trace


def processor_time_us() -> float:
    """Times planning steps: a campaign shares its cores, and that must not show [us]."""
    return time.thread_time() * 1e6


def touched(end: EndReason | None) -> bool:
    """Whether a flight ended at a wall or on the ground."""
    return end is not None and end.kind in (EndKind.COLLISION, EndKind.CRASH)


@dataclass(frozen=True, slots=True)
class TracePoint:
    """The truth at one instant, for figures."""

    t_s: float
    p_WB: V3  # m, NED
    p_WE: V3  # m, NED, end-effector
    p_target: V3  # m, NED, its reference
    margin_m: float  # the smallest; infinite without constraints


@dataclass(slots=True)
class FlightRecorder:
    """What the planner does in a flight."""

    metrics: ControlMetrics = field(default_factory=ControlMetrics)
    step_us: list[float] = field(default_factory=list)  # processor time of each planning step
    plans: int = 0
    failures: int = 0  # planning steps without a plan
    failed_ids: list[int] = field(default_factory=list)  # of the requests without a plan
    trace: list[TracePoint] = field(default_factory=list)  # empty unless asked for
    texts: list[tuple[float, str]] = field(default_factory=list)  # s, what an operator reads
    modes: list[str] = field(default_factory=list)  # that the vehicle changed to by itself
    overridden_s: float = 0.0  # for which our autopilot flew in place of an own controller

    def planned(self, answer: Plan | PlanFailure) -> None:
        """Account for one planning step."""
        self.step_us.append(answer.timings.total_us)
        if isinstance(answer, Plan):
            self.plans += 1
        else:
            self.failures += 1
            self.failed_ids.append(answer.plan_id)


@dataclass(frozen=True, slots=True)
class FlightResult:
    """Score of one flight from the plant's truth, and what the planner did."""

    truth: TruthResult
    planner: FlightRecorder
    contact: bool  # with a wall or the ground
