"""Campaign files: flight k is a function of the file and k; refusals say what to do."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from fsw.autopilot.parameters.registry import BY_NAME
from sitl.scenario_file import PACKAGED
from sitl.sensors.keys import MeasuredSensors
from studies.campaign.flight import CampaignFlights
from studies.campaign.keys import CampaignError
from studies.campaign.plan import EXAMPLE, CampaignPlan, load_plan, parse_plan

HEAD = """
flights = 40
duration_s = 1.0
seed = 3
scenarios = ["walls", "workspace"]
suites = ["perfect", "mocap"]
"""
VARY = """
[vary]
vehicle_scale.mass = { uniform = [0.9, 1.1] }
"vehicle_scale.inertia" = { normal = [1.0, 0.1] }
latency_ms = { choice = [0.0, 4.0] }
wind_m_s2 = { uniform = [0.0, 0.3] }
parameters.PLN_TILT_MAX = { uniform = [18.0, 19.0] }
"""


def plan_of(text: str) -> CampaignPlan:
    return parse_plan(text, "test", Path())


GRID = 'design = "grid"\nduration_s = 1.0\nscenarios = ["walls-calm"]\n[vary]\n'


def test_the_example_is_a_campaign() -> None:
    plan = load_plan(EXAMPLE)
    assert plan.count == 200
    assert len(plan.cases) == 4


def test_flights_take_turns_through_the_cases() -> None:
    plan = plan_of(HEAD)
    cases = [plan.flight(k).case for k in range(8)]
    assert [(one.scenario, one.suite) for one in cases[:4]] == [
        ("walls", "perfect"),
        ("walls", "mocap"),
        ("workspace", "perfect"),
        ("workspace", "mocap"),
    ]
    assert cases[4:] == cases[:4]
    assert plan.flight(0).job.scenario.duration_s == 1.0


def test_values_go_where_their_keys_say() -> None:
    plan = plan_of(HEAD + VARY)
    flight = plan.flight(1)
    values, scenario = dict(flight.values), flight.job.scenario
    assert scenario.vehicle_scale.mass == values["vehicle_scale.mass"] != 1.0
    assert scenario.vehicle_scale.inertia == values["vehicle_scale.inertia"]
    push = scenario.disturbances[-1].acceleration_m_s2  # type: ignore[union-attr]
    assert push[0] ** 2 + push[1] ** 2 == pytest.approx(values["wind_m_s2"] ** 2)
    assert push[2] == 0.0
    tilt = values["parameters.PLN_TILT_MAX"]
    assert BY_NAME["PLN_TILT_MAX"].read(flight.job.config) == tilt
    before, sensors = plan.bases[1].scenario.sensors, scenario.sensors
    assert isinstance(sensors, MeasuredSensors)
    assert isinstance(before, MeasuredSensors)
    assert sensors.motion_capture is not None
    assert before.motion_capture is not None
    late = sensors.motion_capture.latency_ms - before.motion_capture.latency_ms
    assert late == pytest.approx(values["latency_ms"])
    assert sensors.imu.latency_ms - before.imu.latency_ms == pytest.approx(values["latency_ms"])


def test_a_flight_is_the_same_whatever_else_is_flown() -> None:
    plan = plan_of(HEAD + VARY)
    alone = pickle.loads(pickle.dumps(plan_of(HEAD + VARY))).flight(17)
    flights = CampaignFlights(plan, 40)
    assert [plan.flight(k) for k in range(40)][17] == alone
    assert len({flight.key() for flight in flights}) == 40
    more = plan_of(HEAD.replace("40", "80") + VARY)
    assert more.flight(17) == alone
    assert more.digest == plan.digest
    assert plan_of(HEAD.replace("seed = 3", "seed = 4") + VARY).digest != plan.digest


@pytest.mark.parametrize("design", ["random", "sobol", "latin-hypercube"])
def test_all_designs_stay_within_the_distributions(design: str) -> None:
    plan = plan_of(f'design = "{design}"\n' + HEAD + VARY)
    for k in range(40):
        values = dict(plan.flight(k).values)
        assert 0.9 <= values["vehicle_scale.mass"] <= 1.1
        assert values["latency_ms"] in (0.0, 4.0)
        assert 0.0 <= values["wind_direction_deg"] <= 360.0


def test_a_hypercube_has_no_more_flights_than_it_was_made_for() -> None:
    plan = plan_of('design = "latin-hypercube"\n' + HEAD + VARY)
    with pytest.raises(CampaignError, match="write flights = 41 into the file"):
        plan.check(41)
    plan_of(HEAD).check(41)


def test_a_grid_counts_its_flights_itself() -> None:
    text = HEAD.replace("flights = 40\n", 'design = "grid"\n')
    text += "[vary]\nvehicle_scale.mass = { uniform = [0.9, 1.1], points = 5 }\n"
    plan = plan_of(text + "latency_ms = { choice = [0.0, 2.0] }\n")
    assert plan.count == 40
    found = {(f.case, f.values) for f in (plan.flight(k) for k in range(40))}
    assert len(found) == 40


def test_a_grid_has_each_direction_once() -> None:
    text = GRID + "wind_m_s2 = {{ choice = [0.1] }}\n{more}"
    for more, first in (
        ("", 0.0),
        ("wind_direction_deg = { uniform = [-180.0, 180.0], points = 8 }", -180.0),
    ):
        plan = parse_plan(text.format(more=more), "grid", Path())
        directions = [dict(plan.draw(k).values)["wind_direction_deg"] for k in range(plan.count)]
        assert directions == [first + 45.0 * k for k in range(8)]
        assert "full circle" in str(plan.varied[-1])
    part = "wind_direction_deg = { uniform = [0.0, 90.0], points = 3 }"
    plan = parse_plan(text.format(more=part), "grid", Path())
    assert [dict(plan.draw(k).values)["wind_direction_deg"] for k in range(3)] == [0.0, 45.0, 90.0]


def test_a_direction_of_other_designs_has_the_digest_that_it_had() -> None:
    text = GRID.replace('"grid"', '"random"\nflights = 3') + "wind_m_s2 = { choice = [0.1] }\n"
    plan = parse_plan(text, "random", Path())
    assert repr(plan.varied[-1].distribution) == "Uniform(low=0.0, high=360.0, points=8)"


def test_a_grid_that_is_too_large_says_what_can_be_done() -> None:
    keys = ("mass", "inertia")
    text = GRID + "".join(
        f"vehicle_scale.{key} = {{ uniform = [0.9, 1.1], points = 10000 }}\n" for key in keys
    )
    with pytest.raises(CampaignError, match=r'the grid has 100000000 flights.*the key "flights"'):
        parse_plan(text, "grid", Path())
    plan = parse_plan("flights = 100\n" + text, "grid", Path())
    assert plan.count == 100
    with pytest.raises(CampaignError, match="a campaign has 10000000"):
        plan.check(10_000_001)


def test_faults_are_cases_and_their_numbers_can_vary() -> None:
    text = HEAD + "[[faults]]\nname = 'weak'\nunit = 'motor'\nkind = 'weak'\ninstance = 1\n"
    plan = plan_of(text + "[vary]\nfault.share = { uniform = [0.8, 0.9] }\n")
    assert len(plan.cases) == 8
    without, flight = plan.flight(0), plan.flight(1)
    assert not without.job.scenario.faults
    (fault,) = flight.job.scenario.faults
    assert 0.8 <= fault.share <= 0.9
    assert flight.case.fault == "weak"
    assert len(plan_of("without_fault = false\n" + text).cases) == 4


def test_a_scenario_beside_the_file_is_found_and_named_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text((PACKAGED / "walls-calm.toml").read_text())
    (tmp_path / "file.toml").write_text('flights = 1\nscenarios = ["own.toml"]\n')
    plan = load_plan(tmp_path / "file.toml")
    assert plan.cases[0].scenario == "own.toml"
    assert plan.files == ("own.toml",)


def test_values_that_contradict_each_other_are_a_row_with_the_reason() -> None:
    text = HEAD + "[vary]\ntrajectory.ramp_s = { choice = [600.0] }\n"
    row = CampaignFlights(plan_of(text), 3)[2].row()
    assert row.error
    assert row.flight == 2
    assert row.values == {"trajectory.ramp_s": 600.0}
    assert "must be at most half" in row.reason


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("flights = 1", 'missing key "scenarios"'),
        ("flights = 1\nscenarios = []", "name at least one"),
        ("flights = 1\nscenarios = 'walls'", r"must be an array of texts"),
        ("flights = 1\nscenarios = ['wals']", 'did you mean "walls"'),
        ("flights = 1\nscenarios = ['ground']", "must start in the air on a trajectory"),
        ("flights = 1\nscenarios = ['../x.toml']", "beside the campaign file"),
        ("flights = 1\nscenarios = ['walls', 'walls']", "named twice"),
        ("flights = 0\nscenarios = ['walls']", "1 to 1e\\+07"),
        ("scenarios = ['walls']", 'missing key "flights"'),
        ("flights = 1\nscenarios = ['walls']\nflightz = 2", 'did you mean "flights"'),
        (HEAD + "[vary]\nvehicle_scale.mas = { uniform = [1.0, 1.1] }", 'did you mean "mass"'),
        (HEAD + "[vary]\nvehicle_scale.mass = { uniform = [1.1, 1.0] }", "below the second"),
        (HEAD + "[vary]\nvehicle_scale.mass = { uniform = [0.1, 1.0] }", "must be 0.2 to 5"),
        (HEAD + "[vary]\nvehicle_scale.mass = { normal = [1.0, 0.0] }", "deviation must be above"),
        (HEAD + "[vary]\nvehicle_scale.mass = { choice = [] }", "an array of numbers"),
        (HEAD + "[vary]\nvehicle_scale.mass = 1.0", "must be a distribution, such as"),
        (HEAD + "[vary]\nlatency_ms = { choice = [3.0] }", "in steps of 2"),
        (HEAD + "[vary]\nwind_m_s = { uniform = [0.0, 1.0] }", "moves nothing"),
        (HEAD + "[vary]\nparameters.PLN_TILT_MX = { choice = [1.0] }", 'mean "PLN_TILT_MAX"'),
        (HEAD + "[vary]\nfault.share = { choice = [0.5] }", "no fault is flown"),
        (HEAD + "[parameters]\nPLN_TILT_MAX = 500.0", "is refused"),
        (HEAD + "[[faults]]\nunit = 'planner'\nkind = 'stopped'", "cannot be flown in one process"),
        ("design = 'grid'\n" + HEAD + VARY, "a grid needs points"),
        ("[[", "not TOML"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(CampaignError, match=sentence):
        plan_of(text)
