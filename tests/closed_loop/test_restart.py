"""A restart on command: what had failed is well again, if it is, and what the ground has stays."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from typing import Any

import pytest

from fsw.autopilot.flight.estimate.before_estimate import nowhere
from fsw.autopilot.flight.restart import restarted, rests
from fsw.autopilot.flight.state import (
    Aiding,
    FlightState,
    OffboardMemory,
    PlanMemory,
    SafetyMemory,
    VehicleMemory,
    first_state,
)
from fsw.autopilot.measurements import PoseSample, Sample
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import (
    CommandResult,
    MessageSource,
    Mode,
    PlannerCounters,
    SafeSet,
    SafeSetAnnouncement,
    SafetyCounters,
)
from sitl.scenario import Hold
from sitl.scenario_file import parse_scenario
from tests.closed_loop.harness import (
    ARM,
    BESIDE_A_WALL,
    TAKEOFF,
    Flight,
    command,
    hover,
    on_the_ground,
)

REBOOT, TERMINATE = 246, 185
ACCEPTED, DENIED = CommandResult.ACCEPTED, CommandResult.DENIED
LATER = CommandResult.TEMPORARILY_REJECTED
# Weak until the vehicle stands, where no rotor can show what it gives, and well again then.
SCENARIO = f"""{BESIDE_A_WALL}
[[faults]]
unit = "motor"
kind = "weak"
instance = 2
share = 0.7
start_s = 3.5
duration_s = 5.0
"""


UNAIDED = Aiding(unaided_us=400_000)


def results_of(flight: Flight, number: int) -> list[int]:
    return [result for asked, result in flight.results if asked == number]


def take_off(flight: Flight) -> None:
    flight.step(command(ARM, 1.0))
    flight.step(command(TAKEOFF))


@pytest.mark.long
@pytest.mark.requirement("REQ-MODE-12", "REQ-ACT-6")
@pytest.mark.parametrize("suite", ["perfect", "mocap"])
def test_what_had_failed_flies_again_after_a_restart_and_not_before(suite: str) -> None:
    flight = Flight(parse_scenario(SCENARIO, "restart", suite))
    flight.run(1.0)
    take_off(flight)
    flight.run(9.0)
    assert flight.modes[-2:] == [Mode.LAND, Mode.DISARMED], flight.texts
    flight.step(command(ARM, 1.0))
    assert results_of(flight, ARM)[-1] != ACCEPTED
    assert "rotor 2 (left)" in flight.texts[-1]
    safe_set, home = flight.state.mission.safe_set, flight.state.vehicle.home
    assert safe_set.zones

    flight.step(command(REBOOT, 1.0))
    assert flight.results[-1] == (REBOOT, ACCEPTED)
    assert flight.texts[-1] == "flight software restarted"
    before = flight.snapshot
    flight.step()
    # The estimator looks at where it is once more; what is counted is not forgotten meanwhile.
    shown = flight.snapshot
    assert before.counters.plans > 0
    assert (shown.counters, shown.safety) == (before.counters, before.safety)
    assert shown.mission == before.mission
    flight.run(1.0)
    assert flight.snapshot.actuators_found.rotor == 0
    assert flight.state.mission.safe_set is safe_set
    assert flight.snapshot.home is not None
    assert home is not None
    take_off(flight)
    flight.run(4.5)
    assert results_of(flight, ARM)[-1] == ACCEPTED, flight.texts[-3:]
    assert flight.mode is Mode.HOLD
    assert flight.sim.truth().p_WB[2] < -1.0
    assert flight.snapshot.failures == ()


def test_the_same_command_sent_again_is_no_second_restart() -> None:
    flight = Flight(parse_scenario(SCENARIO, "restart"))
    flight.run(0.5)
    flight.step(command(REBOOT, 1.0))
    flight.run(0.2)
    index = flight.state.index
    flight.step(command(REBOOT, 1.0, confirmation=1))
    flight.run(0.2)
    assert flight.state.index > index
    assert results_of(flight, REBOOT) == [ACCEPTED, ACCEPTED]
    assert flight.texts.count("flight software restarted") == 1


@pytest.mark.requirement("REQ-MODE-12")
def test_in_flight_it_is_denied_and_the_flight_goes_on() -> None:
    flight = Flight(hover())
    flight.step(command(ARM, 1.0))
    flight.run(0.5)
    flight.step(command(REBOOT, 1.0))
    assert flight.results[-1] == (REBOOT, DENIED)
    assert flight.texts[-1] == "not restarted: the vehicle is armed; disarm first"
    flight.run(0.5)
    assert flight.mode is Mode.HOLD
    for wish, result in ((0.0, ACCEPTED), (2.0, DENIED), (3.0, DENIED)):
        flight.step(command(REBOOT, wish))
        assert flight.results[-1] == (REBOOT, result), wish


@pytest.mark.requirement("REQ-MODE-7", "REQ-MODE-12")
def test_a_termination_is_over_after_a_restart_that_names_its_sender() -> None:
    flight = Flight(on_the_ground())
    flight.run(0.1)
    flight.step(command(ARM, 1.0))
    flight.step(command(TERMINATE, 1.0))
    flight.run(1.1)
    assert flight.mode is Mode.FAULT
    flight.step(command(REBOOT, 1.0))
    assert flight.texts[-1] == "flight software restarted by 255/190; the termination is over"
    flight.step()
    assert flight.mode is Mode.DISARMED


@pytest.mark.requirement("REQ-MODE-12")
@pytest.mark.parametrize("ended_by", [(TERMINATE, 1.0), (ARM, 0.0, 21196.0)])
def test_what_falls_is_not_restarted(ended_by: tuple[float, ...]) -> None:
    flight = Flight(replace(hover(), trajectory=Hold((0.0, 0.0, -12.0))))
    flight.step(command(ARM, 1.0))
    flight.run(0.1)
    number, *params = ended_by
    flight.step(command(int(number), *params))
    # At first it is slow, and later long without thrust.
    for _ in range(28):
        flight.step(command(REBOOT, 1.0))
        assert flight.results[-1] == (REBOOT, LATER)
        for _ in range(25):
            flight.step()
    assert flight.sim.truth().p_WB[2] < -1.0
    assert flight.texts[-1] == "not restarted: the vehicle must have been at rest for a second"


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-MODE-12")
@pytest.mark.parametrize("lost", ["all", "pose"])
def test_what_does_not_know_its_motion_is_restarted_when_it_must_have_come_down(lost: str) -> None:
    """It drifts in its estimate though it stands, and seems to stand though it falls."""
    silent = [False]

    def spoilt(samples: tuple[Sample, ...]) -> tuple[Sample, ...]:
        kept = () if lost == "all" else tuple(s for s in samples if not isinstance(s, PoseSample))
        return kept if silent[0] else samples

    flight = Flight(parse_scenario(SCENARIO, "restart", "mocap"), spoil_samples=spoilt)
    flight.run(1.0)
    take_off(flight)
    flight.run(0.1)
    silent[0] = True
    flight.run(0.1)
    flight.step(command(TERMINATE, 1.0))
    begun_us = flight.sim.t_us
    flight.run(1.1)
    while flight.results[-1] != (REBOOT, ACCEPTED) and flight.sim.t_us - begun_us < 12_000_000:
        flight.step(command(REBOOT, 1.0))
        flight.run(0.1)
    assert 10_000_000 <= flight.sim.t_us - begun_us < 10_300_000


@pytest.mark.requirement("REQ-MODE-12")
@pytest.mark.parametrize(
    ("known", "from_us"),
    [({}, 1_000_000), ({"invalid_ticks": 1}, 10_000_000), ({"aiding": UNAIDED}, 10_000_000)],
)
def test_an_estimate_that_is_not_to_be_relied_upon_says_nothing_of_rest(
    known: dict[str, Any], from_us: int
) -> None:
    begun_us = 5_000_000
    vehicle = VehicleMemory(mode=Mode.FAULT, mode_begin_us=begun_us)
    state = replace(first_state(AIRFRAME), vehicle=vehicle, **known)
    for after_us in range(0, 12_000_000, 200_000):
        expected = after_us >= from_us
        assert rests(state, nowhere(begun_us + after_us, 2), 400_000) is expected, after_us


@pytest.mark.requirement("REQ-MODE-12")
def test_what_follows_in_the_same_tick_is_not_carried_out_and_can_be_sent_again() -> None:
    flight = Flight(parse_scenario(SCENARIO, "restart", "mocap"))
    flight.run(0.5)
    flight.step(command(REBOOT, 1.0), command(ARM, 1.0))
    assert flight.results[-2:] == [(REBOOT, ACCEPTED), (ARM, LATER)]
    assert flight.texts[-1] == "command refused: the flight software restarts; send it again"
    flight.run(0.4)
    flight.step(command(ARM, 1.0))
    assert flight.results[-1] == (ARM, ACCEPTED)
    assert flight.mode is Mode.HOLD


def test_what_another_had_chosen_before_is_done_if_it_is_sent_again() -> None:
    flight = Flight(parse_scenario(SCENARIO, "restart"))
    flight.run(0.5)
    flight.step(command(TAKEOFF))
    reboot = command(REBOOT, 1.0)
    flight.step(replace(reboot, request=replace(reboot.request, source_system=254)))
    flight.run(0.1)
    assert flight.snapshot.intended_mode is Mode.HOLD
    flight.step(command(TAKEOFF))
    assert flight.snapshot.intended_mode is Mode.TAKEOFF


@pytest.mark.long
def test_while_nothing_is_known_it_is_answered_again_and_may_be_asked_for() -> None:
    silent = [False]
    flight = Flight(
        parse_scenario(SCENARIO, "restart", "mocap"),
        spoil_samples=lambda samples: () if silent[0] else samples,
    )
    flight.run(0.5)
    silent[0] = True
    flight.step(command(REBOOT, 1.0))
    flight.run(0.1)
    flight.step(command(REBOOT, 1.0, confirmation=1))
    assert results_of(flight, REBOOT) == [ACCEPTED, ACCEPTED]
    flight.run(4.0)
    flight.step(command(ARM, 1.0), command(REBOOT, 1.0))
    assert flight.texts[-2] == "not armed: the state estimate is invalid"
    assert flight.results[-2:] == [(ARM, LATER), (REBOOT, ACCEPTED)]
    assert flight.texts.count("flight software restarted") == 2
    silent[0] = False
    flight.run(1.0)
    flight.step(command(ARM, 1.0))
    assert flight.mode is Mode.HOLD


@pytest.mark.requirement("REQ-MODE-12", "REQ-ARM-6")
@pytest.mark.parametrize("suite", ["perfect", "mocap"])
def test_outside_its_safe_set_it_cannot_be_armed_in_any_tick_after_a_restart(suite: str) -> None:
    flight = Flight(parse_scenario(SCENARIO, "restart", suite), announces=False)
    flight.run(1.0)
    behind = SafeSet((wall((0.5, 0.0, 0.0), 0.0, 0.1),))
    flight.streamed = {"announced": (SafeSetAnnouncement(MessageSource(1, 195, "sim"), behind),)}
    flight.run(0.5)
    flight.streamed = {}
    flight.step(command(ARM, 1.0))
    assert flight.results[-1][1] != ACCEPTED
    assert "safe set" in flight.texts[-1]
    flight.step(command(REBOOT, 1.0))
    for _ in range(250):
        flight.step(command(ARM, 1.0))
        assert flight.results[-1][1] != ACCEPTED


@pytest.mark.requirement("REQ-MODE-12")
def test_only_what_the_ground_has_and_what_is_counted_stays() -> None:
    flight = Flight(parse_scenario(SCENARIO, "restart", "mocap"))
    flight.run(1.0)
    take_off(flight)
    flight.run(2.0)
    counted = replace(
        flight.state,
        tuning=(("a.gain", 2.0),),
        safety=SafetyMemory(breach_us=5, counters=SafetyCounters(breaches=1)),
        offboard=OffboardMemory(motion_us=7, accepted=3, refused=2),
    )
    airframe = flight.config.airframe
    after, fresh = restarted(counted, airframe), first_state(airframe)
    kept = {"mission", "tuning", "battery", "host", "constraints", "aiding"}
    for name in kept:
        assert getattr(after, name) is getattr(counted, name)
    assert after.kept.source is counted.mission.safe_set
    partly = {
        "safety": SafetyMemory(counters=SafetyCounters(breaches=1)),
        "offboard": OffboardMemory(accepted=3, refused=2),
        "plan": PlanMemory(next_id=counted.plan.next_id, counters=counted.plan.counters),
        "vehicle": VehicleMemory(
            gcs_heard_us=counted.vehicle.gcs_heard_us, answered=counted.vehicle.answered
        ),
    }
    assert counted.plan.counters != PlannerCounters()
    for name, expected in partly.items():
        assert getattr(after, name) == expected, name
    for field in dataclasses.fields(FlightState):
        if field.name not in {*kept, *partly, "kept"}:
            assert getattr(after, field.name) == getattr(fresh, field.name), field.name
