"""Ticks in which nothing but sensors has to be looked at: one compiled call (``fast_loop.py``).

Between two events most ticks believe the sensors, move the plan's state on, close the loops and
watch the actuators. No command comes, no limit is met, no failsafe acts. What happens all the same
the record says by its flags: then the tick is flown whole, from the record before it. Either way
gives the same state to the last bit.

Of a suite of sensors, what is measured beside inertial unit and encoders waits for
``Autopilot.conclude``, and the watch with it.

Source: docs/decisions/0037-quiet-ticks.md.
"""

from __future__ import annotations

from collections.abc import Callable

from fsw.autopilot.estimation.estimator import reading_of
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.flight.estimate.sensed_state import SensedState
from fsw.autopilot.flight.failsafe.evidence import PLAN_STALE_PERIODS
from fsw.autopilot.flight.failsafe.table import SLOW_US, active_between
from fsw.autopilot.flight.fast_loop import BELIEVED, FastLoop
from fsw.autopilot.flight.plan_exchange import planned_input
from fsw.autopilot.flight.safety.damage_watch import DamageWatch
from fsw.autopilot.flight.safety.safety_watch import SafetyWatch
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import AIDED, FlightState, first_state
from fsw.autopilot.measurements import RangeSample, Sample
from fsw.autopilot.model.actuator_health import HEALTHY
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.shapes.zones import NO_ZONES
from fsw.autopilot.signals import Mode, TickInputs
from fsw.autopilot.tick_record import IMPAIRED, LIGHT, Tick
from fsw.frozen import replace
from fsw.record import Floats


class CalmTick:
    """The calm ticks of one configuration."""

    def __init__(
        self,
        config: FlightConfig,
        fast: FastLoop,
        damage: DamageWatch,
        watch: SafetyWatch,
        sensed: SensedState,
        zones_now: Callable[[FlightState], Floats],
    ) -> None:
        """Of the laws that whole ticks of this configuration have."""
        self._config, self._tick_us = config, config.tick_period_us
        self._is_above_px4 = config.is_above_px4
        self._per_plan = config.ticks_per_plan
        self._fast, self._damage = fast, damage
        self._watch, self._sensed, self._zones_now = watch, sensed, zones_now
        # What was found out about the newest state; another one is looked at anew.
        self._state = first_state(config.airframe)
        self._until_us, self._zones, self._tube = -1, NO_ZONES, watch.tube(self._state)

    def fly(
        self, state: FlightState, inputs: TickInputs
    ) -> tuple[Tick, FusionMemory | None] | None:
        """The record after a calm tick; None: the tick is to be flown whole.

        Of a suite also what its filter has made of inertial unit and encoders.
        """
        frame, before = inputs.sensors, state.record
        now_us = frame.t_us
        next_one = now_us == state.t_us + self._tick_us
        if not (next_one and self.ticks(state) and inputs.has_only_sensors):
            return None
        if state.fusion is None:
            if inputs.samples:
                return None
            exact = self.step(before, reading_of(frame), now_us)
            return None if exact is None else (exact, None)
        if self._is_above_px4 or any(map(_is_range, inputs.samples)):
            return None  # the land detector looks at a range
        r = before.copy()
        run = self._fast.calm(r, self._watch.upright, self._zones, self._tube)
        fusion, found = self._sensed.take_in_by(state, inputs, run)
        return (r, fusion) if found & BELIEVED and not r.flags else None

    def ticks(self, state: FlightState) -> int:
        """How many ticks after a state may be calm, if nothing but sensors comes."""
        if state is not self._state:
            self._look_at(state)
        return max((self._until_us - state.t_us) // self._tick_us, 0)

    def step(self, before: Tick, reading: Floats, now_us: int) -> Tick | None:
        """The record after a tick that may be calm, with a ``reading`` (READINGS,) [SI].

        None: it is not. Of the state that was looked at last, or a calm tick after it.
        """
        r, upright = before.copy(), self._watch.upright
        if not self._fast.exact(r, reading, now_us, upright, self._zones, self._tube):
            return None
        return None if r.flags or self._damage.finds(before, r) else r

    def after(
        self, state: FlightState, r: Tick, fusion: FusionMemory | None = None, ticks: int = 1
    ) -> FlightState:
        """The state after calm ``ticks``, with the record that they have left: calm as before."""
        index, t_us = state.index + ticks, state.t_us + ticks * self._tick_us
        self._state = replace(state, index=index, t_us=t_us, record=r, fusion=fusion)
        return self._state

    def _look_at(self, state: FlightState) -> None:
        """Find out until when a state is calm."""
        self._state, self._until_us = state, -1
        if not _is_calm(state, self._config):
            return
        running, now_us = state.plan.running, state.t_us
        assert running is not None
        u = planned_input(running, now_us)
        if u is None or u is not planned_input(running, now_us + self._tick_us):
            return  # a tick is flown with two inputs
        self._zones, self._tube = self._zones_now(state), self._watch.tube(state)
        self._until_us = self._end_us(state) - 1

    def _end_us(self, state: FlightState) -> int:
        """Before when no clock, plan or planning period ends."""
        plan, now_us, running = state.plan, state.t_us, state.plan.running
        assert running is not None
        step = (now_us + self._tick_us - running.t_us) // running.period_us
        ends_us = [
            (now_us // SLOW_US + 1) * SLOW_US,
            now_us + (self._per_plan - state.index % self._per_plan) * self._tick_us,
            running.t_us + (step + 1) * running.period_us,
            plan.since_us + PLAN_STALE_PERIODS * self._config.planner.period_us + 1,
            state.mission.stream[-1].t_us + 1,
        ]
        if plan.awaited_id >= 0:
            ends_us.append(plan.awaited_us)
        return min(ends_us)


def _is_range(sample: Sample) -> bool:
    return type(sample) is RangeSample


def _is_calm(state: FlightState, config: FlightConfig) -> bool:
    """Whether nothing goes on that a calm tick does not know of."""
    vehicle, plan, r = state.vehicle, state.plan, state.record
    estimate = r.state_estimate
    return (
        vehicle.mode is Mode.TRAJECTORY
        and vehicle.flies
        and not vehicle.restarts
        and vehicle.unloaded is None
        and vehicle.home is not None
        and bool(r.has_plan)
        and estimate is not None
        and estimate.t_us == state.t_us
        and state.index >= 0
        and state.invalid_ticks == 0
        and (state.fusion is not None or state.aiding is AIDED)
        and not (state.damage.rotor or state.damage.joint)
        and state.damage.health is HEALTHY
        and not r.flags & (IMPAIRED | LIGHT)
        and bool(config.limits.watches_actuators)
        and bool(state.mission.stream)
        and plan.running is not None
        and state.t_us >= plan.since_us
        and not (vehicle.conditions or state.safety.is_open or state.aiding.lost)
        and not active_between(Situation(state, estimate, config))
    )
