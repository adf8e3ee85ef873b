"""A configuration that cannot keep its safe set says so, with a value that is enough."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.barriers.safe_approach import BarrierTuning, safe_approach_speed, stand_off
from fsw.autopilot.control.tube import base_reach
from fsw.autopilot.parameters.consistency import (
    Finding,
    analyse,
    loop_tube,
    refusals,
    return_room,
    sampled_robustness,
)
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import SafeSet
from fsw.autopilot.tuning import tuned
from vehicles.vehicle_file import load_vehicle, vehicle_names

WALLS = SafeSet((wall((-1.0, 0.0, 0.0), -1.0, 0.1),))
POINT = SafeSet((point((1.0, 0.0, -1.0), 0.1),))
SPHERE = SafeSet((target_sphere((0.0, 0.0, -0.225), 0.075),))


def _findings(config: FlightConfig, safe_set: SafeSet) -> dict[str, Finding]:
    found = analyse(config, safe_set, loop_tube(config))
    return {finding.name: finding for finding in found}


@pytest.mark.parametrize("safe_set", [WALLS, POINT, SPHERE])
def test_the_default_configuration_is_consistent(safe_set: SafeSet) -> None:
    config = flight_config()
    assert refusals(analyse(config, safe_set, loop_tube(config))) == ()


@pytest.mark.drawn(2)
@pytest.mark.parametrize("name", vehicle_names())
def test_a_vehicle_that_its_own_arm_turns_is_refused_by_its_friction_and_its_pushes(
    name: str,
) -> None:
    """Public vehicles of 7 rad/s^2 of friction, or with 9 rad/s^2 of pushes, left the safe set."""
    vehicle = load_vehicle(name)
    assert _findings(flight_config(vehicle=vehicle), WALLS)["turned"].holds
    rough = [replace(one, coulomb=2.0) for one in vehicle.joints]
    light = replace(vehicle.base, inertia=tuple([0.02 * one for one in vehicle.base.inertia]))
    for changed in (replace(vehicle, joints=tuple(rough)), replace(vehicle, base=light)):
        against = refusals(
            analyse(config := flight_config(vehicle=changed), WALLS, loop_tube(config))
        )
        assert any("turns the base" in sentence for sentence in against)


@pytest.mark.requirement("REQ-SAFE-7")
@pytest.mark.parametrize("preset", ["paper-1", "paper-5"])
@pytest.mark.parametrize("safe_set", [WALLS, POINT, SPHERE])
def test_the_papers_lambda_is_refused_with_a_value_that_would_do(
    preset: str, safe_set: SafeSet
) -> None:
    config = flight_config(robustness=preset)
    against = refusals(analyse(config, safe_set, loop_tube(config)))
    assert against
    assert all("is enough" in sentence for sentence in against)


def test_the_sphere_finding_turns_exactly_where_the_centre_can_hold() -> None:
    config = flight_config()
    tuning = config.planner.workspace
    at_centre = safe_approach_speed(0.075, tuning.alpha, tuning.slope)
    for robustness, holds in ((0.999 * at_centre, True), (1.001 * at_centre, False)):
        workspace = replace(tuning, lambda_=robustness)
        changed = replace(config, planner=replace(config.planner, workspace=workspace))
        assert _findings(changed, SPHERE)["sphere"].holds is holds


@pytest.mark.parametrize("robustness", [0.1, 0.3, 0.5, 0.9, 2.0])
def test_at_the_stand_off_a_vehicle_at_rest_meets_lambda(robustness: float) -> None:
    tuning = BarrierTuning(lambda_=robustness)
    assert safe_approach_speed(stand_off(tuning), tuning.alpha, tuning.slope) == pytest.approx(
        robustness
    )


@pytest.mark.requirement("REQ-SAFE-7")
def test_the_tube_finding_turns_where_the_stand_off_equals_the_reach() -> None:
    config = flight_config()
    tuning = config.planner.walls
    loop = loop_tube(config)
    reach = 0.8 * loop.base + loop.base_wind - loop.wind_beyond
    for factor, holds in ((1.01, True), (0.99, False)):
        walls = replace(tuning, lambda_=factor * reach * tuning.slope)
        changed = replace(config, planner=replace(config.planner, walls=walls))
        assert _findings(changed, WALLS)["tube"].holds is holds


@pytest.mark.parametrize("share", [0.9, 1.0, 1.1])
def test_sampled_robustness_is_the_least_lambda_that_a_held_push_cannot_beat(share: float) -> None:
    """Beside a wall, on the double integrator, with the row of eq 25 met with equality.

    The controller brakes exactly as much as ``h+ = h - gamma T (h - lambda)`` asks; a push of
    0.8 m/s^2 that it does not know comes on top. The distance settles at the predicted margin.
    """
    push, period = 0.8, 0.1
    tuning = BarrierTuning(slope=4.0)
    robustness = share * sampled_robustness(tuning, push, period)
    k, gamma = tuning.slope, tuning.gamma
    d, v = 0.05, 0.0
    for _ in range(400):
        h = k * d + v
        wanted = h - gamma * period * (h - robustness)
        # h at the next sample is k (d + v T + a T^2/2) + v + a T, the push left out.
        a = (wanted - k * (d + v * period) - v) / (k * period**2 / 2.0 + period)
        d, v = d + v * period + (a - push) * period**2 / 2.0, v + (a - push) * period
    predicted = (robustness - sampled_robustness(tuning, push, period)) / k
    assert d == pytest.approx(predicted, abs=1e-6)


def test_controllers_without_a_barrier_have_nothing_to_refuse() -> None:
    config = flight_config("naive")
    assert analyse(config, SPHERE, loop_tube(config)) == ()


def test_beside_a_point_the_same_is_said_as_beside_a_wall_and_something_about_the_links() -> None:
    beside_wall = _findings(flight_config(body="points"), WALLS)
    beside_point = _findings(flight_config(body="points"), POINT)
    links = beside_point.pop("links")
    towards_a_point = beside_point.pop("tube of all axes")
    towards_a_wall = beside_wall.pop("tube of all axes")
    assert beside_point == beside_wall
    assert "rotors can saturate" in towards_a_wall.statement
    assert towards_a_wall.statement != towards_a_point.statement  # a point: all axes add up
    assert not towards_a_point.refuses
    assert links.holds
    assert "keeps 66 mm" in links.statement  # sqrt(100^2 - 75^2)


@pytest.mark.parametrize(("clearance", "holds"), [(0.074, False), (0.076, True)])
def test_a_point_that_a_link_could_pass_through_is_worth_a_warning(
    clearance: float, holds: bool
) -> None:
    safe_set = SafeSet((point((1.0, 0.0, -1.0), clearance),))
    finding = _findings(flight_config(body="points"), safe_set)["links"]
    assert finding.holds is holds
    assert not finding.refuses


def with_walls(config: FlightConfig, **changes: float) -> FlightConfig:
    walls = replace(config.planner.walls, **changes)
    return replace(config, planner=replace(config.planner, walls=walls))


def test_the_full_body_is_told_of_its_feet_and_rotors_with_values_that_do() -> None:
    assert "part tube" not in _findings(flight_config(body="points"), WALLS)
    config = flight_config(body="full")
    beside, above = (
        _findings(config, SafeSet((wall(normal, -1.0, 0.1),)))["part tube"].statement
        for normal in ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    )
    assert "can move the leg4_end 122 mm" in beside
    assert "can move the rotors 94 mm" in above
    assert beside.endswith("lambda >= 0.488 m/s with alpha <= 1.67 m/s^2 would be proof")
    for lambda_, holds in ((0.488, True), (0.48, False)):
        found = _findings(with_walls(config, lambda_=lambda_, alpha=1.67), WALLS)
        assert found["part tube"].holds is holds
        assert found["actuation"].holds
    assert not _findings(with_walls(config, lambda_=0.488, alpha=1.7), WALLS)["actuation"].holds


def test_a_value_that_the_tilt_cannot_keep_is_not_given_as_proof() -> None:
    config = flight_config(body="points")
    windy = replace(config, surroundings=replace(config.surroundings, disturbance=2.5))
    assert (
        "no lambda that the tilt can keep" in _findings(windy, WALLS)["end-effector tube"].statement
    )


def test_the_end_effector_is_said_to_follow_the_base_where_the_arm_gives_way() -> None:
    config = flight_config(body="points")
    helped = _findings(config, WALLS)["end-effector tube"].statement
    assert "225 mm below the base can be pushed 106 mm" in helped
    assert "along it once the base is 55 mm off" in helped
    rigid = replace(config, tuning=replace(config.tuning, compensate=False))
    assert (
        "across the arm's plane and along it, by"
        in _findings(rigid, WALLS)["end-effector tube"].statement
    )


def _following(least: float) -> FlightConfig:
    config = flight_config()
    return replace(config, planner=replace(config.planner, lambda_min=least))


def test_a_lambda_that_is_back_too_late_is_refused_with_the_least_that_is_enough() -> None:
    finding = _findings(_following(0.15), WALLS)["return of lambda"]
    assert not finding.holds
    assert finding.refuses
    assert "SAFE_LAMBDA_MIN >= 0.195 m/s is enough" in finding.statement
    assert _findings(_following(0.195), WALLS)["return of lambda"].holds


def test_a_lambda_that_does_not_follow_has_nothing_to_return_from() -> None:
    assert "return of lambda" not in _findings(_following(0.0), WALLS)
    assert "return of lambda" not in _findings(_following(0.35), WALLS)
    assert "return of lambda" not in _findings(_following(0.1), SPHERE)


def test_the_room_at_the_return_grows_with_what_is_kept_up_to_that_of_the_tube() -> None:
    config = flight_config()
    loop = loop_tube(config)
    rooms = [return_room(config, loop, least) for least in (0.1, 0.2, 0.3, 0.35)]
    assert rooms == sorted(rooms)
    whole = stand_off(config.planner.walls) - base_reach(loop, config.surroundings.disturbance)
    assert rooms[-1] == pytest.approx(whole, abs=1e-4)


def test_a_slower_planner_brings_lambda_back_later() -> None:
    config = flight_config()
    slower = replace(config, plan_delay_ticks=100)
    loop = loop_tube(config)
    assert return_room(slower, loop, 0.2) < return_room(config, loop, 0.2) - 0.002


def test_a_loop_that_saturates_at_half_the_disturbance_keeps_the_vehicle_on_the_ground() -> None:
    """It flew into a wall in still air."""
    config = flight_config(body="points")
    for jerk, refused in ((20.0, False), (2.0, True)):
        changed = tuned(config, (("tuning.tracking.jerk_limit", jerk),))
        found = analyse(changed, WALLS, loop_tube(changed))
        assert any("no limit is reached" in why for why in refusals(found)) is refused
