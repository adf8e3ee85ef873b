"""What telemetry says of the safe set agrees with what the planner is held to."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.barriers.margins import Margins
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.body import body_of
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import (
    ConstraintKind,
    EndEffectorTarget,
    SafeSet,
    StateEstimate,
    Touch,
    Zone,
)
from fsw.frozen import replace
from tests.fsw.autopilot.barriers.horizons import (
    PERIOD,
    POINTS,
    TUNING,
    Case,
    barrier_of,
    measured,
    random_case,
    safe_speed,
)
from tests.fsw.autopilot.model.geometry_by_rotation import attitude, moved_on
from tests.fsw.random_states import estimate_of, vec3

MARGINS = Margins(POINTS, AIRFRAME.bodies, (TUNING, TUNING), PERIOD)
WALLS = (wall((-1.0, 0.0, 0.0), -1.0, 0.1), wall((0.0, 0.6, 0.8), -2.0, 0.05))
BRANCHES = (point((0.4, -0.3, -1.0), 0.2), point((2.0, 1.0, 0.0), 0.1))
SPHERE = target_sphere((0.0, 0.0, -0.225), 0.5)


def estimate_at_start(case: Case) -> StateEstimate:
    """The vehicle that the prediction starts from, as the estimator would have it."""
    x, moment = case.start, 1e-5
    now = attitude(x[6:9], x[13])
    before, after = (moved_on(x, t) for t in (-moment, moment))
    turned = attitude(before[6:9], before[13]).inv() * attitude(after[6:9], after[13])
    w_WB_B = turned.as_rotvec() / (2.0 * moment)
    (q1, q2), (qd1, qd2) = x[15::2].tolist(), x[16::2].tolist()
    return estimate_of(now, vec3(w_WB_B), vec3(x[0:3]), vec3(x[3:6]), (q1, q2), (qd1, qd2))


def target_at_start(case: Case) -> EndEffectorTarget:
    p, v = case.targets.position[0], case.targets.velocity[0]
    return EndEffectorTarget(0, vec3(p), vec3(v), (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("zones", "kind"),
    [
        (WALLS, ConstraintKind.WALLS),
        ((WALLS[0], *BRANCHES), ConstraintKind.OBSTACLES),
        ((SPHERE,), ConstraintKind.WORKSPACE),
        ((WALLS[0], SPHERE, BRANCHES[1]), ConstraintKind.WORKSPACE),
    ],
    ids=["walls", "walls and points", "sphere", "all at once"],
)
def test_the_report_equals_the_rows_at_the_start(
    zones: tuple[Zone, ...], kind: ConstraintKind
) -> None:
    random = np.random.default_rng(1)
    for _ in range(10):
        case = random_case(random)
        barrier = barrier_of(zones)
        barrier.refill(case.horizon(), case.targets)
        report = MARGINS.report(SafeSet(zones), estimate_at_start(case), target_at_start(case))
        assert report.kind is kind
        np.testing.assert_allclose(report.barrier, barrier.rows.start, atol=1e-6)


def test_margins_are_distances_zone_by_zone_and_point_by_point() -> None:
    random = np.random.default_rng(3)
    for _ in range(10):
        case = random_case(random)
        report = MARGINS.report(
            SafeSet((BRANCHES[0], SPHERE, BRANCHES[1])),
            estimate_at_start(case),
            target_at_start(case),
        )
        position = measured(case.horizon())[0][0]
        first, second = (
            [float(np.linalg.norm(p - one.shape.numbers[:3])) - one.clearance for p in position]
            for one in BRANCHES
        )
        centre = case.targets.position[0] + SPHERE.shape.numbers[:3]
        inside = 0.5 - float(np.linalg.norm(position[0] - centre))
        assert report.margins == pytest.approx((*first, inside, *second))


def test_wall_margin_is_the_distance_that_is_left_in_order_of_the_points() -> None:
    ahead = SafeSet((wall((-1.0, 0.0, 0.0), -1.0, 0.1),))
    reaching_out = estimate_of(
        Rotation.identity(), p_WB=(0.7, 0.0, -1.0), q_arm=(0.5 * math.pi, 0.0)
    )
    report = MARGINS.report(ahead, reaching_out, None)
    assert report.margins == pytest.approx((0.2, 0.05, -0.1))


def test_sphere_report_is_the_papers_pair_at_the_start() -> None:
    random = np.random.default_rng(2)
    for _ in range(20):
        case = random_case(random)
        case.targets.position[0] = case.start[0:3] + random.uniform(-0.2, 0.2, 3)
        report = MARGINS.report(SafeSet((SPHERE,)), estimate_at_start(case), target_at_start(case))
        e = case.start[0:3] - case.targets.position[0] - np.array(SPHERE.shape.numbers[:3])
        w = case.start[3:6] - case.targets.velocity[0]
        rho = float(np.linalg.norm(e))
        assert report.margins == pytest.approx((0.5 - rho,))
        outward = float(e @ w) / rho
        pair = safe_speed(0.5 - rho) - outward, safe_speed(0.5 + rho) + outward
        assert report.barrier == pytest.approx((min(pair),))


def test_sphere_report_at_the_centre_is_a_number() -> None:
    sphere = target_sphere((0.0, 0.0, -0.225), 0.075)
    target = EndEffectorTarget(0, (0.0, 0.0, 0.225), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    moving = estimate_of(Rotation.identity(), p_WB=(0.0, 0.0, 0.0), v_WB=(1.0, -2.0, 0.5))
    report = MARGINS.report(SafeSet((sphere,)), moving, target)
    assert report.margins == (0.075,)
    assert np.isfinite(report.barrier).all()


def test_open_space_and_a_sphere_without_target_report_nothing() -> None:
    estimate = estimate_of(Rotation.identity())
    assert MARGINS.report(SafeSet(), estimate, None).margins == ()
    assert MARGINS.report(SafeSet((SPHERE,)), estimate, None).margins == ()


@pytest.mark.requirement("REQ-SAFE-13")
def test_of_a_wall_that_may_be_touched_only_the_tool_has_no_margin() -> None:
    """The others' are those of any wall, in the same order."""
    full, case = body_of("full", AIRFRAME), random_case(np.random.default_rng(3))
    margins = Margins(full, AIRFRAME.bodies, (TUNING, TUNING), PERIOD)
    touched = replace(WALLS[0], touch=Touch(10.0, 1e3, 1e4))
    now = estimate_at_start(case)
    kept = margins.report(SafeSet((WALLS[0], WALLS[1])), now, None)
    seen = margins.report(SafeSet((touched, WALLS[1])), now, None)
    tool = [k for k, part in enumerate(full.parts) if part.tool]
    assert {full.parts[k].name for k in tool} == {"end_effector", "link2"}
    count = len(full.parts)
    others = [k for k in range(count) if k not in tool]
    assert seen.per_zone == (count - 2, count)
    assert seen.margins == tuple(kept.margins[k] for k in others) + kept.margins[count:]
    assert seen.barrier == tuple(kept.barrier[k] for k in others) + kept.barrier[count:]
