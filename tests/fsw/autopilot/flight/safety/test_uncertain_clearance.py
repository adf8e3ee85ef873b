"""How far clearances grow: with whose uncertainty, when, and where there is no room for it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fsw.autopilot.barriers.safe_approach import BarrierTuning, stand_off
from fsw.autopilot.estimation.error_state import ERRORS, TH, Array, P
from fsw.autopilot.flight.safety.uncertain_clearance import (
    SHORTFALL,
    InflatedSafeSet,
    UncertainClearance,
    place_covariances,
    pose_covariance,
)
from fsw.autopilot.geometry.rotation import yaw_of
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.body import body_of
from fsw.autopilot.model.parts import ON_BASE
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.shapes.box import box
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import SafeSet, StateEstimate, Vec3, Zone
from fsw.autopilot.tuning import tuned
from tests.fsw.paper_arm import LENGTHS
from tests.fsw.random_states import mat3

BARRIERS = (BarrierTuning(), BarrierTuning())
ROOM = stand_off(BARRIERS[0])
NORTH, EAST = wall((-1.0, 0.0, 0.0), -5.0, 0.1), wall((0.0, -1.0, 0.0), -5.0, 0.2)
BOTH = SafeSet((NORTH, EAST))
STEP = 1.1e-3  # m, a little more than a step


def clearance(body: str = "points", sigmas: float = 3.0) -> UncertainClearance:
    walls, workspace = BARRIERS
    config = flight_config(body=body)
    planner = replace(config.planner, walls=walls, workspace=workspace)
    config = replace(config, planner=planner)
    return UncertainClearance(tuned(config, (("limits.clearance_sigmas", sigmas),)), 0.0)


def vehicle(
    t_us: int = 1_000_000,
    turn: Rotation | None = None,
    arm: tuple[float, float] = (np.pi / 2, 0.0),
) -> StateEstimate:
    """A vehicle at the origin, its arm straight ahead unless told otherwise."""
    R = mat3(turn or Rotation.identity())
    none = (0.0, 0.0, 0.0)
    return StateEstimate(t_us, none, none, R, none, yaw_of(R), arm, (0.0, 0.0))


def grown(
    safe_set: SafeSet, pose: Array, body: str = "points", sigmas: float = 3.0
) -> tuple[float, ...]:
    """What is added to each clearance for an uncertainty that lasts."""
    return clearance(body, sigmas).keep(InflatedSafeSet(), safe_set, vehicle(), pose).added


def certain(**deviations: float) -> Array:
    """A covariance with these standard deviations, of x, y, z and of turns about them."""
    names = ("x", "y", "z", "roll", "pitch", "yaw")
    return np.diag([deviations.get(name, 0.0) ** 2 for name in names])


@pytest.mark.requirement("REQ-SAFE-11")
def test_each_clearance_grows_by_the_deviation_along_its_normal() -> None:
    kept = clearance().keep(InflatedSafeSet(), BOTH, vehicle(), certain(x=0.01, y=0.02))
    assert kept.added == pytest.approx((0.03, 0.06), abs=STEP)
    for zone, before, more in zip(kept.safe_set.zones, BOTH.zones, kept.added, strict=True):
        assert zone == replace(before, clearance=before.clearance + more)


def test_an_unknown_heading_moves_the_end_effector_sideways() -> None:
    assert grown(BOTH, certain(yaw=0.1), sigmas=2.0) == pytest.approx((0.0, 0.06), abs=STEP)


def test_exact_states_and_no_sigmas_keep_the_safe_set_itself() -> None:
    for sigmas, pose in ((3.0, None), (0.0, certain(x=1.0)), (3.0, certain())):
        kept = clearance(sigmas=sigmas).keep(InflatedSafeSet(), BOTH, vehicle(), pose)
        assert kept.safe_set is BOTH
        assert clearance(sigmas=sigmas).keep(kept, BOTH, vehicle(), pose).safe_set is BOTH


def test_the_filters_attitude_is_about_the_bodys_axes() -> None:
    M = np.zeros((ERRORS, ERRORS))
    about = np.diag((0.1**2, 0.2**2, 0.3**2))
    M[TH : TH + 3, TH : TH + 3], M[P, P], M[P, TH], M[TH, P] = about, 0.01**2, 1e-4, 1e-4
    turn = Rotation.from_euler("zyx", (30.0, 20.0, -10.0), degrees=True)
    pose, R = pose_covariance(M, vehicle(turn=turn)), turn.as_matrix()
    np.testing.assert_allclose(pose[3:, 3:], R @ about @ R.T, atol=1e-12)
    np.testing.assert_allclose(pose[3:, 0], 1e-4 * R[:, 0], atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3], np.diag((0.01**2, 0.0, 0.0)), atol=1e-12)


def test_a_moments_doubt_does_not_make_it_flee() -> None:
    """A pose that comes a little late while nothing else tells how the vehicle moves."""
    law, set_ = clearance(), SafeSet((NORTH,))
    kept = law.keep(InflatedSafeSet(), set_, vehicle(), certain(x=0.005))
    (before,) = kept.added
    sudden = law.keep(kept, set_, vehicle()._replace(t_us=vehicle().t_us + 100_000), certain(x=0.2))
    assert sudden.added[0] == pytest.approx(before + 0.08, abs=2e-3)


def test_a_place_that_is_lost_leaves_a_bounded_clearance() -> None:
    for size in (1e6, math.inf, math.nan):
        kept = clearance().keep(
            InflatedSafeSet(), SafeSet((NORTH,)), vehicle(), np.diag([size] * 6)
        )
        assert kept.added == pytest.approx((2.0,))


def places(estimate: StateEstimate, seed: int) -> Array:
    """Places all over the full body, seen from its base (n, 3) [m, NED]."""
    random = np.random.default_rng(seed)
    th1, th2 = estimate.q_arm
    first, second = (
        length * np.array((np.sin(angle), 0.0, np.cos(angle)))
        for length, angle in zip(LENGTHS, (th1, th1 + th2), strict=True)
    )
    found = []
    for part in body_of("full", AIRFRAME).parts:
        ends = [(share, np.pi * k / 24.0) for share in (0.0, 1.0) for k in range(48)]
        between = [(random.random(), random.uniform(0.0, 2.0 * np.pi)) for _ in range(10)]
        for share, angle in (*ends, *between):
            begin, end = np.array(part.begin), np.array(part.end or part.begin)
            at = begin + share * (end - begin)
            at = at + part.rim * np.array((np.cos(angle), np.sin(angle), 0.0))
            if part.on != ON_BASE:
                along = at[2]
                at = first * along / LENGTHS[0]
                if part.on == 2:
                    at = first + second * along / LENGTHS[1]
            found.append(at)
    turned: Array = np.array(found) @ np.reshape(estimate.R_WB, (3, 3)).T
    return turned


@pytest.mark.requirement("REQ-SAFE-11")
@given(seed=st.integers(0, 2**32 - 1), full=st.booleans())
def test_no_part_of_the_body_is_less_certain_than_its_clearance(seed: int, full: bool) -> None:
    random = np.random.default_rng(seed)
    root = random.normal(size=(6, 6)) * random.uniform(1e-3, 2e-2)
    pose = root @ root.T
    turn = Rotation.from_rotvec(random.normal(size=3) * 0.3)
    estimate = vehicle(turn=turn, arm=(float(random.uniform(-1, 1)), float(random.uniform(-1, 1))))
    n = random.normal(size=3)
    n /= np.linalg.norm(n)
    normal = (float(n[0]), float(n[1]), float(n[2]))
    zones = SafeSet((wall(normal, -5.0, 0.1), Zone(ball((9.0, 0.0, 0.0), 0.3), 0.1)))
    body = clearance("full")
    flat, round_ = body.keep(InflatedSafeSet(), zones, estimate, pose).added
    covariances = place_covariances(pose, places(estimate, seed))
    along = np.sqrt(np.einsum("i,kij,j->k", n, covariances, n)).max()
    anywhere = np.sqrt(np.linalg.eigvalsh(covariances)[:, -1].max())
    assert flat >= min(3.0 * along, 2.0) - 1e-9
    assert round_ >= min(3.0 * anywhere, 2.0) - 1e-9
    # And not by much more: the octagon around the rim has corners 8 % farther out.
    assert flat <= 1.09 * 3.0 * along + STEP
    assert round_ <= 1.09 * 3.0 * anywhere + STEP


def test_small_changes_leave_the_safe_set_as_it_is_and_growth_is_followed_at_once() -> None:
    body, kept, changes = clearance(), InflatedSafeSet(), 0
    random = np.random.default_rng(1)
    for k in range(100):
        before = kept
        pose = certain(x=0.002 + 1e-4 * random.standard_normal())
        kept = body.keep(before, BOTH, vehicle(1_000_000 + 100_000 * k), pose)
        changes += kept.safe_set is not before.safe_set
    assert changes <= 8
    more = body.keep(kept, BOTH, vehicle(20_000_000), certain(x=0.01))
    assert more.added[0] >= 0.03


def test_a_deviation_that_grows_is_met_ahead() -> None:
    body, kept = clearance(), InflatedSafeSet()
    for k in range(10):
        pose = certain(x=0.01 * k)  # 0.3 m/s of three deviations
        kept = body.keep(kept, SafeSet((NORTH,)), vehicle(1_000_000 + 100_000 * k), pose)
    lead = 1.0 / BARRIERS[0].slope + 0.07
    assert kept.added == pytest.approx((0.27 + 0.3 * lead,), abs=STEP)


def test_a_safe_set_that_comes_between_planning_ticks_grows_as_much() -> None:
    kept = clearance().keep(
        InflatedSafeSet(), SafeSet((NORTH,)), vehicle(), certain(x=0.01, y=0.01)
    )
    other = kept.of(BOTH)
    assert other.source is BOTH
    assert other.added == (kept.added[0],) * 2
    assert kept.of(kept.source) is kept
    assert InflatedSafeSet().of(BOTH).safe_set is BOTH


@pytest.mark.parametrize("pose", [certain(x=0.3), certain(x=0.02)], ids=["doubt", "drift"])
def test_a_safe_set_that_is_renewed_grows_no_faster_and_no_slower(pose: Array) -> None:
    """As zones that move are, ten times a second; the other set is always the same."""
    body, histories = clearance(), []
    for renewed in (False, True):
        kept, history = (
            body.keep(InflatedSafeSet(), SafeSet((NORTH,)), vehicle(), certain(x=0.01)),
            [],
        )
        for k in range(1, 6):
            if renewed:
                kept = kept.of(SafeSet((wall((-1.0, 0.0, 0.0), -5.0 - 1e-3 * k, 0.1),)))
            now = vehicle(1_000_000 + 100_000 * k)
            kept = body.keep(kept, kept.source, now, 0.2 * k * pose)
            history.append(kept.added[0])
        histories.append(history)
    same, moving = histories
    assert moving == pytest.approx(same, abs=STEP)
    steps = np.diff([0.03, *moving])
    assert max(steps) < 0.08 + 2.0 * STEP, "0.8 m/s at most"
    assert moving[-1] > 0.05


def test_other_zones_of_other_kinds_have_no_deviation_to_compare_with_but_the_bound() -> None:
    kept = clearance().keep(InflatedSafeSet(), SafeSet((NORTH,)), vehicle(), certain(x=0.01))
    other = kept.of(SafeSet((Zone(ball((9.0, 0.0, 0.0), 0.3), 0.1),)))
    assert (other.spread, other.t_us) == ((), kept.t_us)
    assert kept.of(SafeSet((EAST,))).spread == kept.spread


def corridor(left: float, right: float) -> SafeSet:
    """Walls so far to both sides of the vehicle, clearance included."""
    return SafeSet((wall((0.0, 1.0, 0.0), -left, 0.0), wall((0.0, -1.0, 0.0), -right, 0.0)))


@pytest.mark.requirement("REQ-SAFE-11")
def test_walls_are_given_what_room_there_is_and_the_lack_of_it_is_said() -> None:
    narrow = corridor(0.2, 0.3)
    kept = clearance().keep(InflatedSafeSet(), narrow, vehicle(), certain(y=0.1))
    left, right = kept.added
    free = 0.5 - left - right
    assert free == pytest.approx(2.0 * ROOM, abs=0.01), "a plan at rest still has its place"
    assert free >= 2.0 * ROOM - STEP
    assert left == pytest.approx(right, abs=0.01)
    assert kept.shortfall == pytest.approx(0.3 - left, abs=STEP)
    assert kept.shortfall > SHORTFALL
    wide = clearance().keep(InflatedSafeSet(), corridor(0.4, 0.4), vehicle(), certain(y=0.1))
    assert wide.added == pytest.approx((0.3, 0.3), abs=STEP)
    assert wide.shortfall == 0.0


def test_walls_that_are_not_in_each_others_way_grow_in_full() -> None:
    zones = (*corridor(0.2, 0.2).zones, wall((-1.0, 0.0, 0.0), -1.0, 0.0))
    pose = certain(x=0.1, y=0.1)
    *sides, ahead = clearance().keep(InflatedSafeSet(), SafeSet(zones), vehicle(), pose).added
    assert max(sides) < 0.13
    assert ahead == pytest.approx(0.3, abs=STEP)


def test_a_room_too_small_for_any_plan_stays_as_it_is() -> None:
    kept = clearance().keep(InflatedSafeSet(), corridor(0.05, 0.05), vehicle(), certain(y=0.1))
    assert kept.added == (0.0, 0.0)
    assert kept.shortfall == pytest.approx(0.3, abs=STEP)


def test_all_sides_of_a_box_to_stay_in_come_nearer_as_far_as_they_can() -> None:
    inside = SafeSet((Zone(box((0.0, 0.0, 0.0), (0.4, 0.6, 0.8)), 0.0, keep_in=True),))
    (more,) = (
        clearance().keep(InflatedSafeSet(), inside, vehicle(arm=(0.0, 0.0)), certain(y=0.2)).added
    )
    assert more == pytest.approx(0.4 - ROOM, abs=0.01)


def test_the_sphere_around_the_target_shrinks_to_the_stand_off_and_not_further() -> None:
    inside = stand_off(BARRIERS[1])
    for spare, wanted, found in ((0.02, 0.005, 0.015), (0.0105, 0.005, 0.010), (-0.01, 0.005, 0.0)):
        safe_set = SafeSet((target_sphere((0.0, 0.0, -0.2), inside + spare),))
        kept = clearance().keep(InflatedSafeSet(), safe_set, vehicle(), certain(x=wanted))
        assert kept.added == pytest.approx((found,), abs=1e-9)


def test_the_time_since_there_was_room_is_known() -> None:
    body, kept = clearance(), InflatedSafeSet()
    for k in range(5):
        narrow = corridor(0.2, 0.2)
        kept = body.keep(kept, narrow, vehicle(1_000_000 + 100_000 * k), certain(y=0.1))
    assert kept.sufficient_us == 1_000_000, "an estimate that starts in flight is given time"
    kept = body.keep(kept, narrow, vehicle(9_000_000), certain(y=0.001))
    assert kept.sufficient_us == 9_000_000
    assert kept.shortfall == 0.0


def test_a_wall_far_off_takes_no_room() -> None:
    far: Vec3 = (0.0, 1.0, 0.0)
    zones = SafeSet((wall(far, -50.0, 0.0), wall((0.0, -1.0, 0.0), 0.0, 0.0)))
    kept = clearance().keep(InflatedSafeSet(), zones, vehicle(), certain(y=0.1))
    assert kept.added == pytest.approx((0.3, 0.3), abs=STEP), "the vehicle can still draw back"


# ---------------------------------------------------------------- wind


def test_clearances_grow_by_what_wind_that_turns_can_do_along_each_normal() -> None:
    set_, wind = SafeSet((NORTH, EAST)), (0.03, 0.01)
    kept = clearance().keep(InflatedSafeSet(), set_, vehicle(), None, wind)
    assert kept.added == pytest.approx((0.03, 0.01), abs=1.1e-3)
    both = clearance().keep(InflatedSafeSet(), set_, vehicle(), certain(x=0.005), wind)
    assert both.added == pytest.approx((0.045, 0.01), abs=1.1e-3)
    calm = clearance().keep(kept, set_, vehicle(), None)
    assert calm.safe_set is set_


def test_a_sphere_without_room_for_wind_lacks_nothing_by_it() -> None:
    set_ = SafeSet((target_sphere((0.0, 0.0, -0.2), stand_off(BARRIERS[1]) + 1e-3),))
    kept = clearance().keep(InflatedSafeSet(), set_, vehicle(), None, (0.03, 0.0))
    assert kept.added[0] < 2e-3
    assert not kept.shortfall > SHORTFALL


@pytest.mark.requirement("REQ-EST-10")
def test_a_zone_is_kept_where_it_was_before_a_jump_as_well() -> None:
    """By as much as the jump says that it is farther away, at once."""
    round_ = Zone(ball((0.0, 9.0, 0.0), 1.0), 0.1)
    every = SafeSet((NORTH, EAST, round_, target_sphere((0.0, 0.0, -0.3), 3.0)))
    keep = clearance().keep
    before = keep(InflatedSafeSet(), every, vehicle(), certain(x=0.01, y=0.01))
    after = keep(
        *(before, every, vehicle(1_100_000), certain(x=0.01, y=0.01)), unproven=(-0.7, 0.5, 0.0)
    )
    growth = np.subtract(after.added, before.added)
    assert growth == pytest.approx((0.7, 0.0, np.hypot(0.7, 0.5), 0.0), abs=2 * STEP)
    same = keep(
        *(after, every, vehicle(1_200_000), certain(x=0.01, y=0.01)), unproven=(-0.7, 0.5, 0.0)
    )
    assert same.added == pytest.approx(after.added, abs=STEP)
    back = keep(same, every, vehicle(1_300_000), certain(x=0.01, y=0.01))
    assert back.added == pytest.approx(before.added, abs=5 * STEP)
    exact = keep(InflatedSafeSet(), BOTH, vehicle(), None, unproven=(-0.7, 0.0, 0.0))
    assert exact.added == pytest.approx((0.7, 0.0), abs=STEP), "whatever SAFE_SIGMAS says"
