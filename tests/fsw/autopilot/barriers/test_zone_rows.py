"""Rows of the full body beside every kind of zone, and which of them a program needs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.barriers.margins import Margins
from fsw.autopilot.barriers.nearest_place import nearest_place
from fsw.autopilot.barriers.zone_rows import ZoneRows, layout
from fsw.autopilot.model.airframe import AIRFRAME, airframe_of
from fsw.autopilot.model.body import DISC, FORM, ON, RADIUS, SPHERE, Body, body_of
from fsw.autopilot.model.kinematics import position, velocity
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.parts import Part
from fsw.autopilot.model.prediction import Array, condense
from fsw.autopilot.mpc.ocp import Ocp
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.shapes.ball import ball, point
from fsw.autopilot.shapes.box import box
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.shapes.zones import zone_arrays
from fsw.autopilot.signals import SafeSet, Shape, Vec3, Zone
from tests.fsw.autopilot.barriers.horizons import (
    BETA,
    MODEL,
    NODES,
    PERIOD,
    POINTS,
    TUNING,
    Case,
    random_case,
    safe_speed,
)
from tests.fsw.autopilot.mpc.requests import below, hovering, planned, planner, request
from tests.fsw.autopilot.shapes import by_coal
from tests.fsw.paper_arm import INPUTS
from tests.fsw.random_states import random_estimate, vec3
from tests.fsw.vehicle_places import placed
from vehicles.description import EndEffector, Vehicle
from vehicles.vehicle_file import load_vehicle

FULL = body_of("full", AIRFRAME)
OUT = [
    Zone(ball((0.3, -0.8, -1.0), 0.3), 0.1),
    Zone(box((1.0, 0.5, 0.0), (0.4, 0.3, 0.8), (0.8, 0.0, 0.6, 0.0)), 0.05),
    Zone(Shape("cylinder", (-1.0, 1.0, -2.0, 1.5, 1.2, 1.0, 0.2)), 0.1),
    Zone(Shape("vertical cylinder", (0.5, -1.5, -3.0, 0.0, 0.4)), 0.1),
    wall((0.0, 0.6, 0.8), -2.0, 0.05),
]
ROOM = Zone(box((0.0, 0.0, 0.0), (4.0, 5.0, 6.0), (0.8, 0.0, 0.6, 0.0)), 0.1, keep_in=True)
TANK = Zone(Shape("cylinder", (0.0, 0.0, -5.0, 0.5, 0.0, 5.0, 4.0)), 0.1, keep_in=True)


def rows_of(zones: tuple[Zone, ...], *, distances: bool = False, body: Body = FULL) -> ZoneRows:
    return ZoneRows(SafeSet(zones), body, MODEL, (TUNING, TUNING), distances=distances)


def at_us(targets: TargetPoints, t_us: int) -> TargetPoints:
    return replace(targets, t_us=t_us)


@pytest.mark.parametrize("distances", [True, False])
@pytest.mark.parametrize("zone", [*OUT, ROOM, TANK], ids=lambda one: one.shape.kind)
def test_rows_are_h_of_the_nearest_place_and_their_slopes_its_differences(
    zone: Zone, distances: bool
) -> None:
    """By differences over the inputs, with place and normal of the guess."""
    case, w, node = random_case(np.random.default_rng(7)), (0.3, -0.2, 0.1), 3
    moving = SafeSet((replace(zone, velocity=w),))
    rows = rows_of(moving.zones, distances=distances)
    rows.refill(case.horizon(), case.targets)
    shift = PERIOD * node * np.array([w])
    zones, probes, step = zone_arrays(moving), FULL.probes, 1e-5
    frame = case.horizon().horizon.frames[node]
    unit = np.eye(INPUTS * NODES)[: INPUTS * node : 4]
    moved = [
        [case.horizon(sign * step * e).horizon.frames[node] for sign in (1.0, -1.0)] for e in unit
    ]
    at_node = np.flatnonzero(rows.rows.node == node).reshape(len(probes), -1)
    forms = set()
    for b, of_probe in enumerate(at_node):
        on, radius = int(probes[b, ON]), probes[b, RADIUS]
        for which, row in enumerate(of_probe):
            local, at, binds = nearest_place(zones, 0, which, tuple(shift[0]), probes, b, frame)
            value, gradient = rows.rows.value[row], rows.rows.gradient[row]
            assert bool(value < 900.0) is binds
            if not binds:
                assert not gradient.any()
                continue
            forms.add(int(probes[b, FORM]))
            n, here = np.array(at.normal), position(frame, on, local)

            def h(
                seen: Array, on: int = on, local: Vec3 = local, n: Array = n, here: Vec3 = here,
                d: float = at.distance - radius,
            ) -> float:  # fmt: skip
                d += float(n @ np.subtract(position(seen, on, local), here))
                if distances:
                    return d
                return safe_speed(d) + float(n @ np.subtract(velocity(seen, on, local), w))

            assert value == pytest.approx(h(frame), abs=1e-9)
            expected = [(h(above) - h(below)) / (2.0 * step) for above, below in moved]
            np.testing.assert_allclose(unit @ gradient, expected, atol=1e-6)
    assert {SPHERE, DISC} <= forms


@pytest.mark.parametrize("zone", [*OUT, ROOM], ids=lambda one: one.shape.kind)
def test_a_zone_in_motion_is_the_vehicle_in_motion_the_other_way(zone: Zone) -> None:
    """Galilean: only the velocity between them counts."""
    case = random_case(np.random.default_rng(8))
    w: Vec3 = (0.4, -0.3, 0.2)
    moving = rows_of((replace(zone, velocity=w),))
    moving.refill(case.horizon(), case.targets)
    seen_from_zone = Case(case.start.copy(), case.inputs, case.targets)
    seen_from_zone.start[3:6] -= w
    still = rows_of((zone,))
    still.refill(seen_from_zone.horizon(), case.targets)
    for name in ("start", "value", "lower_bound", "gradient"):
        np.testing.assert_allclose(
            getattr(moving.rows, name), getattr(still.rows, name), atol=1e-9, err_msg=name
        )


def test_a_zone_is_where_it_is_at_the_time_of_each_node() -> None:
    case = random_case(np.random.default_rng(9))
    begin: Vec3 = (0.3, -0.8, -1.0)
    moving = rows_of((Zone(ball(begin, 0.3), 0.1, velocity=(1.0, 0.0, 0.0), t_us=500_000),))
    moving.refill(case.horizon(), at_us(case.targets, 700_000))
    for node in range(2, NODES + 1):
        ahead = 0.2 + PERIOD * node
        there = rows_of((Zone(ball((begin[0] + ahead, *begin[1:]), 0.3), 0.1),), distances=True)
        here = rows_of((Zone(ball(begin, 0.3), 0.1, velocity=(1.0, 0.0, 0.0), t_us=500_000),),
                       distances=True)  # fmt: skip
        there.refill(case.horizon(), case.targets)
        here.refill(case.horizon(), at_us(case.targets, 700_000))
        of_node = here.rows.node == node
        np.testing.assert_allclose(here.rows.value[of_node], there.rows.value[of_node], atol=1e-9)


def middle_of(part: Part, on: tuple[Array, Rotation]) -> by_coal.Solid:
    """A part without its radius: Coal measures a point, a line or a disc."""
    origin, turned = on
    begin = origin + turned.apply(part.begin)
    if part.rim > 0.0:
        return by_coal.disc(begin, turned, part.rim)
    if part.end is not None:
        return by_coal.capsule(begin, origin + turned.apply(part.end), 1e-9)
    return by_coal.ball_at(begin, 0.0)


@pytest.mark.drawn(3)
@pytest.mark.parametrize("kind", ["half-space", "ball", "box", "cylinder", "vertical cylinder"])
def test_margins_of_the_full_body_are_coals_distances(kind: str) -> None:
    margins = Margins(FULL, AIRFRAME.bodies, (TUNING, TUNING), PERIOD)
    random, compared = np.random.default_rng(1), 0
    for _ in range(40):
        estimate = random_estimate(random)._replace(p_WB=vec3(random.uniform(-1.5, 1.5, 3)))
        shape = by_coal.random_shape(kind, random)
        zone, solid = Zone(shape, 0.05), by_coal.solid(shape)
        report, on = margins.report(SafeSet((zone,)), estimate, None), placed(estimate)
        for part, margin in zip(FULL.parts, report.margins, strict=True):
            between = by_coal.between(solid, middle_of(part, on[part.on]))
            if between > 0.0:  # Coal's depth in a cylinder is not the least
                compared += 1
                expected = between - part.radius - 0.05
                tolerance = 2e-3 if part.rim > 0.0 else 2e-4
                assert margin == pytest.approx(expected, abs=tolerance), part.name
    assert compared > 200


def test_rows_that_no_input_can_make_bind_change_no_optimum() -> None:
    config = PlannerConfig()
    far = SafeSet((wall((-1.0, 0.0, 0.0), -1.0, 0.1), point((30.0, 0.0, 0.0), 0.2)))
    near = SafeSet(far.zones[:1])
    start = hovering((0.5, 0.0, -1.2))
    asked = request(start, below((2.0, 0.3, -1.2)), far)
    both = planned(planner(config).plan(asked))
    alone = planned(planner(config).plan(replace(asked, safe_set=near)))
    for one, other in zip(both.inputs, alone.inputs, strict=True):
        np.testing.assert_allclose(one.a, other.a, atol=1e-6)
    rows = ZoneRows(
        far, body_of("points", AIRFRAME), MODEL, (TUNING, TUNING), most=config.limits.most
    )
    case = Case(
        np.zeros(19), np.zeros(INPUTS * NODES), random_case(np.random.default_rng(1)).targets
    )
    rows.refill(case.horizon(), case.targets)
    left_out = ~rows.rows.gradient.any(axis=1)
    assert 0 < left_out.sum() < len(left_out)
    full = rows_of(far.zones, body=body_of("points", AIRFRAME))
    full.refill(case.horizon(), case.targets)
    random = np.random.default_rng(2)
    level, vertical, yaw, joint = config.limits.most
    most = np.tile([level, level, vertical, yaw, joint, joint], NODES)
    for _ in range(200):
        inputs = random.choice([-1.0, 1.0], INPUTS * NODES) * most
        reached = full.rows.value + full.rows.gradient @ inputs - full.rows.lower_bound
        assert (reached[left_out] > 0.0).all()


@pytest.mark.parametrize("scale", [1.0, 1.5, 20.0])
def test_on_a_vehicle_of_any_size_no_row_is_left_out_that_binds(scale: float) -> None:
    """Against all rows under inputs at their limits; the arm is as long as the vehicle says."""
    airframe = airframe_of(scaled(scale))
    model, body, config = (
        condense(airframe, PERIOD, NODES),
        body_of("full", airframe),
        PlannerConfig(),
    )
    case, random = random_case(np.random.default_rng(1)), np.random.default_rng(2)
    horizon = Linearisation(model)
    horizon.refill(np.zeros(19), np.zeros(INPUTS * NODES))
    level, vertical, yaw, joint = config.limits.most
    most = np.tile([level, level, vertical, yaw, joint, joint], NODES)
    inputs = random.choice([-1.0, 1.0], (300, INPUTS * NODES)) * most
    some = 0
    for far in np.geomspace(2.0, 20_000.0, 40):
        zones = SafeSet((wall((1.0, 0.0, 0.0), -float(far), 0.1),))
        rows = ZoneRows(zones, body, model, (TUNING, TUNING), most=config.limits.most)
        whole = ZoneRows(zones, body, model, (TUNING, TUNING))
        for one in (rows, whole):
            one.refill(horizon, case.targets)
        left_out = ~rows.rows.gradient.any(axis=1) & whole.rows.gradient.any(axis=1)
        some += int(left_out.sum())
        reached = whole.rows.value + inputs @ whole.rows.gradient.T - whole.rows.lower_bound
        assert (reached[:, left_out] > 0.0).all()
    assert some > 0


def scaled(scale: float) -> Vehicle:
    """Paper's vehicle, every length of its arm so many times as large."""
    paper = load_vehicle("paper")

    def longer(v: Vec3) -> Vec3:
        return scale * v[0], scale * v[1], scale * v[2]

    joints = tuple(
        replace(one, xyz=longer(one.xyz), link=replace(one.link, com=longer(one.link.com)))
        for one in paper.joints
    )
    tip = EndEffector(position=longer(paper.end_effector.position))
    return replace(paper, joints=joints, end_effector=tip)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_row_that_is_no_number_is_not_left_out(bad: float) -> None:
    config = PlannerConfig()
    safe_set = SafeSet((point((bad, 0.0, 0.0), 0.2),))
    rows = ZoneRows(
        safe_set, body_of("points", AIRFRAME), MODEL, (TUNING, TUNING), most=config.limits.most
    )
    case = random_case(np.random.default_rng(1))
    rows.refill(case.horizon(), case.targets)
    assert not np.isfinite(rows.rows.value).any()


def test_a_zone_that_moves_changes_numbers_of_the_program_and_one_more_its_rows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    built: list[SafeSet] = []
    init = Ocp.__init__

    def counted(self: Ocp, config: PlannerConfig, model: object, safe_set: SafeSet) -> None:
        built.append(safe_set)
        init(self, config, model, safe_set)  # type: ignore[arg-type]

    monkeypatch.setattr(Ocp, "__init__", counted)
    used = planner()
    start, target = hovering((0.0, 0.0, -1.2)), below((2.0, 0.0, -1.2))
    zones = [Zone(ball((x, 0.0, -1.0), 0.3), 0.1) for x in (0.9, 1.0)]
    for safe_set in (SafeSet((zones[0],)), SafeSet((zones[1],))):
        moved = planned(used.plan(request(start, target, safe_set)))
        fresh = planned(planner().plan(request(start, target, safe_set)))
        assert moved.barrier == fresh.barrier
    assert len([one for one in built if one == SafeSet((zones[1],))]) == 1, "its own, not ours"
    count = len(built)
    used.plan(request(start, target, SafeSet((zones[0], zones[1]))))
    assert len(built) == count + 1


def test_the_layout_is_kinds_and_sides_in_order() -> None:
    out, kept_in = OUT[0], replace(OUT[0], keep_in=True)
    other = replace(out, clearance=0.3, velocity=(1.0, 0.0, 0.0))
    assert layout(SafeSet((out, kept_in))) == layout(SafeSet((other, kept_in)))
    assert layout(SafeSet((out, kept_in))) != layout(SafeSet((kept_in, out)))
    assert layout(SafeSet((out,))) != layout(SafeSet((out, target_sphere((0.0, 0.0, 0.0), 1.0))))


def test_rows_ask_for_less_after_little_disturbance_but_not_in_a_sphere_that_follows() -> None:
    front, sphere = wall((-1.0, 0.0, 0.0), -1.0, 0.1), target_sphere((0.0, 0.0, -0.2), 0.3)
    case = random_case(np.random.default_rng(3))
    rows = ZoneRows(
        SafeSet((front, sphere)), POINTS, MODEL, (TUNING, TUNING), least_lambda=0.5 * TUNING.lambda_
    )
    rows.refill(case.horizon(), case.targets)
    whole = rows.rows.lower_bound.copy()
    rows.refill(case.horizon(), replace(case.targets, recent_disturbance=0.0))
    less = whole - rows.rows.lower_bound
    node, at_wall = rows.rows.node, rows.rows.slack % 2 == 0
    expected = (1.0 - BETA**node) * 0.5 * TUNING.lambda_
    assert less[at_wall] == pytest.approx(expected[at_wall])
    assert not less[~at_wall].any()
    # Nothing is left of it where a disturbance is known to be there, or is not known.
    rows.refill(case.horizon(), replace(case.targets, recent_disturbance=math.inf))
    assert np.array_equal(rows.rows.lower_bound, whole)
