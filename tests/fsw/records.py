"""Records for tests: made of tuples, changed by name."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from fsw.autopilot.control import tracking
from fsw.autopilot.control.gains import TrackingTuning
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.signals import PlanInput, PredictionState, StateEstimate, Vec3
from fsw.autopilot.tick_record import Observed, Tick
from fsw.record import Record

Kind = TypeVar("Kind", bound=Record)


def changed(record: Kind, **fields: Any) -> Kind:
    """A copy with other fields; an array's entries that are not given are zero."""
    after = record.copy()
    for name, value in fields.items():
        now = getattr(after, name)
        if isinstance(now, np.ndarray):
            now[:] = 0.0
            now[: len(value)] = value
        else:
            setattr(after, name, value)
    return after


def with_given(before: Tick, estimate: StateEstimate, plan: PredictionState, u: PlanInput) -> Tick:
    """The record of a tick that is given these, before the loops are closed."""
    r = before.copy()
    r.known, r.nominal, r.input = estimate, plan, u
    return r


def with_record(state: FlightState, **fields: Any) -> FlightState:
    """A state whose record has other fields, the estimate as ``known``."""
    return replace(state, cascade=changed(state.cascade, **fields))


def observed(v: Vec3, d: Vec3, recent: float = 1.0) -> Observed:
    """An observer that believes in ``v`` [m/s] and ``d`` [m/s^2]."""
    return changed(Observed(), v=v, d=d, recent=recent)


def observe(before: Observed, v: Vec3, a: Vec3, tuning: TrackingTuning, dt: float) -> Observed:
    """What it believes a tick of ``dt`` [s] later."""
    after = before.copy()
    tracking.observe(after, v, a, tuning, dt)
    return after
