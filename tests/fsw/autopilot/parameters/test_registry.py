"""The table of parameters: complete, in range, sayable on the wire and in files."""

import math
import re
from collections import Counter
from dataclasses import replace
from operator import attrgetter

import numpy as np
import pytest

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.parameters.facts import FACTS
from fsw.autopilot.parameters.flight_config import CONTROLLERS, FlightConfig, flight_config
from fsw.autopilot.parameters.param_type import as_text, nearest_decimal
from fsw.autopilot.parameters.registry import BY_NAME, PARAMETERS, Parameter
from fsw.autopilot.tuning import flat, number_at, tuned
from tests.fsw.autopilot.parameters import px4_types

# Numbers of FlightConfig that are no parameters, by the beginning of their path, and why.
NO_PARAMETERS = {
    "planner.weights.home_to_touch": "part of the law of pressing",
    "tuning.press": "the law of pressing, whose bound is judged with these",
    "tuning.compensation_near": "the law of pressing, whose bound is judged with these",
    "estimator.accel_range": "range of the inertial unit",
    "estimator.gyro_range": "range of the inertial unit",
    "estimator.accel_jump": "what the airframe can do from one reading to the next",
    "estimator.gyro_jump": "what the airframe can do from one reading to the next",
    "estimator.imu_gap": "counted in ticks",
    "estimator.lost_": "what the airframe does while the inertial unit is lost",
    "estimator.velocity": "of use in the first second alone",
    "estimator.pose.noise_at_start": "of use in the first second alone",
    "estimator.start_heading": "of use in the first second alone",
    "estimator.barometer.bias": "the weather",
    "estimator.pose.delay_walk": "of clocks",
    "estimator.longest_delay": "size of the filter's buffer",
    "estimator.delay_decay": "how the horizon follows the delays that are seen",
    "estimator.rangefinder.ground": "the local frame's origin",
    "estimator.encoder_noise": "describes the joints; the joint filter's gain follows from it",
    "estimator.joint_disturbance_walk": "describes the joints",
    "estimator.reset_time": "PX4 has no parameter for it either",
    "estimator.stale_time": "when a sensor is called silent",
    "origin.": "given at start: single precision is metres off in a latitude",
    "airframe.": "describes the vehicle; scales its actuators and telemetry, which must not change",
    "planner.horizon": "size of the program, which is laid out once",
    "planner.period_us": "the planner's grid, counted in ticks everywhere",
    "planner.sqp_iterations": "bounds the time of a planning cycle, which is budgeted",
    "planner.walls.skipped_nodes": "size of the program",
    "planner.workspace.skipped_nodes": "size of the program",
    "planner.hard_skipped_nodes": "size of the program",
    "tick_period_us": "the loop's grid, given by the simulator link",
    "plan_delay_ticks": "part of the grid: when answers take effect",
    "catch_up_ticks": "bounds the work of one tick",
}


def numbers(config: FlightConfig) -> list[str]:
    """Paths of every number, one a number, of tuples too."""
    return [path for path, value in flat(config).items() if not isinstance(value, bool)]


def test_every_number_of_the_configuration_is_a_parameter_or_says_why_not() -> None:
    tunable = {parameter.path for parameter in PARAMETERS}
    for path in numbers(FlightConfig()):
        excused = [start for start in NO_PARAMETERS if path.startswith(start)]
        named = path in tunable
        # A group that is excused, by its dot, may have members that are parameters all the same.
        alone = [start for start in excused if not start.endswith(".")]
        assert named != bool(alone if named else excused), (
            f"{path} is to stand in fsw/autopilot/parameters/registry.py, or with its reason here, "
            "in NO_PARAMETERS"
        )


def test_no_excuse_is_left_without_a_number() -> None:
    for start in NO_PARAMETERS:
        assert any(path.startswith(start) for path in numbers(FlightConfig())), start


@pytest.mark.parametrize("parameter", PARAMETERS, ids=lambda p: p.name)
def test_a_parameter_is_sayable_and_its_default_in_range(parameter: Parameter) -> None:
    assert re.fullmatch(r"[A-Z][A-Z0-9_]{0,15}", parameter.name)
    assert parameter.least < parameter.most
    assert parameter.refusal(parameter.default) is None
    assert parameter.refusal(parameter.least) is None
    assert parameter.refusal(parameter.most) is None
    # Limits must be REAL32 as well, or the value at the limit comes back outside it.
    for limit in (parameter.least, parameter.most):
        assert parameter.refusal(nearest_decimal(np.float32(limit))) is None
    assert parameter.meaning[0] != " "
    assert not parameter.meaning.endswith(".")


@pytest.mark.parametrize("parameter", PARAMETERS, ids=lambda p: p.name)
def test_a_default_survives_six_decimals_and_single_precision(parameter: Parameter) -> None:
    believed = number_at(FlightConfig(), parameter.path)
    assert float(f"{parameter.default:f}") == parameter.default
    assert parameter.default * parameter.scale == pytest.approx(believed, rel=1e-6)


@pytest.mark.parametrize("parameter", PARAMETERS, ids=lambda p: p.name)
def test_what_is_no_number_is_outside_every_range(parameter: Parameter) -> None:
    for value in (math.nan, math.inf, -math.inf):
        assert parameter.refusal(value) is not None
    outside = parameter.most + 0.01 * (parameter.most - parameter.least)
    assert parameter.name in str(parameter.refusal(outside))


@pytest.mark.parametrize("parameter", PARAMETERS, ids=lambda p: p.name)
def test_both_ends_of_a_range_make_a_configuration_and_move_one_number(
    parameter: Parameter,
) -> None:
    before = flat(FlightConfig())
    for value in (parameter.least, parameter.most):
        config = tuned(FlightConfig(), ((parameter.path, value * parameter.scale),))
        assert parameter.read(config) == pytest.approx(value, rel=1e-6)
        moved = {path for path, number in flat(config).items() if number != before[path]}
        assert moved <= {parameter.path}


def test_names_and_paths_are_unique_and_indexed_in_order() -> None:
    assert [p.name for p in PARAMETERS] == sorted(BY_NAME)
    assert max(Counter(p.path for p in PARAMETERS).values()) == 1


def test_names_of_px4_mean_what_they_mean_there() -> None:
    assert BY_NAME["MIS_TAKEOFF_ALT"].read(FlightConfig()) == FlightConfig().limits.takeoff_climb


def test_a_preset_shows_its_own_values() -> None:
    assert BY_NAME["WALL_LAMBDA"].read(flight_config(robustness="paper-1")) == 1.0


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_every_controller_has_the_same_paths(controller: str) -> None:
    config = flight_config(controller)
    for parameter in PARAMETERS:
        parameter.read(config)


def test_the_nearest_decimal_is_the_number_everybody_means() -> None:
    assert nearest_decimal(0.10000000149011612) == 0.1
    assert nearest_decimal(1.0 / 3.0) == 0.33333334
    assert math.isnan(nearest_decimal(math.nan))
    assert nearest_decimal(1e300) == math.inf
    assert [as_text(x) for x in (0.12, 400.0, 1e-6, 2.0)] == ["0.12", "400", "1e-06", "2"]


def test_a_number_keeps_its_type() -> None:
    config = tuned(FlightConfig(), (("limits.landed_time_us", 700_000.4),))
    assert config.limits.landed_time_us == 700_000
    assert isinstance(config.limits.landed_time_us, int)


def test_tuning_leaves_what_it_does_not_name() -> None:
    config = tuned(FlightConfig(), (("planner.walls.alpha", 1.5), ("upset_yaw", 0.5)))
    expected = FlightConfig()
    walls = replace(expected.planner.walls, alpha=1.5)
    planner = replace(expected.planner, walls=walls)
    assert config == replace(expected, planner=planner, upset_yaw=0.5)
    assert tuned(expected, ()) is expected


def test_numbers_that_contradict_each_other_are_refused_by_their_dataclass() -> None:
    with pytest.raises(ValueError, match="barrier slope is 20"):
        tuned(FlightConfig(), (("planner.walls.slope", 20.0),))


def test_px4_s_names_have_px4_s_types() -> None:
    types = {name: parameter.default for name, parameter in BY_NAME.items()} | {
        fact.name: BY_NAME[fact.repeats].default if fact.repeats else fact.read({}, AIRFRAME)
        for fact in FACTS
    }
    for names, kind in ((px4_types.INT32, int), (px4_types.FLOAT, float)):
        assert [name for name in names if type(types[name]) is not kind] == []


@pytest.mark.parametrize("parameter", PARAMETERS, ids=lambda p: p.name)
def test_what_counts_or_chooses_is_an_integer_and_nothing_else_is(parameter: Parameter) -> None:
    field = attrgetter(parameter.path)(FlightConfig())
    if parameter.choices or (isinstance(field, int) and parameter.scale == 1.0):
        assert parameter.integer
    if parameter.integer:
        assert type(parameter.default) is int
        assert parameter.name in px4_types.INT32 or isinstance(field, int | str)
        assert parameter.refusal(parameter.least + 0.5) is not None
        assert float(parameter.least).is_integer()
        assert float(parameter.most).is_integer()
    else:
        assert type(parameter.default) is float
        assert parameter.name not in px4_types.INT32
