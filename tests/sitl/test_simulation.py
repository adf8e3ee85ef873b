"""A whole simulated flight without flight software: start, ground, judgement, repeatability."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from sitl.plant.trim import level_hover
from sitl.result import EndKind
from sitl.scenario import (
    Hold,
    Impulses,
    ImuErrors,
    Pilot,
    Scenario,
    Sensors,
    Wind,
    Workspace,
    start_angles,
)
from sitl.scenario_file import ScenarioError, load_scenario
from sitl.sensors.exact import SensorReadings
from sitl.simulation import Controls, Simulation, Truth

OFF = Controls((0.0, 0.0, 0.0, 0.0), (0.0, 0.0), armed=False)


def _trimmed(simulation: Simulation) -> Controls:
    """The controls that hold the start of an airborne scenario."""
    vehicle = simulation.vehicle
    trim = level_hover(vehicle, start_angles(simulation.scenario))
    thrust = [f / one.thrust_max for f, one in zip(trim.thrust, vehicle.rotors, strict=True)]
    torque = [t / one.torque_max for t, one in zip(trim.torque, vehicle.joints, strict=True)]
    return Controls(tuple(thrust), tuple(torque), armed=True)


def _fly(simulation: Simulation, controls: Controls, seconds: float) -> None:
    for _ in range(round(seconds / 0.002)):
        if simulation.ended is None:
            simulation.advance(controls)


def test_the_trimmed_start_holds_still() -> None:
    simulation = Simulation(load_scenario("walls-calm"), 0)
    before = simulation.truth()
    _fly(simulation, _trimmed(simulation), 0.5)
    after = simulation.truth()
    assert math.dist(before.p_WB, after.p_WB) <= 1e-9
    assert math.dist(before.p_WE, after.p_WE) <= 1e-9
    assert simulation.result().tracking_error_max_m == pytest.approx(0.0, abs=1e-9)


def test_the_airborne_start_puts_the_end_effector_below_the_base() -> None:
    truth = Simulation(load_scenario("workspace"), 0).truth()
    below = [e - b for e, b in zip(truth.p_WE, truth.p_WB, strict=True)]
    assert below == pytest.approx([0.0, 0.0, 0.225], abs=1e-12)
    assert truth.p_WE == pytest.approx(truth.target.p, abs=1e-12)


def test_a_turned_start_still_meets_the_reference() -> None:
    scenario = load_scenario("walls-calm")
    start = replace(scenario.start, yaw_deg=70.0, arm_deg=(-20.0, 70.0))
    simulation = Simulation(replace(scenario, start=start), 0)
    truth = simulation.truth()
    assert truth.p_WE == pytest.approx(truth.target.p, abs=1e-12)
    _fly(simulation, _trimmed(simulation), 0.5)
    assert math.dist(truth.p_WE, simulation.truth().p_WE) <= 1e-9


def test_an_accelerometer_at_rest_reads_minus_gravity() -> None:
    for name in ("walls-calm", "hop"):
        reading = Simulation(load_scenario(name), 0).sense()
        assert reading.accel_B == pytest.approx((0.0, 0.0, -9.81), abs=1e-9)
        assert reading.t_us == 1_000_000


def test_a_vehicle_standing_on_the_ground_stays_where_it_is() -> None:
    simulation = Simulation(load_scenario("hop"), 0)
    before = simulation.truth()
    _fly(simulation, OFF, 1.0)
    after = simulation.truth()
    assert math.dist(before.p_WB, after.p_WB) <= 1e-9
    assert simulation.ended is None
    assert after.p_WE[2] < -0.015  # the arm hangs free


def test_wind_does_not_carry_a_standing_vehicle_away() -> None:
    scenario = replace(load_scenario("hop"), disturbances=(Wind((1.0, 0.0, 0.0)),))
    simulation = Simulation(scenario, 0)
    _fly(simulation, OFF, 2.0)
    # Smoothed friction creeps at a / (mu g) of its slip rate: 4 mm/s here.
    assert abs(simulation.truth().p_WB[0]) <= 0.015
    assert simulation.ended is None


def _hovering_over_ground(height: float) -> Simulation:
    """A small drop: an airborne start with the feet ``height`` above the ground."""
    scenario = load_scenario("walls-calm")
    end_effector = Hold((0.515, 0.0, 0.225 - 0.32 - height))
    return Simulation(replace(scenario, trajectory=end_effector, walls=()), 0)


def test_a_soft_landing_comes_to_rest_on_the_legs() -> None:
    simulation = _hovering_over_ground(0.02)
    _fly(simulation, OFF, 3.0)
    truth = simulation.truth()
    assert simulation.ended is None
    assert truth.p_WB[2] == pytest.approx(-0.318, abs=0.002)
    assert math.hypot(*truth.v_WB) <= 1e-3


def test_a_hard_landing_ends_the_run() -> None:
    simulation = _hovering_over_ground(1.0)
    _fly(simulation, OFF, 2.0)
    assert simulation.ended is not None
    assert simulation.ended.kind is EndKind.CRASH
    assert "hit the ground at 4." in simulation.ended.sentence
    assert not simulation.result().completed


def _blown(direction: tuple[float, float, float]) -> Simulation:
    scenario = replace(load_scenario("walls-calm"), disturbances=(Wind(direction),))
    simulation = Simulation(scenario, 0)
    _fly(simulation, _trimmed(simulation), 5.0)
    return simulation


def test_touching_a_wall_ends_the_run_and_says_what_touched_it() -> None:
    simulation = _blown((2.0, 0.0, 0.0))
    result = simulation.result()
    assert simulation.ended is not None
    assert simulation.ended.kind is EndKind.COLLISION
    assert "hit the front wall at" in result.end_reason
    assert "margin was violated by" in result.end_reason
    assert not result.completed
    assert result.min_margin_m == pytest.approx(-0.1, abs=0.01)
    assert result.duration_s < 2.0


def _lost_clearance(duration: float) -> Simulation:
    scenario = load_scenario("workspace-calm")
    simulation = Simulation(
        replace(scenario, duration_s=duration, disturbances=(Wind((0.5, 0.0, 0.0)),)), 0
    )
    _fly(simulation, _trimmed(simulation), duration)
    return simulation


def test_leaving_the_margin_does_not_end_the_run_but_is_not_completed() -> None:
    simulation = _lost_clearance(1.0)
    result = simulation.result()
    assert simulation.ended is not None
    assert simulation.ended.kind is EndKind.DURATION
    assert result.duration_s == pytest.approx(1.0)
    assert not result.completed
    assert "workspace/base margin was violated by" in result.end_reason
    assert result.min_margin_time_s == pytest.approx(1.0)


def test_the_whole_duration_with_every_margin_is_completed() -> None:
    simulation = _lost_clearance(0.3)
    result = simulation.result()
    assert result.completed
    assert result.end_reason == "flew 0.3 s"
    assert result.margins_m == {"workspace/base": result.min_margin_m}


def test_margins_are_judged_between_the_exchanges() -> None:
    winds = [(2.0 + 0.1 * k, 0.0, 0.0) for k in range(8)]
    times = [_blown(wind).result().min_margin_time_s for wind in winds]
    # Exchanges are 2 ms apart: a wall touched at an odd millisecond was seen between two.
    assert any(round(1000.0 * time) % 2 == 1 for time in times if time is not None)


@pytest.mark.parametrize(
    "controls",
    [
        Controls((math.nan, 0.5, 0.5, 0.5), (0.0, 0.0), True),
        Controls((0.5, 0.5, 0.5, 0.5), (math.inf, 0.0), True),
        Controls((0.5, 0.5, 0.5, 0.5), (0.0,), True),
    ],
)
def test_impossible_controls_are_refused_loudly(controls: Controls) -> None:
    simulation = Simulation(load_scenario("walls"), 0)
    with pytest.raises(ValueError, match="at step 0"):
        simulation.advance(controls)


def test_controls_saturate() -> None:
    first, second = (Simulation(load_scenario("walls-calm"), 0) for _ in range(2))
    _fly(first, Controls((9.0, 9.0, 9.0, 9.0), (5.0, -5.0), True), 0.1)
    _fly(second, Controls((1.0, 1.0, 1.0, 1.0), (1.0, -1.0), True), 0.1)
    assert first.truth() == second.truth()


def test_a_disarmed_vehicle_ignores_its_controls() -> None:
    first, second = (Simulation(load_scenario("walls-calm"), 0) for _ in range(2))
    _fly(first, Controls((1.0, 1.0, 1.0, 1.0), (1.0, 1.0), False), 0.1)
    _fly(second, OFF, 0.1)
    assert first.truth() == second.truth()


def _flight(scenario: Scenario, seed: int) -> list[tuple[SensorReadings, Truth]]:
    simulation = Simulation(scenario, seed)
    controls = _trimmed(simulation)
    out = []
    for _ in range(200):
        out.append((simulation.sense(), simulation.truth()))
        simulation.advance(controls)
    return out


def test_a_run_repeats_exactly_with_its_seed_only() -> None:
    scenario = replace(load_scenario("walls"), sensors=Sensors(imu=ImuErrors(accel_m_s2=0.1)))
    assert _flight(scenario, 7) == _flight(scenario, 7)
    assert _flight(scenario, 7) != _flight(scenario, 8)


def test_sensor_noise_and_a_silent_item_do_not_change_the_flight() -> None:
    calm = load_scenario("walls")
    silent = Impulses(mean_interval_s=0.05, magnitude_m_s2=0.0, duration_s=0.01)
    noisy = replace(
        calm,
        sensors=Sensors(imu=ImuErrors(gyro_rad_s=0.1)),
        disturbances=(silent, *calm.disturbances),
    )

    def truths(scenario: Scenario) -> list[Truth]:
        return [truth for _, truth in _flight(scenario, 7)]

    assert truths(calm) == truths(noisy)


def test_asking_twice_in_a_step_gives_the_same_reading() -> None:
    scenario = replace(load_scenario("walls"), sensors=Sensors(imu=ImuErrors(gyro_rad_s=0.1)))
    simulation = Simulation(scenario, 0)
    assert simulation.sense() is simulation.sense()


def test_the_trajectory_starts_after_the_delay_and_a_hop_has_none() -> None:
    simulation = Simulation(load_scenario("walls"), 0)
    assert simulation.trajectory_start_us == 2_000_000
    assert simulation.clock.target_at(0.5) == simulation.clock.target_at(1.0)
    assert simulation.clock.target_at(5.0) != simulation.clock.target_at(1.0)
    hop = Simulation(load_scenario("hop"), 0)
    assert hop.trajectory_start_us is None
    assert hop.clock.target_at(15.0) == hop.clock.target_at(0.0)
    assert hop.result().tracking_error_rms_m is None


def test_the_first_reason_to_end_stands() -> None:
    simulation = Simulation(load_scenario("walls"), 0)
    simulation.end(EndKind.REFUSED, "the vehicle denied arming: battery low")
    simulation.end(EndKind.STOPPED, "interrupted")
    assert simulation.result().end_reason == "the vehicle denied arming: battery low"
    assert not simulation.result().completed


def test_wind_is_an_acceleration_of_the_whole_vehicle() -> None:
    scenario = load_scenario("walls-calm")
    # With the arm straight down a vertical push goes through every centre of mass.
    scenario = replace(
        scenario,
        start=replace(scenario.start, arm_deg=(0.0, 0.0)),
        disturbances=(Wind((0.0, 0.0, -0.5)),),
    )
    simulation = Simulation(scenario, 0)
    _fly(simulation, _trimmed(simulation), 0.2)
    assert simulation.truth().v_WB == pytest.approx((0.0, 0.0, -0.1), abs=1e-12)


def test_a_workspace_counts_only_where_there_is_a_trajectory() -> None:
    scenario = replace(load_scenario("hop"), workspace=Workspace(0.075, 0.225))
    simulation = Simulation(scenario, 0)
    _fly(simulation, OFF, 0.2)
    assert simulation.result().margins_m == {}


def test_nothing_of_the_trajectory_counts_once_the_vehicle_has_left_it() -> None:
    simulation = Simulation(load_scenario("workspace-calm"), 0)
    trimmed = _trimmed(simulation)
    _fly(simulation, trimmed, 0.4)
    before = simulation.result()
    assert before.tracking_error_rms_m is not None
    simulation.leave_trajectory(simulation.t_us, "the vehicle left it")
    _fly(simulation, OFF, 0.1)  # falls
    after = simulation.result()
    assert after.tracking_error_rms_m == before.tracking_error_rms_m
    assert after.margins_m == before.margins_m
    simulation.leave_trajectory(simulation.t_us, "and again")
    assert "the vehicle left it at 0.4 s" in simulation.result().end_reason
    assert "again" not in simulation.result().end_reason


def test_a_whole_flight_off_its_trajectory_is_not_completed() -> None:
    scenario = replace(load_scenario("hop"), duration_s=0.2, pilot=Pilot("none"))
    completed = []
    for leaves in (False, True):
        simulation = Simulation(scenario, 0)
        if leaves:
            simulation.leave_trajectory(simulation.t_us, "the vehicle left it")
        _fly(simulation, OFF, 0.2)
        assert simulation.ended is not None
        completed.append(simulation.result().completed)
    assert completed == [True, False]


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(ScenarioError, match="seed = -1"):
        Simulation(load_scenario("walls-calm"), -1)


def test_what_is_left_for_later_is_done_by_the_next_step_as_well() -> None:
    scenario = load_scenario("walls", "mocap")
    prompt, late = Simulation(scenario, 0), Simulation(scenario, 0)
    for _ in range(60):
        assert prompt.measurements() == late.measurements()
        prompt.catch_up()
        for one in (prompt, late):
            one.advance(_trimmed(one))
    assert prompt.result() == late.result()
