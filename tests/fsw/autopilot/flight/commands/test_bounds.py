"""What is believed of what others say: the bounds, one set of them for all messages."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fsw.autopilot.flight.commands.bounds import (
    MAX_CLEARANCE,
    MAX_YAW,
    motion_refusal,
    place_problem,
    safe_set_problem,
    step_problem,
    target_problem,
    upload_problem,
    zone_problem,
)
from fsw.autopilot.shapes.ball import ball, point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.shapes.vertical_cylinder import column
from fsw.autopilot.signals import (
    EndEffectorTarget,
    MissionAction,
    MissionStep,
    MissionUpdate,
    MotionSetpoint,
    SafeSet,
    Shape,
    Vec3,
    Zone,
)

F32MAX = 3.4028234663852886e38
PERSON = Zone(ball((3.0, 0.0, -1.0), 0.3), 0.1, velocity=(0.6, 0.8, 0.0), t_us=1)
REST: Vec3 = (0.0, 0.0, 0.0)
TARGET = EndEffectorTarget(5_000_000, (0.0, 0.0, -1.0), REST, REST)
GO = MissionStep(MissionAction.GO, (1.0, 0.0, -1.0))


@pytest.mark.parametrize(
    "zone",
    [
        wall((-1.0, 0.0, 0.0), 1000.0, MAX_CLEARANCE),
        point((600.0, 0.0, -600.0), 0.1),
        column((3.0, 4.0), 0.5),  # without end
        target_sphere((0.0, 0.0, -0.225), 0.075),
        PERSON,
    ],
)
def test_what_a_vehicle_may_meet_is_believed(zone: Zone) -> None:
    assert zone_problem(zone, 1.0) is None


@pytest.mark.parametrize(
    ("zone", "words"),
    [
        (wall((-1.0, 0.0, 0.0), 1e30, 0.1), "offset"),
        (wall((-1.0, 0.0, 0.0), math.nan, 0.1), "offset"),
        (wall((-1.0, 0.0, 0.0), 0.0, -0.01), "clearance of -0.01 m"),
        (Zone(Shape("ball", (1.0,)), 0.1), "4 numbers"),
        (point((0.0, 0.0, -50.0), 1e20), "clearance of 1e+20 m"),
        (point((0.0, 0.0, -1.4), 50.0), "clearance of 50 m"),
        (point((0.0, 1001.0, 0.0), 0.1), "at most 1000"),
        (point((0.0, 0.0, 0.0), math.nan), "clearance of nan"),
        (column((2e3, 0.0), 0.5), "north"),
        (target_sphere((F32MAX,) * 3, F32MAX), "at most 1000"),
        (target_sphere(REST, math.inf), "radius"),
        (replace(PERSON, velocity=(1.001, 0.0, 0.0)), "SUR_V_ZONE"),
        (replace(PERSON, velocity=(0.0, math.nan, 0.0)), "SUR_V_ZONE"),
        (replace(target_sphere(REST, 0.3), velocity=(0.1, 0.0, 0.0)), "follows the target"),
        (Zone(Shape("cube", (1.0,)), 0.1), "no such shape"),
    ],
)
def test_what_is_out_of_bounds_is_named_with_the_bound(zone: Zone, words: str) -> None:
    problem = zone_problem(zone, 1.0)
    assert problem is not None
    assert words in problem
    assert (
        safe_set_problem(SafeSet((PERSON, zone)), 1.0) == f"zone 2 ({zone.shape.kind}): {problem}"
    )


def test_what_is_rounded_to_float32_on_the_link_may_be_just_at_its_bound() -> None:
    north, east = (float(np.float32(1.5 * part)) for part in (0.28, 0.96))
    assert math.hypot(north, east) > 1.5
    assert zone_problem(replace(PERSON, velocity=(north, east, 0.0)), 1.5) is None
    yaw = float(np.float32(MAX_YAW))
    assert yaw > MAX_YAW
    assert motion_refusal(MotionSetpoint(True, (0.0, 0.0, -2.0), yaw=yaw)) is None


@pytest.mark.parametrize(
    "wrong",
    [
        {"p_WE": (0.0, 0.0, -1001.0)},
        {"p_WE": (math.nan, 0.0, 0.0)},
        {"v_WE": (0.0, 0.0, 20.1)},
        {"a_WE": (math.inf, 0.0, 0.0)},
        {"yaw": math.nan},
        {"t_us": 2**64 - 1},
        {"t_us": 5_000_000 - 3_600_000_001},
    ],
)
def test_a_target_out_of_bounds_or_of_another_clock_is_not_believed(
    wrong: dict[str, object],
) -> None:
    assert target_problem(TARGET, 5_000_000) is None
    assert target_problem(replace(TARGET, **wrong), 5_000_000)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wrong",
    [
        {"position": (0.0, 1000.1, 0.0)},
        {"position": (0.0, 0.0, math.nan)},
        {"yaw": math.inf},
        {"speed": 0.0},
        {"speed": math.inf},
        {"hold_s": 3601.0},
        {"hold_s": math.nan},
        {"acceptance": math.nan},
    ],
)
def test_a_mission_with_a_step_out_of_bounds_is_refused_whole(wrong: dict[str, object]) -> None:
    assert step_problem(replace(GO, hold_s=math.inf)) is None, "it stays until it is commanded"
    bad = replace(GO, **wrong)  # type: ignore[arg-type]
    assert step_problem(bad)
    update = MissionUpdate(steps=(GO, bad), current=0, rally=((1.0, 2.0),))
    assert (upload_problem(update) or "").startswith("mission refused: item 1: ")
    assert upload_problem(replace(update, steps=(GO,))) is None


def test_a_place_is_within_a_kilometre() -> None:
    assert place_problem((600.0, 0.0, -800.0)) is None
    assert place_problem((600.0, 0.0, -800.1))
    assert place_problem((math.nan, 0.0, 0.0))
    assert "rally" in (upload_problem(MissionUpdate(rally=((1e5, 0.0),))) or "")
