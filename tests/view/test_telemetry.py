"""Tests of what is made of a vehicle's messages."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fsw.autopilot.flight.failsafe.conditions import Action, Condition
from fsw.autopilot.model.airframe import AIRFRAME, airframe_of
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import (
    ActuatorCommand,
    FailsafeEvent,
    FlightSnapshot,
    Mode,
    PlanInput,
    SafeSet,
    Severity,
    Zone,
)
from fsw.link.events import ARGUMENTS, failsafe_event
from fsw.link.telemetry.streams import STREAMS, messages_now
from fsw.link.wire.outgoing import Outgoing, TelemetryContext
from messages import message_ids as ids
from messages import tlog_reader
from messages.frames import LAYOUTS, Frame, FrameWriter, split
from tests.fsw.link.snapshots import CONTEXT, PLAN, SNAPSHOT
from vehicles.vehicle_file import load_vehicle
from view import tlog_flight
from view.flight_data import UlogError
from view.scene import Held, Tool
from view.telemetry import READERS, Telemetry
from view.tlog_flight import TlogFlight
from view.vehicle import horizon

WALLS = SafeSet((wall((-1.0, 0.0, 0.0), -1.0, 0.125), Zone(ball((1.0, 2.0, -1.0), 0.5), 0.25)))
STEP = PlanInput((0.5, 0.0, 0.0), 0.0, (0.0, 0.0))
FLYING = replace(
    SNAPSHOT, safe_set=WALLS, mode=Mode.HOLD, plan=replace(SNAPSHOT.plan, inputs=(STEP,) * 5)
)
WRITERS = {component: FrameWriter(1, component) for component in (1, 25)}


def take(telemetry: Telemetry, *sent: Outgoing, at: float = 0.0) -> None:
    for one in sent:
        for frame in split(WRITERS[one.component].frame(one.message_id, *one.values)):
            telemetry.take(frame, at)


def everything(
    snapshot: FlightSnapshot = FLYING, context: TelemetryContext = CONTEXT
) -> list[Outgoing]:
    sent = []
    for message_id in dict.fromkeys([*(s.message_id for s in STREAMS), ids.OBSTACLE_SHAPE]):
        sent += messages_now(message_id, 0.0, snapshot, context) or ()
    return sent


def test_failsafes_are_named_as_long_as_they_last() -> None:
    telemetry = Telemetry(AIRFRAME)
    beat = next(one for one in everything() if one.message_id == ids.HEARTBEAT)
    take(telemetry, replace(beat, values=(*beat.values[:4], 5, *beat.values[5:])))
    assert telemetry.scene(0.0).failures == "failsafe"
    for number, (condition, over, shown) in enumerate(
        [
            (Condition.BREACH, False, "outside the safe set"),
            (Condition.POSITION_LOST, False, "outside the safe set, position unknown"),
            (Condition.BREACH, True, "position unknown"),
            (Condition.POSITION_LOST, True, "failsafe"),
        ]
    ):
        said = failsafe_event(
            FailsafeEvent(condition.value, Action.HOLD.value, Severity.CRITICAL, over)
        )
        arguments = said.arguments.ljust(ARGUMENTS, b"\0")
        take(telemetry, Outgoing(ids.EVENT, (said.id, 0, number, 0, 0, 0x44, *arguments)))
        assert telemetry.scene(0.0).failures == shown


def test_a_vehicle_that_starts_again_has_none_of_the_last_flight() -> None:
    telemetry = Telemetry(AIRFRAME)
    take(telemetry, *everything())
    said = failsafe_event(
        FailsafeEvent(Condition.BREACH.value, Action.HOLD.value, Severity.CRITICAL)
    )
    arguments = said.arguments.ljust(ARGUMENTS, b"\0")
    take(telemetry, Outgoing(ids.EVENT, (said.id, 0, 0, 0, 0, 0x44, *arguments)))
    for t_ms in (100_000, 500):
        take(telemetry, Outgoing(ids.ATTITUDE, (t_ms, *(0.0,) * 6)))
    scene = telemetry.scene(0.0)
    assert scene.t == 0.5
    assert (scene.failures, scene.target, scene.safe_set, scene.margins) == ("", None, None, ())


def test_the_scene_is_the_snapshot_that_was_sent() -> None:
    telemetry = Telemetry(AIRFRAME)
    take(telemetry, *everything())
    scene = telemetry.scene(0.0)
    assert scene.t == pytest.approx(3.004)
    assert scene.estimate is not None
    assert scene.estimate.p == (1.0, 2.0, -3.0)
    assert scene.estimate.q == pytest.approx((math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)), abs=1e-6)
    assert scene.estimate.q_arm == pytest.approx((0.7, 0.8))
    assert scene.thrust is not None
    assert scene.thrust[3] > scene.thrust[1]
    assert len(scene.thrust) == AIRFRAME.rotors
    assert scene.target == pytest.approx((1.6, 2.6, -2.6))
    assert scene.minimum == pytest.approx(0.2)
    assert [one.margin for one in scene.margins] == pytest.approx([0.3, 0.2, 0.4])
    assert scene.safety == (3, 5, 7, 4)
    assert scene.solver is not None
    assert (scene.solver.status, scene.solver.total) == ("time limit", pytest.approx(703e-6))
    assert (scene.mode, scene.armed) == ("hold", True)
    assert scene.battery is not None
    assert scene.battery.remaining == pytest.approx(0.62)
    assert scene.safe_set == WALLS
    assert scene.tool == Tool((-5.0, 0.5, 1.5), 5.25, 4.75, 10.0, True)
    assert scene.held == Held(True, 0.28125)
    assert {one.name for one in scene.timing} == {"inner", "mpc", "telemetry", "housekeeping"}


def test_the_horizon_begins_where_the_plan_does_and_is_pushed_by_its_inputs() -> None:
    telemetry = Telemetry(AIRFRAME)
    take(telemetry, *everything())
    horizon = telemetry.scene(0.0).horizon
    assert horizon is not None
    assert horizon.base[0] == (0.0, 0.0, -1.0)
    assert horizon.tip[0] == pytest.approx((0.0, 0.0, -0.7))
    assert len(horizon.tip) == 6
    assert horizon.base[-1][0] > 0.005


def of_vehicle(name: str) -> tuple[Telemetry, FlightSnapshot, TelemetryContext]:
    """An inspector of a vehicle, and the vehicle with a plan that moves its joints."""
    airframe = airframe_of(load_vehicle(name))
    joints, rotors = airframe.bodies.joints, airframe.rotors
    angles = tuple(0.1 * k for k in range(1, joints + 1))
    start = PLAN.start._replace(q_arm=angles, qd_arm=angles)
    steps = tuple(PlanInput((0.5, 0.0, 0.0), 0.0, tuple(k * q for q in angles)) for k in range(4))
    estimate = SNAPSHOT.estimate._replace(q_arm=angles, qd_arm=angles)
    actuators = ActuatorCommand((4.0,) * rotors, (0.0,) * joints)
    plan = replace(PLAN, start=start, inputs=steps)
    facts = replace(CONTEXT.facts, airframe=airframe)
    snapshot = replace(FLYING, estimate=estimate, actuators=actuators, plan=plan)
    return Telemetry(airframe), snapshot, replace(CONTEXT, facts=facts)


VEHICLES = ["paper", "probe-2r", "hexa-3r", "octo-4r"]


@pytest.mark.parametrize("name", VEHICLES)
def test_a_plan_is_drawn_of_any_number_of_joints(name: str) -> None:
    telemetry, snapshot, context = of_vehicle(name)
    take(telemetry, *everything(snapshot, context))
    plan = snapshot.plan
    scene = telemetry.scene(0.0)
    assert scene.horizon is not None
    wanted = horizon(plan.start, plan.inputs, 1e-6 * plan.period_us, telemetry.airframe)
    assert np.array(scene.horizon.tip) == pytest.approx(np.array(wanted.tip), abs=1e-5)
    assert scene.estimate is not None


def test_of_two_plans_no_third_one_is_made() -> None:
    telemetry, snapshot, context = of_vehicle("hexa-3r")
    another = replace(snapshot, plan=replace(snapshot.plan, plan_id=99))
    for of, message_id in ((snapshot, ids.MPC_HORIZON), (another, ids.MPC_HORIZON_ARM)):
        take(telemetry, *messages_now(message_id, 0.0, of, context))
    assert telemetry.scene(0.0).horizon is None


@pytest.mark.parametrize(("flown", "chosen"), [("hexa-3r", "paper"), ("paper", "hexa-3r")])
def test_a_vehicle_that_is_no_such_airframe_is_said_once_and_not_drawn(
    flown: str, chosen: str
) -> None:
    _, snapshot, context = of_vehicle(flown)
    telemetry = Telemetry(airframe_of(load_vehicle(chosen)))
    for _ in range(3):
        take(telemetry, *everything(snapshot, context))
    scene = telemetry.scene(0.0)
    assert (scene.estimate, scene.horizon, scene.torque) == (None, None, None)
    said = [event.text for event in telemetry.events if "airframe" in event.text]
    assert len([one for one in said if " joints, " in one and "rotors" not in one]) == 1
    assert len(said) == len(set(said)) <= 2
    assert scene.thrust is None or flown == "paper"


def test_another_number_of_rotors_is_said_and_not_drawn() -> None:
    telemetry, snapshot, context = of_vehicle("paper")
    take(telemetry, *everything(snapshot, context))
    assert telemetry.scene(0.0).estimate is not None
    ten = (0, *(1500,) * 8, 0, *(1500,) * 2, *(0,) * 6)
    take(telemetry, Outgoing(ids.SERVO_OUTPUT_RAW, ten))
    scene = telemetry.scene(0.0)
    assert (scene.estimate, scene.horizon, scene.thrust) == (None, None, None)
    assert telemetry.events[-1].text.startswith("the vehicle has 10 rotors and joints, ")
    take(telemetry, Outgoing(ids.SERVO_OUTPUT_RAW, (0,) * 18))  # disarmed
    assert telemetry.scene(0.0).estimate is not None


def test_whatever_is_said_a_scene_is_made_of_it() -> None:
    """Any numbers in every message that is read, for vehicles of any number of joints."""
    rng = np.random.default_rng(5)
    wild = (0.0, 1.0, -1.0, math.nan, math.inf, -math.inf, 3.4e38, 1e-45)
    for name in VEHICLES:
        airframe = airframe_of(load_vehicle(name))
        for k in range(40):
            telemetry = Telemetry(airframe)
            floats = wild[: 3 if k % 2 else None]  # every second time of a usual size
            for message_id in rng.permutation([*READERS]):
                payload = LAYOUTS[message_id].payload
                values = []
                for one in payload.unpack(rng.bytes(payload.size)):
                    small = k % 2 and isinstance(one, int)
                    values.append(one % 7 if small else one)
                    if isinstance(one, float):
                        values[-1] = float(rng.choice(floats))
                telemetry.take(Frame(1, 1, 0, int(message_id), tuple(values)), 0.0)
            telemetry.scene(0.0)


def test_a_safe_set_that_is_gone_is_not_shown() -> None:
    telemetry = Telemetry(AIRFRAME)
    take(telemetry, *everything())
    take(telemetry, *(messages_now(ids.OBSTACLE_SHAPE, 0.0, SNAPSHOT, CONTEXT) or ()))
    assert telemetry.scene(0.0).safe_set == SafeSet()


@pytest.mark.parametrize(
    ("field", "number", "words"),
    [
        (1, 11.0, "clearance of 11 m"),  # what is announced is within 10 m
        (1, math.nan, "clearance of nan m"),
        (2, 1e9, "moves at"),
        (5, math.inf, "half-space refused: "),
        (25, 99, "no known kind"),
        (23, 200, "no place in its set"),
    ],
)
def test_a_zone_that_nobody_can_believe_is_counted_and_listed_once(
    field: int, number: float, words: str
) -> None:
    """A viewer shows what a log or a peer says; whoever says it may say anything."""
    telemetry = Telemetry(AIRFRAME)
    take(telemetry, *everything())
    first = messages_now(ids.OBSTACLE_SHAPE, 0.0, FLYING, CONTEXT)[0]
    bad = replace(first, values=(*first.values[:field], number, *first.values[field + 1 :]))
    for _ in range(3):
        take(telemetry, bad)
    assert telemetry.left_out == 3
    (said,) = [event.text for event in telemetry.events if "not shown" in event.text]
    assert words in said
    assert telemetry.scene(0.0).safe_set is None, "a set without one of its zones never was"


def three(*north: float) -> list[Outgoing]:
    """A set of balls of 1 m, as a vehicle sends it."""
    zones = tuple(Zone(ball((x, 0.0, 0.0), 1.0), 0.5) for x in north)
    return list(
        messages_now(ids.OBSTACLE_SHAPE, 0.0, replace(FLYING, safe_set=SafeSet(zones)), CONTEXT)
    )


def without_sense(zone: Outgoing) -> Outgoing:
    return replace(zone, values=(*zone.values[:25], 99, *zone.values[26:]))


OLD = three(1.0, 2.0, 3.0)
NEW = three(4.0, 5.0, 6.0)


@pytest.mark.parametrize(
    ("sent", "shown", "whole"),
    [
        ([*OLD, *NEW], [4.0, 5.0, 6.0], 2),
        ([*OLD, *NEW[1:]], [1.0, 2.0, 3.0], 1),  # zones are lost
        ([*OLD, *NEW[:2]], [1.0, 2.0, 3.0], 1),
        ([*OLD, NEW[0], NEW[2]], [1.0, 2.0, 3.0], 1),
        ([*OLD[:2], *NEW[1:]], None, 0),
        ([*OLD[:2], *three(4.0, 5.0)[1:]], None, 0),  # of another count
        ([NEW[0], NEW[1], NEW[1], NEW[2]], [4.0, 5.0, 6.0], 1),  # one came twice
        ([*OLD[:2], *NEW], [4.0, 5.0, 6.0], 1),  # begun anew
        ([*OLD, NEW[0], without_sense(NEW[1]), NEW[2]], None, 1),  # of an unknown kind
        ([*OLD, without_sense(NEW[0]), *NEW[1:]], None, 1),
        ([*OLD, without_sense(NEW[0]), *NEW], [4.0, 5.0, 6.0], 2),
    ],
)  # fmt: skip
def test_a_safe_set_is_one_transfer(
    sent: list[Outgoing], shown: list[float] | None, whole: int
) -> None:
    telemetry = Telemetry(AIRFRAME)
    take(telemetry, *sent)
    safe_set = telemetry.scene(0.0).safe_set
    assert shown == (None if safe_set is None else [z.shape.numbers[0] for z in safe_set.zones])
    assert telemetry.whole_sets == whole


def test_half_a_safe_set_does_not_replace_a_whole_one() -> None:
    telemetry = Telemetry(AIRFRAME)
    take(telemetry, *everything())
    other = replace(FLYING, safe_set=SafeSet((*WALLS.zones, Zone(ball((0.0,) * 3, 1.0), 0.5))))
    first, second, third = messages_now(ids.OBSTACLE_SHAPE, 0.0, other, CONTEXT) or ()
    take(telemetry, first)
    assert telemetry.scene(0.0).safe_set == WALLS
    take(telemetry, second, third)
    assert telemetry.scene(0.0).safe_set == other.safe_set


def test_what_stopped_coming_is_shown_no_longer() -> None:
    telemetry = Telemetry(AIRFRAME)
    take(telemetry, *everything())
    later = replace(FLYING, t_us=9_000_000, estimate=FLYING.estimate._replace(t_us=9_000_000))
    assert telemetry.scene(1.5).target is not None, "the listener's clock counts"
    take(telemetry, *(messages_now(ids.LOCAL_POSITION_NED, 0.0, later, CONTEXT) or ()), at=1.5)
    scene = telemetry.scene(3.0)
    assert scene.target is None
    assert scene.horizon is None
    assert scene.margins == ()
    assert scene.link_age == 1.5


AGES = {
    "estimate": (ids.ATTITUDE, ids.LOCAL_POSITION_NED, ids.ARM_JOINT_STATE),
    "thrust": (ids.SERVO_OUTPUT_RAW,),
    "margins": (ids.BARRIER_MARGIN,),
    "mode": (ids.HEARTBEAT,),
    "armed": (ids.HEARTBEAT,),
    "battery": (ids.SYS_STATUS,),
    "solver": (ids.MPC_STATUS,),
    "held": (ids.PAYLOAD_STATUS,),
    "tool": (ids.TOOL_CONTACT,),
    "horizon": (ids.MPC_HORIZON,),
    "timing": (ids.LOOP_TIMING,),
}


@pytest.mark.parametrize("what", AGES)
def test_each_value_has_an_age_whatever_else_still_comes(what: str) -> None:
    """On the listener's clock: that of the vehicle may stand."""
    unknown = getattr(Telemetry(AIRFRAME).scene(0.0), what)
    for stopped in AGES[what]:
        telemetry = Telemetry(AIRFRAME)
        take(telemetry, *everything())
        assert getattr(telemetry.scene(0.0), what) != unknown
        assert getattr(telemetry.scene(math.nan), what) == unknown, "of an unknown age it is old"
        for k in range(1, 20):
            still = [one for one in everything() if one.message_id != stopped]
            take(telemetry, *still, at=float(k))
        assert getattr(telemetry.scene(19.0), what) == unknown, stopped


def test_a_companion_of_another_clock_starts_no_flight_anew() -> None:
    telemetry = Telemetry(AIRFRAME)
    behind = replace(FLYING, t_us=1_000_000)
    for k in range(20):
        at = 10_000_000 + 100_000 * k
        ahead = replace(FLYING, t_us=at, estimate=FLYING.estimate._replace(t_us=at))
        take(telemetry, *everything(ahead))
        take(telemetry, *messages_now(ids.BARRIER_MARGIN, 0.0, behind, CONTEXT))
    scene = telemetry.scene(0.0)
    assert (scene.mode, scene.safe_set) == ("hold", WALLS)
    assert len(scene.margins) == 3


def test_a_long_text_is_one_event_and_a_critical_one_a_reason() -> None:
    telemetry = Telemetry(AIRFRAME)
    text = b"arming refused: " + b"x" * 60
    take(
        telemetry,
        Outgoing(ids.STATUSTEXT, (2, text[:50], 7, 0)),
        Outgoing(ids.STATUSTEXT, (2, text[50:].ljust(50, b"\0"), 7, 1)),
    )
    assert [one.text for one in telemetry.events] == [text.decode()]
    assert list(telemetry.refusals) == [text.decode()]


def test_rates_are_measured_and_fall_to_zero() -> None:
    telemetry = Telemetry(AIRFRAME)
    (sent,) = messages_now(ids.ATTITUDE, 0.0, FLYING, CONTEXT) or ()
    for k in range(50):
        take(telemetry, sent, at=0.02 * k)
    (heard,) = telemetry.heard.values()
    assert heard.rate(0.98) == pytest.approx(50.0, rel=0.01)
    assert heard.rate(9.0) == 0.0
    assert "yaw 1.5708" in heard.fields()


@pytest.mark.parametrize("hertz", [0.5, 10.0, 75.0, 250.0])
def test_a_rate_is_true_above_that_of_the_polling(hertz: float) -> None:
    telemetry = Telemetry(AIRFRAME)
    (sent,) = messages_now(ids.ATTITUDE, 0.0, FLYING, CONTEXT) or ()
    came, shown = 0, []
    for poll in range(1000):
        at = 0.02 * poll
        due = int(hertz * at)
        take(telemetry, *[sent] * (due - came), at=at)
        came = due
        if at > 5.0:
            shown += [one.rate(at) for one in telemetry.heard.values()]
    assert shown == pytest.approx([hertz] * len(shown), rel=0.05)


def test_a_rate_is_of_the_last_seconds() -> None:
    telemetry = Telemetry(AIRFRAME)
    (sent,) = messages_now(ids.ATTITUDE, 0.0, FLYING, CONTEXT) or ()
    for begin, hertz in ((0.0, 100.0), (60.0, 10.0)):
        for k in range(40):
            take(telemetry, sent, at=begin + k / hertz)
    (heard,) = telemetry.heard.values()
    assert heard.rate(64.0) == pytest.approx(10.0)


def test_memory_is_bounded() -> None:
    telemetry = Telemetry(AIRFRAME)
    for k in range(2000):
        take(telemetry, Outgoing(ids.STATUSTEXT, (6, b"text %d" % k, 0, 0)))
    assert len(telemetry.events) == 500
    assert telemetry.events[-1].text == "text 1999"


def test_somebody_who_makes_up_messages_does_not_fill_the_memory() -> None:
    telemetry = Telemetry(AIRFRAME)
    take(telemetry, *everything())
    known = set(telemetry.heard)
    for system in range(1, 40):
        for component in range(1, 255):
            frame = FrameWriter(system, component).frame(ids.HEARTBEAT, 0, 2, 3, 0, 4, 3)
            for one in split(frame):
                telemetry.take(one, 0.0)
    for k in range(6000):
        take(telemetry, Outgoing(ids.PARAM_VALUE, (1.0, 9, 0, b"P%d" % k, 9)))
        take(telemetry, Outgoing(ids.STATUSTEXT, (6, b"x" * 50, 7, 1 + k % 250)))
    assert len(telemetry.heard) <= 4096
    assert known <= set(telemetry.heard)
    assert len(telemetry.parameters) <= 4096
    assert max(len(one.text) for one in telemetry.events) <= 255 * 50


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("message_id", [ids.ATTITUDE, ids.LOCAL_POSITION_NED, ids.ARM_JOINT_STATE])
def test_an_estimate_that_is_no_number_is_no_place(message_id: int, wrong: float) -> None:
    telemetry = Telemetry(AIRFRAME)
    take(telemetry, *everything())
    assert telemetry.scene(0.0).estimate is not None
    (sent,) = messages_now(message_id, 0.0, FLYING, CONTEXT) or ()
    take(telemetry, replace(sent, values=(sent.values[0], wrong, *sent.values[2:])))
    assert telemetry.scene(0.0).estimate is None


@pytest.mark.parametrize("what", ["bytes", "hours"])
def test_a_telemetry_log_of_any_length_is_refused(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "flight.tlog"
    if what == "bytes":
        path.touch()
        os.truncate(path, 1 << 40)
    else:
        monkeypatch.setattr(tlog_flight, "_MAX_SCENES", 20)
        path.write_bytes(a_log(50))
    with pytest.raises(UlogError, match=r"too long: (must be )?at most"):
        TlogFlight(path, AIRFRAME)


def a_log(steps: int) -> bytes:
    """Everything that is sent, 50 times a second."""
    log = bytearray()
    for k in range(steps):
        t_us = 3_000_000 + 20_000 * k
        now = replace(FLYING, t_us=t_us, estimate=FLYING.estimate._replace(t_us=t_us))
        for one in everything(now):
            frame = WRITERS[one.component].frame(one.message_id, *one.values)
            log += (1_700_000_000_000_000 + t_us).to_bytes(8, "big") + frame
    return bytes(log)


def test_a_telemetry_log_is_a_flight(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes(a_log(50))
    flight = TlogFlight(path, AIRFRAME)
    assert (flight.begin, flight.end) == pytest.approx((3.0, 3.96), abs=0.05)
    assert flight.worst is not None
    assert flight.worst.margin == pytest.approx(0.2)
    assert flight.scene(3.5).mode == "hold"
    assert len(flight.trail().points) > 20


def a_flight(wall_s: int, seconds: int, north: float, beside: bool = False) -> bytes:
    """A vehicle that is armed at ``north``, perhaps with a gimbal of its system's number."""
    log = bytearray()
    gimbal = FrameWriter(1, 154)
    at = FLYING.estimate._replace(p_WB=(north, 0.0, -1.0))
    for k in range(10 * seconds):
        t_us = 100_000 * k
        now = replace(FLYING, t_us=t_us, estimate=at._replace(t_us=t_us))
        for one in everything(now):
            frame = WRITERS[one.component].frame(one.message_id, *one.values)
            log += (1_000_000 * wall_s + t_us).to_bytes(8, "big") + frame
        if beside:
            frame = gimbal.frame(ids.HEARTBEAT, 0, 26, 8, 0, 4, 3)
            log += (1_000_000 * wall_s + t_us).to_bytes(8, "big") + frame
    return bytes(log)


def places(path: Path, log: bytes) -> tuple[TlogFlight, list[float]]:
    path.write_bytes(log)
    flight = TlogFlight(path, AIRFRAME)
    scenes = [flight.scene(float(t)) for t in np.arange(flight.begin, flight.end, 0.1)]
    return flight, [scene.estimate.p[0] for scene in scenes if scene.estimate]


def test_where_a_log_pauses_nothing_is_known(tmp_path: Path) -> None:
    """The scene before a pause is not what was in it."""
    log = bytearray()
    for k in (*range(50), *range(1000, 1050)):
        t_us = 20_000 * k
        now = replace(FLYING, t_us=t_us, estimate=FLYING.estimate._replace(t_us=t_us))
        for one in everything(now):
            frame = WRITERS[one.component].frame(one.message_id, *one.values)
            log += (1_000_000_000 + t_us).to_bytes(8, "big") + frame
    flight, _ = places(tmp_path / "paused.tlog", bytes(log))
    assert flight.scene(0.5).margins
    assert flight.scene(20.5).margins
    paused = flight.scene(10.0)
    assert (paused.estimate, paused.margins, paused.armed, paused.t) == (None, (), None, 10.0)


@pytest.mark.parametrize("lengths", [(6, 12), (12, 6)])
def test_flights_of_one_log_are_shown_one_after_another_and_told(
    lengths: tuple[int, int], tmp_path: Path
) -> None:
    log = a_flight(1000, lengths[0], 1.0) + a_flight(2000, lengths[1], 2.0)
    flight, north = places(tmp_path / "two.tlog", log)
    assert north == sorted(north)
    assert north.count(1.0) == pytest.approx(10 * lengths[0], abs=12)
    assert north.count(2.0) == pytest.approx(10 * lengths[1], abs=12)
    (told,) = flight.unusable
    assert told.startswith("2 flights, one after another: new ones at ")
    times = [event.t for event in flight.events]
    assert times == sorted(times)


def test_of_many_restarts_the_first_are_told_and_how_many_more(tmp_path: Path) -> None:
    log = b"".join(a_flight(1000 + 10 * k, 6, 1.0) for k in range(40))
    flight, _ = places(tmp_path / "many.tlog", log)
    (told,) = flight.unusable
    assert told.startswith("40 flights, one after another: new ones at ")
    assert told.endswith(" s and 29 more")
    assert len(told) < 150


@pytest.mark.parametrize(
    "junk", [b"\0" * 5, b"\xfd" * 40, b"\xfe\xff\xfd\x05junk", bytes(range(256))]
)
def test_junk_in_a_log_is_skipped_and_told(junk: bytes, tmp_path: Path) -> None:
    whole = a_flight(1000, 6, 1.0)
    at = whole.index((1_003_000_000).to_bytes(8, "big"))
    flight, north = places(tmp_path / "junk.tlog", whole[:at] + junk + whole[at:])
    assert len(north) >= 55
    assert flight.end == pytest.approx(5.9, abs=0.05)
    assert flight.unusable == (f"{len(junk)} bytes are no frames, and are skipped",)
    cut, _ = places(tmp_path / "cut.tlog", whole[:-5])
    assert "are no frames" in cut.unusable[0]


@pytest.mark.long
def test_a_gap_of_zeros_is_passed_and_a_flood_of_markers_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = a_flight(1000, 6, 1.0)
    flight, _ = places(tmp_path / "gap.tlog", whole + bytes(5_000_000) + a_flight(2000, 6, 2.0))
    assert "2 flights" in flight.unusable[0]
    assert flight.unusable[1].startswith("5000000 bytes")
    monkeypatch.setattr(tlog_reader, "_MAX_FAILED", 100_000)  # a million take 4 s
    flooded, _ = places(tmp_path / "flood.tlog", whole + b"\xfd" * 200_000)
    assert flooded.unusable == (
        "100000 bytes are no frames, and are skipped",
        "the last 100000 bytes follow too much that is no frame",
    )


def test_half_a_megabyte_of_junk_between_two_flights_hides_neither(tmp_path: Path) -> None:
    junk = np.random.default_rng(3).bytes(500_000)
    log = a_flight(1000, 6, 1.0) + junk + a_flight(2000, 6, 2.0)
    flight, north = places(tmp_path / "junk.tlog", log)
    assert {round(x) for x in north} == {1, 2}
    assert flight.unusable[1] == "500000 bytes are no frames, and are skipped"


def test_an_unknown_frame_at_the_very_end_is_no_reason_to_fail(tmp_path: Path) -> None:
    whole = a_flight(1000, 6, 1.0)
    unknown = b"\xfd\x00\x00\x00\x00\x07\x01\xff\xff\x7f" + bytes(2)
    flight, _ = places(tmp_path / "end.tlog", whole + bytes(8) + unknown + bytes(8) + b"\xfd\x01")
    assert flight.end == pytest.approx(5.9, abs=0.05)


def test_another_vehicle_in_the_log_is_named(tmp_path: Path) -> None:
    other = FrameWriter(9, 1).frame(ids.ATTITUDE, *[0] * 7)
    log = a_flight(1000, 6, 1.0) + (1_007_000_000).to_bytes(8, "big") + other
    flight, _ = places(tmp_path / "two.tlog", log)
    assert flight.unusable == ("of several vehicles system 1 is shown, not 9",)


def test_another_component_of_the_vehicle_s_system_is_not_the_vehicle(tmp_path: Path) -> None:
    flight, _ = places(tmp_path / "gimbal.tlog", a_flight(1000, 6, 1.0, beside=True))
    assert flight.unusable == ()
    assert all(flight.scene(0.1 * k).armed for k in range(60))


def test_a_log_of_another_vehicle_says_whose_it_is(tmp_path: Path) -> None:
    path = tmp_path / "other.tlog"
    frame = FrameWriter(7, 1).frame(ids.HEARTBEAT, 0, 2, 12, 0, 4, 3)
    path.write_bytes((1_000_000).to_bytes(8, "big") + frame)
    with pytest.raises(UlogError, match="it has messages of system 7"):
        TlogFlight(path, AIRFRAME)


def test_what_is_no_telemetry_log_is_refused_in_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"no log at all")
    with pytest.raises(UlogError, match="no telemetry log with positions"):
        TlogFlight(path, AIRFRAME)
