"""MAV_CMD_INJECT_FAILURE: the numbers of units and failures as faults of the simulation."""

from __future__ import annotations

from typing import Final, NamedTuple

from messages.message_ids import ACCEPTED, DENIED, UNSUPPORTED
from sitl.faults.keys import Fault, Kind, Unit, absence, instances
from sitl.scenario import Scenario
from sitl.scenario_validation import units_aboard
from sitl.simulation import Simulation
from sitl.zones import zones_of

# FAILURE_UNIT; the joints are its servos. It has no number for the encoders.
_UNITS: Final[dict[int, Unit]] = {
    0: "gyro",
    1: "accel",
    2: "mag",
    3: "baro",
    4: "gps",
    5: "optical flow",
    6: "vio",
    7: "distance",
    100: "battery",
    101: "motor",
    102: "joint",
    105: "mavlink",
}
# FAILURE_TYPE; 0 ends a failure.
_KINDS: Final[dict[int, Kind]] = {
    1: "off",
    2: "stuck",
    3: "garbage",
    4: "wrong",
    5: "slow",
    6: "delayed",
    7: "intermittent",
}
_WORKS: Final = 0
_AGAIN_S: Final = 3.0  # for which the same words, sent again, are the same command
_NO_PILOT: Final = (
    "no fault: mavlink is the link of the scenario's pilot, and this scenario has none"
)


class Injection(NamedTuple):
    """What somebody asks to fail, or to work again."""

    unit: int  # FAILURE_UNIT
    kind: int  # FAILURE_TYPE
    instance: int  # from 1; 0: all
    system: int  # who asked
    component: int
    confirmation: int = 0  # how often it was asked before


class Answer(NamedTuple):
    """What became of it."""

    result: int  # MAV_RESULT
    sentence: str


class Injector:
    """Carries out what is asked for, once: an answer that got lost is asked for again."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._last: tuple[Injection, Answer, float] | None = None

    def answer(self, asked: Injection) -> Answer:
        """What becomes of it, or became of it when it was asked for first."""
        first, now_s = asked._replace(confirmation=0), self._simulation.time_s
        if asked.confirmation and self._last is not None:
            last, answer, at_s = self._last
            if last == first and now_s - at_s <= _AGAIN_S:
                return answer
        answer = carry_out(self._simulation, asked)
        self._last = first, answer, now_s
        return answer


def carry_out(simulation: Simulation, asked: Injection) -> Answer:
    """Begin or end a fault from the next step on."""
    unit = _UNITS.get(asked.unit)
    if unit is None:
        return Answer(UNSUPPORTED, f"no fault: the vehicle has no unit {asked.unit}")
    # First of all: what is not there does not work either.
    missing = absence(unit, units_aboard(simulation.scenario))
    if missing is not None:
        return Answer(UNSUPPORTED, f"no fault: {missing}")
    if unit == "mavlink" and not _has_pilot(simulation.scenario):
        return Answer(UNSUPPORTED, _NO_PILOT)
    most = instances(unit, simulation.vehicle)
    if asked.instance > max(most, 1):
        return Answer(DENIED, f"no fault: {unit} {asked.instance} is not one of {max(most, 1)}")
    number = asked.instance if most > 1 else 0
    if asked.kind == _WORKS:
        ended = simulation.faults.clear(unit, number, simulation.step + 1)
        which = f"{unit} {number}" if number else unit
        lasting = [one for one in simulation.faults.active if one.unit == unit]
        if not ended and lasting:
            other = lasting[0]
            return Answer(DENIED, f"no fault of {which} alone to end: what lasts is {other}")
        if not ended:
            return Answer(ACCEPTED, f"{which} works: there was no fault to end")
        return Answer(ACCEPTED, f"fault ended: {', '.join(str(one) for one in ended)}")
    kind = _KINDS.get(asked.kind)
    if kind is None:
        return Answer(UNSUPPORTED, f"no fault: kind {asked.kind} is not one of 0 to 7")
    fault = Fault(unit, kind, instance=float(number))
    refusal = simulation.inject(fault)
    if refusal is not None:
        return Answer(UNSUPPORTED, f"no fault: {refusal}")
    return Answer(ACCEPTED, f"fault injected: {fault}")


def _has_pilot(scenario: Scenario) -> bool:
    """Whether a pilot says anything: commands, targets, or the safe set alone."""
    return scenario.pilot.plan != "none" or bool(zones_of(scenario))
