"""Flights in process: determinism, effort as the paper defines it, rows of flights that break."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fsw.autopilot.control.control_metrics import ControlMetrics
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import PlanInput
from sitl.scenario_file import ScenarioError, load_scenario
from sitl.simulation import Simulation
from studies.flight import closed_loop
from studies.flight.job import Job, PlantName, fly_job, score
from studies.paper.cases import configuration, scenario
from vehicles.vehicle_file import load_vehicle

BRIEF = 2.0  # s


def test_effort_and_smoothness_are_the_papers_sums_in_its_order() -> None:
    record = ControlMetrics()
    inputs = [(1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (1.0, 2.0, 0.0, 4.0, 9.0, 6.0)]
    for ax, ay, az, yaw, j1, j2 in inputs:
        record.add(PlanInput((ax, ay, az), yaw, (j1, j2)))
    totals = record.as_json()
    assert totals["control_effort"]["sum"] == sum(x * x for u in inputs for x in u)
    assert totals["control_smoothness"]["sum"] == math.dist(*inputs) == 5.0


@pytest.mark.parametrize("case", ["I", "II"])
def test_the_full_plant_flies_and_flies_the_same_again(case: str) -> None:
    flown = scenario("I" if case == "I" else "II", disturbed=True, duration_s=BRIEF)
    first, again = (
        closed_loop.simulate(flown, 5, flight_config(body="points"), traced=traced)
        for traced in (True, False)
    )
    assert first.truth.completed
    assert first.truth == again.truth
    assert first.planner.metrics.as_json() == again.planner.metrics.as_json()
    assert (first.planner.plans, first.planner.failures) == (20, 0)
    assert len(first.planner.step_us) == 20
    # 20 steps of 2 ms between points; every margin in the trace is within the judged minimum.
    assert len(first.planner.trace) == 50
    assert first.truth.min_margin_m is not None
    assert min(point.margin_m for point in first.planner.trace) >= first.truth.min_margin_m
    assert not again.planner.trace


@pytest.mark.parametrize("plant", ["full", "double-integrator"])
def test_a_flight_without_constraints_has_a_trace(plant: PlantName) -> None:
    free = replace(load_scenario("walls-calm"), walls=(), duration_s=0.1)
    result = fly_job(Job(plant, free, flight_config(body="points"), 0), traced=True)
    assert [point.margin_m for point in result.planner.trace] == [math.inf] * 3


@pytest.mark.parametrize("vehicle", ["paper", "hexa-3r"])
def test_a_row_says_which_angle_came_nearest_to_its_limit(vehicle: str) -> None:
    flown = replace(load_scenario("walls", None, vehicle), duration_s=0.5)
    job = Job("full", flown, flight_config(body=flown.body, vehicle=load_vehicle(vehicle)), 1)
    result = fly_job(job)
    row = score(job, result)
    assert row.angle_margin_of is not None
    used = result.truth.limits[row.angle_margin_of]
    assert row.angle_margin_deg == math.degrees(used.most - used.largest)
    for key, use in result.truth.limits.items():
        if key == "tilt" or "angle" in key:
            assert use.most - use.largest >= used.most - used.largest, key


@pytest.mark.parametrize("plant", ["double-integrator", "full"])
def test_calm_air_is_one_flight_whatever_the_seed(plant: str) -> None:
    name = "full" if plant == "full" else "double-integrator"
    flown = scenario("II", disturbed=False, duration_s=1.0)
    jobs = [Job(name, flown, configuration(name), seed) for seed in (100, 101)]
    assert not jobs[0].random
    assert jobs[0].key() == jobs[1].key()
    truths = [fly_job(job).truth for job in jobs]
    assert truths[0] == truths[1]


def test_a_seed_is_part_of_a_flight_where_something_is_random() -> None:
    disturbed = scenario("II", disturbed=True, duration_s=1.0)
    noisy = replace(disturbed, disturbances=())
    noisy = replace(
        noisy,
        sensors=replace(noisy.sensors, pose=replace(noisy.sensors.pose, position_m=0.001)),
    )
    late = replace(
        disturbed,
        disturbances=(),
        sensors=replace(
            noisy.sensors, pose=replace(noisy.sensors.pose, position_m=0.0, latency_ms=10.0)
        ),
    )
    config = configuration("full")
    keys = {
        name: {Job("full", flown, config, seed).key() for seed in (1, 2)}
        for name, flown in (("disturbed", disturbed), ("noisy", noisy), ("late", late))
    }
    assert {name: len(found) for name, found in keys.items()} == {
        "disturbed": 2,
        "noisy": 2,
        "late": 1,
    }


def test_a_flight_that_cannot_start_is_a_row() -> None:
    flown = scenario("II", disturbed=True, duration_s=1.0)
    assert flown.workspace is not None
    impossible = replace(flown, workspace=replace(flown.workspace, d_iw_m=1.0))
    row = Job("double-integrator", impossible, configuration("double-integrator"), 7).row()
    assert row.error
    assert not row.completed
    assert row.seed == 7
    assert "workspace" in row.reason


def test_a_body_that_starts_outside_the_safe_set_is_refused() -> None:
    """It would be thrown out at the first tick."""
    flown = replace(load_scenario("walls-calm"), duration_s=0.1)
    with pytest.raises(ScenarioError, match="use body='points'") as found:
        closed_loop.simulate(flown, 0, flight_config())
    assert "starts outside its safe set: margin" in str(found.value)
    assert Job("full", flown, flight_config(), 0).row().error
    assert closed_loop.simulate(flown, 0, flight_config(body="points")).truth.completed


@pytest.mark.requirement("REQ-SAFE-16")
@pytest.mark.parametrize(
    ("name", "keys", "why"),
    [
        (
            "pick",
            {"payload": {"mass_kg": 0.36}},
            "payload.mass_kg = 0.36: the vehicle may carry at most 0.353 kg, bounded by joint 1's",
        ),
        (
            "wipe",
            {"trajectory": {"slide_m": ((0.0, 0.5, 0.0),)}},
            r"trajectory.force_n\[0\] = 3: pressing with 3.0 N and sliding turns the vehicle by",
        ),
        ("wipe", {"trajectory": {"force_n": (9.5,)}}, "9.5 N are asked for; at most 5.2 N"),
    ],
)
def test_what_a_vehicle_can_neither_carry_nor_balance_is_refused_before_it_flies(
    name: str, keys: dict[str, dict[str, object]], why: str
) -> None:
    flown = load_scenario(name)
    config = flight_config(body=flown.body, vehicle=load_vehicle(flown.vehicle))
    simulation = Simulation(flown, 1)
    closed_loop.ScenarioFlight(simulation, config)
    for table, changes in keys.items():
        flown = replace(flown, **{table: replace(getattr(flown, table), **changes)})
    with pytest.raises(ScenarioError, match=why):
        closed_loop.ScenarioFlight(Simulation(flown, 1), config)
