"""A flight that never was, whose every number is known: its log and the results beside it."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any

from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import MessageSource, SafeSet, SafeSetAnnouncement, TickInputs, Zone
from fsw.autopilot.tuning import flat
from fsw.log import topics
from fsw.log.json_codec import JsonCodec
from messages import ulog
from messages.ground_truth import FIRST_NUMBER, TRUTH_TOPICS
from sitl.scenario_file import scenario_digest

SECONDS = 4
BEGIN_US = 1_000_000
HEIGHT = -1.4  # m, NED
SPIKE_S, SPIKE_N = 2.002, 17.0  # a single tick
WORST_S, WORST_M = 3.013, 0.0123  # between two samples of the log
ERROR_M = (0.003, 0.004, 0.0)  # of the end-effector
OFFSET_M = (0.001, -0.002, 0.0005)  # of the estimate
CYCLES_US = (400.0, 900.0, 300.0, 2000.0)
BALL = Zone(ball((0.3, 0.8, -1.5), 0.05), 0.1)
TEXT = 'it\'s "</script><b>wet</b>"'
BY_NAME = {topic.name: topic for topic in (*topics.TOPICS, *TRUTH_TOPICS)}
NUMBERS = {topic.name: k for k, topic in enumerate(topics.TOPICS)} | {
    topic.name: FIRST_NUMBER + k for k, topic in enumerate(TRUTH_TOPICS)
}


def north(t: float) -> float:
    """Where the base is at ``t`` [s since the start] [m]: nearest to the wall at 3 s."""
    return 0.85 - 0.1 * abs(t - 3.0)


def record(name: str, t_s: float, *values: Any) -> bytes:
    """One record; fields at its end that nothing here looks at are 0."""
    topic = BY_NAME[name]
    head = ulog.data_head(NUMBERS[name], topic)
    rest = (0,) * (sum(field.values for field in topic.fields) - len(values))
    return head + struct.pack("<" + topic.codes, BEGIN_US + round(1e6 * t_s), *values, *rest)


def write_flight(directory: Path, seconds: int = SECONDS, **result: Any) -> Path:
    """The directory of a flight of ``walls``; ``result`` replaces keys of result.json."""
    directory.mkdir(parents=True)
    data = _definitions() + b"".join(_records(seconds))
    (directory / "flight.ulg").write_bytes(data)
    limits = {"tilt": {"unit": "rad", "most": 0.4, "largest": 0.1, "at_s": 1.0, "beyond_s": 0.0,
                       "kept": True}}  # fmt: skip
    found = {
        "scenario": "walls", "controller": "blf", "seed": 3, "vehicle": "paper",
        "sensors": "mocap",
        "duration_s": 4.0, "completed": True, "end_reason": "flew 4.0 s",
        "tracking_error_rms_m": 0.005, "control_effort": {"sum": 1.0, "mean": 0.1},
        "control_smoothness": {"sum": 1.0, "mean": 0.1},
        "margins_m": {"front/base": 0.05, "front/end_effector": WORST_M},
        "min_margin_m": WORST_M, "limits": limits, "surfaces_m": {"front/end_effector": 0.1123},
        "beyond_s": {}, "safety": {"breaches": 0, "departures": 0, "interventions": 0},
        "mpc": {"p50_us": None}, "inner": {"p50_us": None}, "real_time_factor": 1.0, "logs": {},
        **result,
    }  # fmt: skip
    (directory / "result.json").write_text(json.dumps(found))
    judged = {"min_margin_m": found["min_margin_m"], "min_margin_time_s": WORST_S,
              "min_margin_key": "front/end_effector", "tracking_error_max_m": 0.01}  # fmt: skip
    (directory / "sitl.json").write_text(json.dumps(judged))
    stage = {"p50_us": 50.0, "p99_us": 90.0, "max_us": 200}
    (directory / "fsw.json").write_text(json.dumps({"stages": {"tick": stage}, "mpc": {}}))
    return directory


def _definitions() -> bytes:
    facts: dict[str, str | int] = {
        "sys_name": "Pandion", "ver_sw": "abc", "scenario": "walls", "seed": 3,
        "scenario_digest": scenario_digest("walls"), "controller": "blf", "inner": "tracking",
        "robustness": "consistent", "solver": "clarabel", "body": "points", "soft": 0,
        "pacing": "realtime", "profile": 0,
        "numbers": json.dumps(flat(flight_config(body="points"))),
    }  # fmt: skip
    parts = [ulog.opening(BEGIN_US), *(ulog.information(*fact) for fact in facts.items())]
    parts += [ulog.format_of(topic) for topic in BY_NAME.values()]
    parts.append(ulog.parameter("PLN_TILT_MAX", 17.0))
    parts += [ulog.subscription(number, BY_NAME[name]) for name, number in NUMBERS.items()]
    return b"".join(parts)


def _records(seconds: int) -> list[bytes]:
    found = [
        _status(0.0, b"hold", b""), _status(0.5, b"trajectory", b""),
        ulog.logged_text(3, BEGIN_US + 2_500_000, TEXT),
        _status(2.75, b"trajectory", b"no plan"), _status(3.5, b"trajectory", b""),
        record("vehicle_command_ack", 0.5, 176, 0, 255, 190),
    ]  # fmt: skip
    found += _announced(0.0, (wall((-1.0, 0.0, 0.0), -1.0, 0.1), BALL))
    found += [_actuators(0.002 * k) for k in range(500 * seconds)]
    for k in range(50 * seconds):
        found += _fast(0.02 * k)
    for k in range(10 * seconds):
        found += _slow(0.1 * k, k)
    return found


def _announced(t: float, zones: tuple[Zone, ...]) -> list[bytes]:
    """A safe set as the log has it: JSON, in pieces."""
    said = (SafeSetAnnouncement(MessageSource(1, 195, "simulator"), SafeSet(zones)),)
    text = JsonCodec(TickInputs).encode("announced", said)
    size = topics.TEXT_SIZE
    pieces = [text[at : at + size] for at in range(0, len(text), size)]
    return [
        record("tick_input", t, b"announced", k, len(pieces), piece)
        for k, piece in enumerate(pieces)
    ]


def _status(t: float, mode: bytes, faults: bytes) -> bytes:
    return record("vehicle_status", t, 2, 4, bool(faults), mode, faults)


def _actuators(t: float) -> bytes:
    first = SPIKE_N if abs(t - SPIKE_S) < 1e-6 else 8.0 + 0.5 * math.sin(9.0 * t)
    thrusts = (first, 8.1, 8.2, 8.3)
    return record("actuator_command", t, *thrusts, 0.1, -0.1, True)


def _fast(t: float) -> list[bytes]:
    p = (north(t), 0.0, HEIGHT)
    level = (1.0, 0.0, 0.0, 0.0)
    still = (0.0, 0.0, 0.0)
    own = [a + b for a, b in zip(p, OFFSET_M, strict=True)]
    return [
        record("sim_ground_truth", t, *p, *still, *level, *still, *(8.0,) * 4, 0.0, 0.0, 0.0, 0.0),
        record("vehicle_local_position", t, *own, *still, 0.0),
        record("vehicle_attitude", t, *level),
        record("arm_joint_state", t, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        record("plan_input", t, 0.1, 0.0, 0.0, 0.0),
        record("arm_joint_setpoint", t, 0.0, 0.0, 0.0, 0.0, 0.5, -0.5),
    ]


def _slow(t: float, k: int) -> list[bytes]:
    target = (north(t), 0.0, HEIGHT + 0.3)
    own = (math.nan,) * topics.MARGINS
    reached = [a + b for a, b in zip(target, ERROR_M, strict=True)]
    took = CYCLES_US[k % len(CYCLES_US)]
    found = [
        record("sim_tracking", t, *reached, *target),
        record("barrier_margin", t, *own, *own, 0.2, 1, 3, 0, 0, 0, 0, *own, 0.0),
        record("mpc_status", t, BEGIN_US, k, k, 0, 0, 1.0, 0.0, 1.0, 1.0, took, 2, k % 5, 0),
        record("estimator_status", t, 0.002, 0.001, *(0.5,) * 5, 0.01, 0.01, 0.0, 0.0, 0,
               0, b""),
    ]  # fmt: skip
    if k % 10 == 0:
        for group in range(4):
            found.append(record("loop_timing", t, 500, 0, 0, 2000, 80.0, 90.0, 120.0,
                                10.0, 20.0, 30.0, group))  # fmt: skip
    return found
