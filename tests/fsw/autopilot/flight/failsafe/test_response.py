"""The strongest action wins, once; a pilot's command puts it aside; what ends is told."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.flight.commander import Commander
from fsw.autopilot.flight.failsafe.conditions import Action, Condition
from fsw.autopilot.flight.failsafe.response import allowed, respond
from fsw.autopilot.flight.failsafe.table import FAILSAFES, ROWS, Failsafe
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import (
    Aiding,
    Damage,
    FlightState,
    LostSensor,
    MissionMemory,
    OffboardMemory,
    PlanMemory,
    SafetyMemory,
)
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import (
    ActuatorReport,
    BatteryState,
    BatteryWarning,
    Command,
    CommandAction,
    CommandRequest,
    CommandResult,
    FailsafeEvent,
    GoTo,
    HostHealth,
    Mode,
    Place,
    StatusText,
    SwitchMode,
    Vec3,
)
from tests.fsw.autopilot.flight.in_flight import CONFIG, flying, limits, vehicle_at
from tests.fsw.records import with_record

NUMBERS = itertools.count()
HERE: Vec3 = (1.0, 2.0, -3.0)
SECOND = 1_000_000
ADRIFT = Aiding(unaided_us=2 * SECOND, position_sigma=0.6)
ONLY_HOLD = limits(station_loss_action=1)
AT_ONCE = limits(failsafe_delay_us=0)


def mode_of(state: FlightState) -> tuple[Mode, Mode | None]:
    return state.vehicle.mode, state.vehicle.failsafe_from


@dataclass
class Watched:
    """A vehicle in the air that nothing moves, watched once a planning period."""

    config: FlightConfig = CONFIG
    state: FlightState = field(default_factory=lambda: flying(Mode.MISSION, gcs_heard_us=0))
    now_us: int = 0
    texts: list[str] = field(default_factory=list)
    events: list[FailsafeEvent] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.commander = Commander(self.config)

    def until(self, seconds: float, **changes: Any) -> Watched:
        """Watch until a time, with changes of the state from now on."""
        self.state = replace(self.state, **changes)
        while self.now_us < seconds * SECOND:
            self.now_us += 100_000
            estimate = vehicle_at(HERE, t_us=self.now_us)
            self.state = replace(self.state, plan=PlanMemory(since_us=self.now_us))
            said: list[StatusText] = []
            self.state = self.commander.check_failsafes(self.state, estimate, said)
            self.state = replace(self.state, t_us=self.now_us)
            self.texts += [text.text for text in said]
            self.events += [text.event for text in said if text.event is not None]
        return self

    def heard(self) -> Watched:
        """A ground station is there again."""
        vehicle = replace(self.state.vehicle, gcs_heard_us=self.now_us)
        self.state = replace(self.state, vehicle=vehicle)
        return self

    def told(self, action: CommandAction) -> CommandResult:
        """A command of the pilot."""
        said: list[StatusText] = []
        request = CommandRequest(next(NUMBERS), (math.nan,) * 7, 255, 190)
        estimate = vehicle_at(HERE, t_us=self.now_us)
        self.state, acks = self.commander.handle_commands(
            self.state, estimate, (Command(action, request),), said
        )
        self.texts += [text.text for text in said]
        return CommandResult(acks[0].result)

    def mode(self, mode: Mode) -> Watched:
        """Fly in a mode, as if the last one were done."""
        self.state = replace(self.state, vehicle=replace(self.state.vehicle, mode=mode))
        return self

    @property
    def flown(self) -> tuple[Mode, Mode | None]:
        return mode_of(self.state)


COMMANDER = Commander(CONFIG)


def charge(level: BatteryWarning) -> BatteryState:
    return BatteryState(remaining=0.04, charge=level)


IMU_LOST = LostSensor(Sensor.IMU, SensorFault.STALE, 0)
ENCODERS_LOST = LostSensor(Sensor.ENCODERS, SensorFault.STUCK, 4 * SECOND)


@pytest.mark.requirement("REQ-EST-6", "REQ-MODE-4")
@pytest.mark.parametrize("first", [IMU_LOST, ENCODERS_LOST._replace(since_us=0)])
def test_a_second_sensor_that_is_lost_is_news_and_acts_though_the_first_was_put_aside(
    first: LostSensor,
) -> None:
    watched = Watched().until(1.0, aiding=Aiding(lost=(first,)))
    assert watched.flown == (Mode.HOLD, Mode.MISSION)
    watched.told(SwitchMode(Mode.LAND))
    watched.mode(Mode.MISSION).until(4.0)
    assert watched.flown[0] is Mode.MISSION
    second = ENCODERS_LOST if first is IMU_LOST else IMU_LOST._replace(since_us=4 * SECOND)
    before = len(watched.texts)
    watched.until(6.0, aiding=Aiding(lost=(first, second)))
    assert watched.flown == (Mode.HOLD, Mode.MISSION)
    (text, change) = watched.texts[before:]
    assert "IMU silent" in text
    assert "joint encoders stuck" in text
    assert text.endswith("holding")
    assert change == "mission to hold: failsafe"
    # What lasts has been put aside; one that was well meanwhile counts anew, as does the first.
    for well in (Aiding(lost=(first,)), Aiding()):
        watched.heard().told(SwitchMode(Mode.LAND))
        watched.mode(Mode.MISSION).until(1e-6 * watched.now_us + 1.0)
        watched.until(1e-6 * watched.now_us + 1.0, aiding=well)
        assert watched.flown[0] is Mode.MISSION
        watched.until(1e-6 * watched.now_us + 1.0, aiding=Aiding(lost=(first, second)))
        assert watched.flown[0] is Mode.HOLD


@pytest.mark.requirement("REQ-LINK-1")
def test_a_station_lost_in_a_mission_holds_for_a_while_and_returns_and_is_told_twice() -> None:
    watched = Watched().until(9.9)
    assert watched.flown == (Mode.MISSION, None)
    assert watched.until(10.0).flown == (Mode.HOLD, Mode.MISSION)
    assert watched.until(14.9).flown == (Mode.HOLD, Mode.MISSION)
    assert watched.until(15.0).flown == (Mode.RETURN, Mode.MISSION)
    watched.until(100.0)
    assert watched.texts == [
        "failsafe: no ground station for 10 s, returning in 5 s",
        "mission to hold: failsafe",
        "failsafe: no ground station for 15 s, returning",
        "hold to return: failsafe",
    ]


@pytest.mark.requirement("REQ-MODE-1", "REQ-LINK-1")
def test_the_event_of_a_delayed_action_says_hold_first_and_the_action_when_it_begins() -> None:
    watched = Watched().until(100.0)
    hold, back = watched.events
    assert (hold.action, hold.later, hold.delay_us) == ("holding", "returning", 5 * SECOND)
    assert (back.action, back.later, back.delay_us) == ("returning", "", 0)
    assert hold.condition == back.condition == Condition.DATALINK_LOST.value
    (at_once,) = Watched(AT_ONCE).until(100.0).events
    assert (at_once.action, at_once.later) == ("returning", "")


def test_a_station_lost_in_a_mission_that_is_exempt_is_acted_on_when_the_mission_ends() -> None:
    exempt = limits(station_loss_exceptions=1, failsafe_delay_us=0)
    watched = Watched(exempt).until(30.0)
    assert watched.flown == (Mode.MISSION, None)
    assert watched.mode(Mode.HOLD).until(30.1).flown == (Mode.RETURN, Mode.HOLD)


def test_a_station_that_comes_back_within_the_delay_leaves_the_vehicle_in_hold() -> None:
    watched = Watched().until(12.0).heard().until(14.0)
    assert watched.texts[-1] == "over: no ground station, after 2.1 s"
    assert watched.heard().until(20.0).flown == (Mode.HOLD, Mode.MISSION)
    assert watched.until(24.0).flown == (Mode.HOLD, Mode.MISSION), "lost anew: the delay is anew"
    assert watched.until(29.0).flown == (Mode.RETURN, Mode.MISSION)


@pytest.mark.requirement("REQ-MODE-3")
def test_what_ended_is_told_once_and_the_mode_stays() -> None:
    watched = Watched(AT_ONCE).until(12.0)
    assert watched.flown == (Mode.RETURN, Mode.MISSION)
    watched.heard().until(13.0)
    assert watched.texts[-1] == "over: no ground station, after 2.1 s"
    count = len(watched.texts)
    assert watched.until(21.0).flown == (Mode.RETURN, Mode.MISSION)
    assert len(watched.texts) == count


@pytest.mark.requirement("REQ-MODE-2")
def test_the_strongest_wins_and_a_milder_one_never_takes_over() -> None:
    watched = Watched(AT_ONCE).until(11.0, battery=charge(BatteryWarning.EMERGENCY))
    assert watched.flown == (Mode.LAND, Mode.MISSION)
    assert any("battery nearly empty: 4 % left, landing" in text for text in watched.texts)
    assert "no ground station for 10 s" in watched.texts, "told, and not acted upon"
    watched = Watched(AT_ONCE).until(11.0)
    assert watched.until(12.0, battery=charge(BatteryWarning.CRITICAL)).flown[0] is Mode.RETURN
    assert watched.until(13.0, battery=charge(BatteryWarning.EMERGENCY)).flown[0] is Mode.LAND


def test_a_stronger_condition_shortens_no_delay_but_one_that_cannot_wait_does() -> None:
    watched = Watched().until(12.0)
    watched.until(13.0, battery=charge(BatteryWarning.EMERGENCY))
    assert watched.flown == (Mode.HOLD, Mode.MISSION)
    assert watched.until(15.0).flown == (Mode.LAND, Mode.MISSION)
    watched = Watched().until(12.0).until(12.1, aiding=ADRIFT)
    assert watched.flown == (Mode.DESCEND, Mode.MISSION)


def test_an_action_that_holds_waits_for_nothing() -> None:
    assert Watched(ONLY_HOLD).until(10.0).flown == (Mode.HOLD, Mode.MISSION)
    assert Watched(ONLY_HOLD).until(100.0).texts == [
        "failsafe: no ground station for 10 s, holding",
        "mission to hold: failsafe",
    ]


@pytest.mark.requirement("REQ-MODE-4")
@pytest.mark.parametrize("config", [CONFIG, AT_ONCE])
def test_a_pilot_takes_over_and_the_condition_acts_again_only_after_it_has_ended(
    config: FlightConfig,
) -> None:
    watched = Watched(config).until(12.0)
    assert watched.told(SwitchMode(Mode.HOLD)) == CommandResult.ACCEPTED
    assert "failsafe overridden: no ground station" in watched.texts
    assert watched.flown == (Mode.HOLD, None)
    assert watched.until(40.0).flown == (Mode.HOLD, None)
    assert watched.until(41.0, battery=charge(BatteryWarning.CRITICAL)).flown[1] is Mode.HOLD, (
        "another one"
    )
    assert watched.told(SwitchMode(Mode.HOLD)) == CommandResult.ACCEPTED
    watched.heard().until(42.0)
    assert watched.until(60.0).flown == (Mode.RETURN, Mode.HOLD)


@pytest.mark.requirement("REQ-MODE-4")
def test_a_place_to_go_to_is_a_command_as_well() -> None:
    watched = Watched().until(12.0)
    there = GoTo(Place((3.0, 3.0), 3.0))
    assert watched.told(there) == CommandResult.ACCEPTED
    assert watched.until(30.0).flown == (Mode.HOLD, None)


@pytest.mark.requirement("REQ-MODE-5")
def test_without_a_position_no_mode_is_accepted_until_there_is_one_again() -> None:
    watched = Watched().until(1.0, aiding=ADRIFT)
    assert watched.flown == (Mode.DESCEND, Mode.MISSION)
    for mode in (Mode.HOLD, Mode.LAND, Mode.RETURN):
        assert watched.told(SwitchMode(mode)) == CommandResult.TEMPORARILY_REJECTED
        assert watched.texts[-1] == f"no {mode.value}: position unknown; the vehicle descends"
    watched.until(2.0, aiding=Aiding())
    assert watched.flown == (Mode.DESCEND, Mode.MISSION), "it is the pilot's to change"
    assert watched.told(SwitchMode(Mode.HOLD)) == CommandResult.ACCEPTED
    assert watched.flown == (Mode.HOLD, None)


OUTSIDE = SafetyMemory(breach_us=0, breach_by=0.01)
OVER_THE_FENCE = SafetyMemory(fence_us=0, fence_by=0.02)


@pytest.mark.requirement("REQ-SAFE-4")
def test_a_vehicle_that_is_pushed_out_again_retreats_again() -> None:
    watched = Watched().until(1.0, safety=OUTSIDE)
    assert watched.flown == (Mode.HOLD, Mode.MISSION)
    watched.until(2.0, safety=SafetyMemory()).until(3.0, safety=OUTSIDE)
    assert sum("retreating" in text for text in watched.texts) == 2


def test_a_vehicle_that_has_returned_and_holds_does_not_return_again_but_acts_on_what_is_new() -> (
    None
):
    watched = Watched(AT_ONCE).until(12.0)
    assert watched.flown == (Mode.RETURN, Mode.MISSION)
    watched.mode(Mode.HOLD).until(60.0)
    assert watched.flown == (Mode.HOLD, Mode.MISSION), "it is home, and the station still lost"
    watched.until(61.0, safety=OUTSIDE)
    assert "failsafe: outside the safe set by 10 mm, retreating" in watched.texts
    watched.until(62.0, battery=charge(BatteryWarning.CRITICAL))
    assert watched.flown == (Mode.RETURN, Mode.MISSION)


@pytest.mark.requirement("REQ-MODE-3")
@given(
    st.lists(
        st.tuples(
            st.sampled_from(
                [
                    BatteryWarning.OK,
                    BatteryWarning.LOW,
                    BatteryWarning.CRITICAL,
                    BatteryWarning.EMERGENCY,
                ]
            ),
            st.booleans(),
            st.booleans(),
            st.booleans(),
        ),
        max_size=8,
    )
)
@settings(max_examples=25, deadline=None)
def test_without_a_pilot_a_vehicle_never_goes_on_with_what_a_failsafe_ended(
    happens: list[tuple[BatteryWarning, bool, bool, bool]],
) -> None:
    """Whatever begins and ends: what was flown is left once and not taken up again."""
    watched, left = Watched(limits(failsafe_delay_us=200_000)), False
    last = Mode.MISSION
    for second, (level, heard, lost, outside) in enumerate(happens, start=1):
        if heard:
            watched.heard()
        watched.until(
            6.0 * second,
            battery=charge(level),
            aiding=ADRIFT if lost else Aiding(),
            safety=OUTSIDE if outside else SafetyMemory(),
        )
        mode = watched.flown[0]
        left = left or mode is not Mode.MISSION
        assert not (left and mode is Mode.MISSION)
        order = [Mode.MISSION, Mode.HOLD, Mode.RETURN, Mode.LAND, Mode.DESCEND]
        assert order.index(mode) >= order.index(last), "nothing milder takes over"
        last = mode


def test_a_landing_goes_on_but_for_what_cannot_be_landed_with() -> None:
    lost = Watched(AT_ONCE, flying(Mode.LAND, gcs_heard_us=0)).until(20.0)
    assert lost.flown == (Mode.LAND, None)
    assert lost.until(21.0, aiding=ADRIFT).flown == (Mode.DESCEND, Mode.LAND)


@pytest.mark.requirement("REQ-MODE-2")
@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.RETURN, Mode.LAND, Mode.DESCEND])
@pytest.mark.parametrize("action", Action)
def test_what_is_under_way_is_not_begun_again_and_nothing_begins_on_the_ground(
    action: Action, mode: Mode
) -> None:
    done = {
        Mode.HOLD: set(),
        Mode.RETURN: {Action.RETURN},
        Mode.LAND: {Action.HOLD, Action.RETREAT, Action.RETURN, Action.LAND},
        Mode.DESCEND: {Action.HOLD, Action.RETREAT, Action.RETURN, Action.LAND, Action.DESCEND},
    }
    expected = Action.WARN if action in done[mode] else action
    assert allowed(action, mode, flies=True) is expected
    on_the_ground = allowed(action, mode, flies=False)
    assert on_the_ground is (Action.WARN if action.mode is not None else action)


@pytest.mark.requirement("REQ-LINK-2")
def test_setpoints_that_stop_hold_at_once_and_are_told_when_they_come_again() -> None:
    watched = Watched(state=flying(Mode.OFFBOARD))
    watched.until(3.0)
    assert watched.flown == (Mode.HOLD, Mode.OFFBOARD)
    vehicle_holds = Condition.SETPOINTS_LOST in watched.state.vehicle.conditions
    assert vehicle_holds, "it stays lost"
    watched.until(4.0, offboard=OffboardMemory(motion_us=10 * SECOND))
    assert watched.texts[-1] == "over: offboard setpoints stopped, after 3.0 s"
    assert watched.flown == (Mode.HOLD, Mode.OFFBOARD)


def test_a_second_joint_that_fails_is_told_and_changes_no_action() -> None:
    watched = Watched().until(0.5, damage=Damage(joint="joint 1 does not move"))
    flown, first = watched.flown, list(watched.texts)
    assert flown[0] is not Mode.MISSION
    watched.until(1.0)
    assert watched.texts == first
    watched.until(3.0, damage=Damage(joint="joint 1 does not move and joint 2 gives no torque"))
    (text,) = watched.texts[len(first) :]
    assert "joint 2 gives no torque" in text
    assert watched.flown == flown


def test_landing_or_disarming_ends_a_failsafe() -> None:
    watched = Watched(AT_ONCE).until(11.0)
    assert watched.state.vehicle.failsafe.action is Action.RETURN
    vehicle = replace(watched.state.vehicle, mode=Mode.LAND, landed=True)
    state = with_record(replace(watched.state, vehicle=vehicle), plan_state=None)
    estimate = vehicle_at((0.0, 0.0, -CONFIG.airframe.leg_length), t_us=watched.now_us)
    for _ in range(2):
        state = watched.commander.check_mode_completion(state, estimate, [])
        estimate = estimate._replace(t_us=estimate.t_us + SECOND)
    assert mode_of(state) == (Mode.DISARMED, None)
    assert state.vehicle.failsafe.action is Action.NONE


def both(fence_action: int, breach_action: int = 6) -> Watched:
    """A vehicle that is outside an announced zone first, and outside the fence a second later."""
    config = limits(fence_action=fence_action, breach_action=breach_action)
    watched = Watched(config, replace(flying(Mode.MISSION))).until(1.0, safety=OUTSIDE)
    return watched.until(2.0, safety=replace(OUTSIDE, fence_us=0, fence_by=0.02))


@pytest.mark.requirement("REQ-SAFE-4")
def test_fence_and_safe_set_are_told_each_and_neither_masks_the_action_of_the_other() -> None:
    warned = both(fence_action=1)
    assert warned.texts[0] == "failsafe: outside the safe set by 10 mm, retreating"
    assert warned.texts[-1] == "outside the fence by 20 mm: warn"
    assert warned.state.vehicle.failsafe.action is Action.RETREAT
    ended = both(fence_action=4, breach_action=1)
    assert ended.flown == (Mode.FAULT, None)
    assert ended.texts[:2] == [
        "outside the safe set by 10 mm: warn",
        "outside the fence by 20 mm: terminate",
    ]


@pytest.mark.requirement("REQ-SAFE-4")
def test_outside_both_at_once_the_strongest_action_is_taken_and_both_are_told() -> None:
    safety = replace(OUTSIDE, fence_us=0, fence_by=0.02)
    watched = Watched(limits(fence_action=1), flying(Mode.MISSION)).until(1.0, safety=safety)
    assert watched.texts == [
        "failsafe: outside the safe set by 10 mm, retreating",
        "outside the fence by 20 mm: warn",
        "mission to hold: failsafe",
    ]
    watched.until(2.0, safety=OVER_THE_FENCE)
    assert watched.texts[3:] == ["over: outside the safe set, after 1.0 s"]
    assert watched.state.vehicle.conditions == (Condition.FENCE_BREACH,)


HAPPENS: dict[Condition, dict[str, Any]] = {
    Condition.ATTITUDE_LOST: {"aiding": Aiding(attitude_sigma=0.8)},
    Condition.TILT_LOST: {"safety": SafetyMemory(rolled_us=0)},
    Condition.POSITION_LOST: {"aiding": ADRIFT},
    Condition.BREACH: {"safety": OUTSIDE},
    Condition.FENCE_BREACH: {"safety": OVER_THE_FENCE},
    Condition.ROTOR_LOST: {"damage": Damage("rotor 2", report=ActuatorReport(2, lost=True))},
    Condition.ROTOR_FAILED: {"damage": Damage(rotor="rotor 2")},
    Condition.JOINT_FAILED: {"damage": Damage(joint="joint 1")},
    Condition.POSITION_LOW: {"aiding": ADRIFT},
    Condition.SENSOR_LOST: {"aiding": Aiding(lost=(LostSensor(Sensor.IMU, SensorFault.STALE, 0),))},
    Condition.TUBE_LEFT: {"safety": SafetyMemory(off_plan_us=0)},
    Condition.FILTER_ACTIVE: {"safety": SafetyMemory(filter_us=0)},
    Condition.AIDING_LOST: {"aiding": ADRIFT},
    Condition.ESTIMATE_INVALID: {"invalid_ticks": 5},
    Condition.OUTPUT_NOT_FINITE: {"output_replaced": True},
    Condition.LOOP_OVERRUN: {"host": HostHealth(missed_ticks=100)},
    Condition.CLOCK_JUMPED: {"host": HostHealth(clock_jump_us=10**6)},
    Condition.LINK_FLOODED: {"host": HostHealth(datagrams=10**4)},
    Condition.LOG_STOPPED: {"host": HostHealth(log_failure="flight.ulg ends early")},
    Condition.DISK_FULL: {"host": HostHealth(disk_left_us=0)},
    Condition.BATTERY_LOW: {"battery": charge(BatteryWarning.LOW)},
    Condition.BATTERY_CRITICAL: {"battery": charge(BatteryWarning.CRITICAL)},
    Condition.BATTERY_EMERGENCY: {"battery": charge(BatteryWarning.EMERGENCY)},
    Condition.FLIGHT_TIME_LOW: {"battery": BatteryState(time_left=1.0)},
    Condition.PARAMETERS_CONTRADICT: {"mission": MissionMemory(refusals=("too little room",))},
}


@pytest.mark.requirement(
    "REQ-SAFE-4",
    "REQ-MODE-1",
    "REQ-EST-3",
    "REQ-EST-4",
    "REQ-EST-5",
    "REQ-EST-6",
    "REQ-EST-8",
    "REQ-ACT-5",
    "REQ-ACT-7",
    "REQ-ARM-7",
)
@pytest.mark.parametrize("condition", HAPPENS, ids=lambda condition: condition.name)
def test_a_condition_is_told_within_the_time_of_its_row(condition: Condition) -> None:
    begin_us = 10 * SECOND + 2_000  # just after a planning period has begun
    state = replace(flying(Mode.MISSION), t_us=begin_us - 2_000, **HAPPENS[condition])
    state = replace(state, plan=PlanMemory(since_us=begin_us))
    for t_us in range(begin_us, begin_us + SECOND, 2_000):
        said: list[StatusText] = []
        state = COMMANDER.check_failsafes(state, vehicle_at(HERE, t_us=t_us), said)
        state = replace(state, t_us=t_us, plan=PlanMemory(since_us=t_us))
        if any(text.text.removeprefix("failsafe: ").startswith(condition.value) for text in said):
            break
    assert t_us - begin_us <= ROWS[condition].within_us


@pytest.mark.requirement("REQ-MODE-1")
def test_no_row_is_silent_in_flight() -> None:
    """What is not acted upon is told at least: no default is a quiet one."""
    estimate = vehicle_at(HERE, t_us=20 * SECOND)
    context = Situation(flying(Mode.MISSION, gcs_heard_us=0), estimate, CONFIG)
    for row in FAILSAFES:
        assert row.action(context) is not Action.NONE, row.condition


@pytest.mark.requirement("REQ-ARM-7")
def test_parameters_that_contradict_each_other_are_told_once_and_again_when_others_do() -> None:
    contradictory = limits(battery_low=0.05, battery_critical=0.1)
    watched = Watched(contradictory).heard().until(5.0)
    words = "parameters contradict each other: BAT_CRIT_THR 0.1 is to be below BAT_LOW_THR, 0.05"
    assert watched.texts == [words]
    assert watched.flown == (Mode.MISSION, None), "it warns, whatever is flown"
    smaller = MissionMemory(refusals=("lambda is too large",))
    watched.heard().until(9.0, mission=smaller)
    assert watched.texts == [words, f"{words}; lambda is too large"]
    watched.heard().until(10.0, mission=MissionMemory())
    assert len(watched.texts) == 3, "the pair alone again"
    ended = Watched(state=watched.state, now_us=watched.now_us).heard().until(11.0)
    assert ended.texts == ["over: parameters contradict each other, after 10.0 s"]


BOTH = (Condition.DATALINK_LOST, Condition.BREACH)  # any two, of which the first is delayed


def two_rows(later: Action, at_once: Action) -> tuple[Failsafe, Failsafe]:
    first, second = (ROWS[condition] for condition in BOTH)
    return (
        replace(first, asks=later, delayed=True),
        replace(second, asks=at_once, delayed=False),
    )


@pytest.mark.requirement("REQ-MODE-2")
@pytest.mark.parametrize("later", [Action.RETURN, Action.LAND])
@pytest.mark.parametrize("at_once", [one for one in Action if one.mode is not None])
@pytest.mark.parametrize("begins_s", [(1.0, 2.0), (2.0, 1.0), (1.0, 1.0)])
def test_what_is_not_delayed_acts_while_something_else_waits(
    later: Action, at_once: Action, begins_s: tuple[float, float]
) -> None:
    rows, state, told = two_rows(later, at_once), flying(Mode.MISSION), []
    due_s = begins_s[0] + 1e-6 * CONFIG.limits.failsafe_delay_us
    strongest = max(later, at_once, key=lambda action: action.strength)
    flown = Action.NONE
    for k in range(100):
        now_s = 0.1 * k
        active = tuple(row for row, at_s in zip(rows, begins_s, strict=True) if now_s >= at_s)
        estimate = vehicle_at(HERE, t_us=round(now_s * SECOND))
        found = respond(Situation(state, estimate, CONFIG), active)
        mode = found.action.mode or state.vehicle.mode
        conditions = tuple(row.condition for row in active)
        vehicle = replace(state.vehicle, failsafe=found.memory, conditions=conditions, mode=mode)
        state = replace(state, vehicle=vehicle)
        told += [text.text for text in found.reports]
        if found.action is not Action.NONE:
            assert found.action.strength > flown.strength, "nothing gives way to a milder action"
            flown = found.action
        if now_s >= begins_s[1]:
            assert flown.strength >= at_once.strength
        if begins_s[0] <= now_s < min(due_s, 7.0) and begins_s[1] > now_s:
            assert flown is Action.HOLD
        if now_s > due_s + 0.05:
            assert flown is strongest
    if at_once is not Action.HOLD:  # which waiting may have begun
        assert any(at_once.value in text for text in told)
    returns_by_then = at_once is Action.RETURN and begins_s[1] < begins_s[0]
    if later.strength > at_once.strength and not returns_by_then:
        assert any(f"{later.value} in 5 s" in text for text in told)


@pytest.mark.parametrize("breach_first", [True, False])
def test_a_vehicle_goes_on_drawing_back_while_a_return_waits(breach_first: bool) -> None:
    watched = Watched().heard()
    outside = replace(watched.state.safety, breach_us=2 * SECOND, breach_by=0.05)
    low = charge(BatteryWarning.CRITICAL)
    first, second = ("safety", outside), ("battery", low)
    if not breach_first:
        first, second = second, first
    watched.until(2.5, **{first[0]: first[1]}).until(3.0, **{second[0]: second[1]})
    goal = watched.state.setpoint.goal
    assert watched.state.vehicle.failsafe.action is Action.RETREAT
    assert goal is not None
    assert not goal.motion.of_end_effector, "a place for the base, not a stop"
    assert watched.until(9.0).flown == (Mode.RETURN, Mode.MISSION)
    assert sum("retreating" in text for text in watched.texts) == 1
    assert sum("returning in 5 s" in text for text in watched.texts) == 1
