"""The estimate from frames of exact states; what is not believed is carried on from the last one.

Nothing is filtered (docs/decisions/0006-estimate-without-filter.md). On the ground every whole
frame is taken as it is: vehicles are carried about.
"""

from __future__ import annotations

from functools import partial

from fsw.control.cascade import Cascade
from fsw.estimation.dead_reckoning import moved_on
from fsw.estimation.estimator import estimate_state
from fsw.estimation.frame_trust import FrameTrust, believed
from fsw.estimation.sensor_fault import Sensor
from fsw.flight.jump import returned
from fsw.flight.state import AIDED, Aiding, FlightState, LostSensor
from fsw.frozen import replace
from fsw.signals import Severity, StateEstimate, StatusText, TickInputs


class ExactState:
    """Exact states as the tick of one configuration uses them."""

    def __init__(self, cascade: Cascade) -> None:
        self._cascade = cascade

    def warm_up(self, estimate: StateEstimate, inputs: TickInputs) -> None:
        """Compile every kernel."""
        trust, sensors = FrameTrust(), inputs.sensors
        for k in range(2):  # a second frame is compared with the first
            sensors = replace(sensors, t_us=sensors.t_us + 2_000 * k)
            trust, _ = believed(trust, sensors, estimate, lambda: (0.0, 0.0))

    def estimate(
        self, state: FlightState, inputs: TickInputs, texts: list[StatusText]
    ) -> tuple[FlightState, FrameTrust, StateEstimate | None]:
        """The estimate of this tick, or the last one while there is none; appends to ``texts``.

        What is believed from now on is not in the state yet, but beside it: to put it there would
        take as long as all of this.
        """
        sensors, before, trust = inputs.sensors, state.estimate, state.trust
        if before is not None and state.vehicle.flies and not inputs.stale_us:
            return self._in_flight(state, before, inputs, texts)
        if before is not None and trust.doubted and state.vehicle.flies:
            moved = moved_on(before, 1e-6 * (sensors.t_us - before.t_us))
            return state, trust, moved._replace(t_us=sensors.t_us)
        valid = estimate_state(sensors)
        if valid is None:
            # Telemetry goes by its time, and goes on.
            last = None if before is None else before._replace(t_us=sensors.t_us)
            return replace(state, invalid_ticks=state.invalid_ticks + 1), trust, last
        if inputs.stale_us:
            valid = moved_on(valid, 1e-6 * inputs.stale_us)
        elif trust.last is not None:
            trust = FrameTrust()
            state = replace(state, aiding=AIDED)
        return (replace(state, invalid_ticks=0) if state.invalid_ticks else state), trust, valid

    def _in_flight(
        self,
        state: FlightState,
        before: StateEstimate,
        inputs: TickInputs,
        texts: list[StatusText],
    ) -> tuple[FlightState, FrameTrust, StateEstimate]:
        joints = partial(self._cascade.joint_acceleration, state.cascade, before)
        trust, found = believed(state.trust, inputs.sensors, before, joints)
        aiding = AIDED
        if trust.doubted:
            aiding = _aiding(trust, found.t_us)
            trust, sentences = trust.reported(found.t_us)
            texts.extend(StatusText(Severity.WARNING, text) for text in sentences)
        if trust.returned_us:
            state = returned(state, found, before, texts)
        if aiding is not state.aiding or state.invalid_ticks:
            state = replace(state, aiding=aiding, trust=trust, invalid_ticks=0)
        return state, trust, found


def _aiding(trust: FrameTrust, now_us: int) -> Aiding:
    """What is missing, as failsafes look at it."""
    lost = [(name, part) for name, part in trust.faults() if name is not Sensor.POSE]
    pose = trust.pose
    return Aiding(
        unaided_us=now_us - pose.since_us if pose.unused else 0,
        pose=Sensor.POSE,
        pose_fault=pose.fault,
        position_sigma=trust.position_sigma(now_us),
        velocity_sigma=trust.velocity_sigma(now_us),
        attitude_sigma=trust.attitude_sigma(now_us),
        height_sigma=trust.position_sigma(now_us),
        lost=tuple([LostSensor(name, part.fault, part.since_us) for name, part in lost]),
    )
