"""Stretches of a flight with everything that flies: planner, safety filter, replanning, failsafe.

A hundred times the cost of ``tracked_flight``. The calm flight is flown once; at each instant of
interest the process forks for every stretch, so that a stretch begins with the exact state of
simulator, tick and planner and leaves the calm flight as it is.
"""

from __future__ import annotations

import math
import os
import pickle
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import Mode, PredictionState, TickOutputs
from sitl.disturbances.sequence import Steered
from sitl.result import EndKind
from sitl.scenario import V3, Scenario
from sitl.simulation import STEP_US, Simulation, Truth
from studies.flight.closed_loop import ClosedLoop, InlinePlanner
from studies.flight.own_parts import planner_of
from studies.search.surfaces import Met, met_by
from studies.search.tracked_flight import Disturbance

_GRAVITY = np.array([0.0, 0.0, 9.81])  # m/s², NED


@dataclass(frozen=True, slots=True)
class Flown:
    """One stretch of the whole stack, judged."""

    off_m: V3  # largest deviation of each axis from the plan in force
    margin_m: float  # smallest to the safe set, infinite without one
    contact: str | None  # what the referee said, if a part touched anything or the flight diverged
    departures: int  # from the tube, after which it planned anew
    breaches: int  # of the safe set that it noticed
    pushes: tuple[V3, ...]  # m/s², one a tick
    force_share: float = 0.0  # largest normal force on the tool over what its surface allows [1]
    told: tuple[str, ...] = ()  # what the vehicle said
    left: bool = False  # the trajectory, for what a failsafe does


class WholeFlight:
    """The calm flight, and stretches that begin where it is now."""

    def __init__(self, scenario: Scenario, config: FlightConfig) -> None:
        self._push = Steered()
        calm = replace(scenario, disturbances=())
        self._simulation = Simulation(calm, 0, (self._push,))
        planner, tick = InlinePlanner(planner_of(config)), Autopilot(config).tick
        self._loop = ClosedLoop(self._simulation, tick, planner, config.airframe)

    def go_to(self, step: int, report: Callable[[float, float], None]) -> None:
        """Fly on, calm, up to a step of the simulation; ``report`` receives seconds."""
        while self._simulation.step < step and self._simulation.ended is None:
            self._step()
            if self._simulation.step % 500 == 0:
                report(self._simulation.time_s, step * STEP_US * 1e-6)

    def stretch(self, ticks: int, disturbance: Disturbance) -> Flown:
        """Fly ``ticks`` from here under a disturbance, in a process of its own."""
        flown = _in_a_fork(lambda: self._disturbed(ticks, disturbance))
        assert isinstance(flown, Flown)
        return flown

    def _step(self, before_advancing: Callable[[TickOutputs], None] | None = None) -> TickOutputs:
        loop = self._loop
        return loop.step(loop.inputs(*loop.observe()), before_advancing)

    def _disturbed(self, ticks: int, disturbance: Disturbance) -> Flown:
        simulation = self._simulation
        worst, least = np.zeros(3), math.inf
        pushes: list[V3] = []
        told: list[str] = []
        arrived: V3 | None = None
        if disturbance.met is not None:
            self._meet(disturbance.met)

        def steer(outputs: TickOutputs) -> None:
            plan, truth = outputs.snapshot.plan_state, simulation.truth()
            if plan is not None and arrived is not None:
                np.maximum(worst, np.abs(np.subtract(arrived, plan.p)), out=worst)
            if len(pushes) % disturbance.every == 0 and plan is not None:
                self._push.value = _value(disturbance, len(pushes), truth, plan, simulation)
            pushes.append(self._push.value)

        outputs = None
        while len(pushes) < ticks and simulation.ended is None:
            outputs = self._step(steer)
            truth = simulation.truth()
            arrived = truth.p_WB
            told += [text.text for text in outputs.texts]
            if outputs.mode is not Mode.TRAJECTORY:
                simulation.leave_trajectory(simulation.t_us, "a failsafe took over")
            least = min(least, *truth.margins_m, math.inf)
        ended, safety = simulation.ended, self._loop.state.safety
        contact = ended is not None and ended.kind is not EndKind.DURATION
        return Flown(
            off_m=(float(worst[0]), float(worst[1]), float(worst[2])),
            margin_m=least,
            contact=ended.sentence if contact and ended is not None else None,
            departures=safety.counters.departures,
            breaches=safety.counters.breaches,
            pushes=tuple(pushes),
            force_share=simulation.touch.force_share(),
            told=tuple(told),
            left=outputs is not None and outputs.mode is not Mode.TRAJECTORY,
        )

    def _meet(self, met: Met) -> None:
        simulation = self._simulation
        simulation.meet(met_by(simulation.scenario, met, simulation.time_s))
        for fault in met.faults:
            refusal = simulation.inject(fault)
            if refusal is not None:
                raise ValueError(refusal)


def _value(
    disturbance: Disturbance, tick: int, truth: Truth, plan: PredictionState, simulation: Simulation
) -> V3:
    """The push [m/s², NED] of a tick: the table's, or what the adversary makes of the truth."""
    amplitude, table = disturbance.amplitude, disturbance.table
    if len(table):
        row = amplitude * table[min(tick // disturbance.every, len(table) - 1)]
        return float(row[0]), float(row[1]), float(row[2])
    w, x, y, z = truth.q_WB
    upright = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    a = _GRAVITY - sum(truth.thrust) / simulation.vehicle.mass * upright
    off: Array = np.array(
        [
            np.subtract(truth.p_WB, plan.p),
            np.subtract(truth.v_WB, plan.v),
            a - np.array(plan.a),
        ]
    )
    chased = (disturbance.weights * off.T).sum(axis=1)
    acting = disturbance.weights.any(axis=1)
    row = amplitude * np.where(acting, np.where(chased >= 0.0, 1.0, -1.0), 0.0)
    return float(row[0]), float(row[1]), float(row[2])


def _in_a_fork(work: Callable[[], Any]) -> Any:
    """What ``work`` returns in a copy of this process, which ends with it."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            with os.fdopen(writing, "wb") as out:
                pickle.dump(work(), out)
            status = 0
        except BaseException:  # the child must not run on into the caller's code
            traceback.print_exc()
        finally:
            os._exit(status)
    os.close(writing)
    with os.fdopen(reading, "rb") as back:
        data = back.read()
    _, status = os.waitpid(child, 0)
    if status != 0:
        raise RuntimeError("a stretch of the whole stack failed in its process")
    return pickle.loads(data)
