"""What the soak lets fail: each unit and kind in an hour, as the simulator takes it."""

from __future__ import annotations

from benchmarks.soak_faults import FAULTS, scenario
from sitl.faults.keys import LINKS
from sitl.scenario_file import parse_scenario


def test_an_hour_has_each_fault_and_the_simulator_takes_it() -> None:
    flown = parse_scenario(scenario(3, 3600.0), "failing", "mocap").faults
    kinds = {(fault.unit, fault.kind) for fault in flown}
    assert kinds == {(one["unit"], one["kind"]) for one in FAULTS}
    assert {unit for unit, _ in kinds} > {*LINKS, "planner", "encoder", "motor", "joint"}
    assert all(fault.start_s + fault.duration_s < 3600.0 for fault in flown)
    assert all(fault.duration_s > 0.0 for fault in flown), "none lasts to the end"
    stopped = [fault.duration_s for fault in flown if fault.unit == "simulator"]
    assert max(stopped) <= 0.5, "there is no answer meanwhile"


def test_a_planner_lives_for_the_second_half() -> None:
    flown = parse_scenario(scenario(3, 3600.0), "failing", "mocap").faults
    assert 1400.0 < max(fault.start_s for fault in flown if fault.unit == "planner") < 1800.0


def test_a_seed_gives_the_same_faults_and_another_one_others() -> None:
    assert scenario(3, 600.0) == scenario(3, 600.0) != scenario(4, 600.0)
