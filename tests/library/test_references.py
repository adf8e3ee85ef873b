"""Own references: callables, tables and files are one curve, and what is none is refused."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pandion
from pandion.references import trajectory
from sitl.compiled import kernel
from sitl.mission_clock import MissionClock
from sitl.scenario import Circle, Lissajous, Points, Polynomial, Push, Trajectory
from sitl.scenario_file import parse_scenario, scenario_digest
from sitl.scenario_text import scenario_text
from sitl.trajectory import curve_row, place_on_curve, reference

CURVES: dict[str, Trajectory] = {
    "points": Points(
        (0.0, 2.0, 3.0, 7.5), ((0, 0, -1), (0.3, 0, -1), (0.2, 0.5, -1.2), (0, 0, -1))
    ),
    "free": Points((1.0, 2.0, 4.0), ((0, 0, -1), (1, 2, -1), (0, 0, -1)), ends="free"),
    "circle": Circle((1.0, 2.0, -1.0), 0.7, 9.0, 2.0, 30.0, start_deg=30.0),
    "the other way": Circle((1.0, 2.0, -1.0), 0.7, 9.0, 2.0, 30.0, -40.0, clockwise=False),
    "polynomial": Polynomial((0.0, 0.0, 0.1, -0.005), (1.0,), (-1.0, 0.02), 10.0),
}
each_curve = pytest.mark.parametrize("name", CURVES)


def wave(t: float) -> tuple[float, float, float]:
    return 0.2 * math.sin(0.5 * t), 0.1 * math.cos(0.4 * t), -1.0


@kernel
def _compiled(row: Any, t: float) -> Any:
    return place_on_curve(row, t)


@each_curve
@settings(
    max_examples=20 if settings.default.max_examples == 100 else settings.default.max_examples
)
@given(t=st.floats(-5.0, 40.0))
def test_velocity_and_acceleration_are_the_derivatives_and_kernels_see_the_same(
    name: str, t: float
) -> None:
    curve = reference(CURVES[name])
    h, at = 1e-4, curve.at(t)
    assert at.p == curve.place(t)
    # Of one sine in 500 the last bit differs.
    np.testing.assert_allclose(_compiled(np.array(curve.row), t), at.p, rtol=0.0, atol=1e-14)
    knots = getattr(CURVES[name], "time_s", (0.0, 10.0, 30.0))
    if min(abs(t - knot) for knot in knots) < 2.0 * h:
        return
    before, after = curve.at(t - h), curve.at(t + h)
    np.testing.assert_allclose(np.subtract(after.p, before.p) / (2.0 * h), at.v, atol=1e-6)
    np.testing.assert_allclose(np.subtract(after.v, before.v) / (2.0 * h), at.a, atol=1e-6)


@each_curve
def test_a_scenario_with_it_is_read_back_and_stands_at_both_ends(name: str) -> None:
    walls = pandion.load_scenario("walls")
    scenario = pandion.load_scenario(replace(walls, trajectory=CURVES[name]))
    assert parse_scenario(scenario_text(scenario), "walls") == scenario
    clock = MissionClock(scenario)
    for t in (0.0, 1000.0):
        assert clock.target_at(t).v == (0.0, 0.0, 0.0)


def test_a_circle_is_one_and_begins_where_it_says() -> None:
    for curve, turn in ((CURVES["circle"], 1.0), (CURVES["the other way"], -1.0)):
        assert isinstance(curve, Circle)
        ref, begin = reference(curve), math.radians(curve.start_deg)
        np.testing.assert_allclose(
            ref.place(0.0), (1.0 + 0.7 * math.cos(begin), 2.0 + 0.7 * math.sin(begin), -1.0)
        )
        for t in np.linspace(0.0, 30.0, 50).tolist():
            x, y, _ = ref.place(t)
            assert math.hypot(x - 1.0, y - 2.0) == pytest.approx(0.7)
        (x, y, _), (vx, vy, _) = ref.at(10.0).p, ref.at(10.0).v
        assert ((x - 1.0) * vy - (y - 2.0) * vx) * turn > 0.0


def test_the_spline_goes_through_its_points() -> None:
    for name in ("points", "free"):
        curve = CURVES[name]
        assert isinstance(curve, Points)
        for t, place in zip(curve.time_s, curve.position_m, strict=True):
            np.testing.assert_allclose(reference(curve).place(t), place, atol=1e-12)
    assert reference(CURVES["points"]).at(1e-9).v == pytest.approx((0.0, 0.0, 0.0), abs=1e-8)


def test_a_callable_a_table_and_a_file_fly_the_same(tmp_path: Path) -> None:
    sampled = trajectory(wave, 1.0)
    assert isinstance(sampled, Points)
    table = np.array([(t, *p) for t, p in zip(sampled.time_s, sampled.position_m, strict=True)])
    file = tmp_path / "wave.csv"
    lines = ["time_s,north_m,east_m,down_m", *(",".join(map(repr, row)) for row in table.tolist())]
    file.write_text("# a wave\n" + "\n".join(lines) + "\n")
    assert trajectory(file, 1.0) == trajectory(table, 1.0)
    # The ends of a table are at rest, those of a callable are its own.
    assert replace(trajectory(table, 1.0), ends="free") == sampled
    flown = [
        pandion.fly("walls", duration_s=0.6, reference=one, log=False).truth
        for one in (file, table)
    ]
    assert flown[0] == flown[1]
    scenario = tmp_path / "mine.toml"
    text = scenario_text(pandion.load_scenario("walls", duration_s=0.6))
    head, _, rest = text.partition("[trajectory]")
    scenario.write_text(
        head + '[trajectory]\nkind = "points"\nfile = "wave.csv"\n' + rest[rest.index("\n\n[[") :]
    )
    assert pandion.fly(scenario, log=False).truth == flown[0]
    before = scenario_digest(str(scenario))
    file.write_text(file.read_text().replace("-1.0", "-1.1"))
    assert scenario_digest(str(scenario)) != before


def test_a_lissajous_as_a_callable_is_the_scenarios_flight() -> None:
    scenario = pandion.load_scenario("workspace-calm", duration_s=2.0)
    assert isinstance(scenario.trajectory, Lissajous)
    own = reference(replace(scenario.trajectory, heading="start"))
    ours = pandion.fly(scenario, log=False)
    same = pandion.fly(scenario, reference=own.place, log=False)
    # The sphere of the workspace rides on the reference: compiled judge and clock agree on it.
    assert ours.min_margin == pytest.approx(same.min_margin, abs=1e-4)
    assert ours.tracking_rms == pytest.approx(same.tracking_rms, abs=1e-4)


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-13")
def test_a_push_is_a_reference_too() -> None:
    push = Push((-1.0, 0.0, 0.0), ((0.975, 0.0, -1.2),), (4.0,), (1.0,), away_m=0.1, approach_s=2.0)
    result = pandion.fly("probe", reference=push, duration_s=7.0, log=False)
    (use,) = result.truth.touches.values()
    assert 3.5 < use.force_max_n < 6.0
    assert use.contact_s > 1.0


def test_yaw_is_taken_from_the_fourth_number() -> None:
    def turning(t: float) -> tuple[float, float, float, float]:
        return 0.0, 0.0, -1.0, 0.02 * t + 3.1

    result = pandion.fly("walls", duration_s=3.0, reference=turning, log=False)
    clock = MissionClock(result.scenario)
    assert result.scenario.start.yaw_deg == pytest.approx(math.degrees(3.1))
    begin = clock.starts_s or 0.0
    for t in (0.0, 1.0, 2.9):
        error = clock.yaw_at(begin + t) - (0.02 * t + 3.1)
        assert math.remainder(error, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)


WRONG: dict[str, tuple[Any, str]] = {
    "shape": (lambda t: (1.0, 2.0), r"must have shape \(3,\), has \(2,\)"),
    "nan": (lambda t: (math.nan, 0.0, -1.0), "every number must be finite"),
    "jump": (lambda t: (float(t > 0.33), 0.0, -1.0), "jumps or bends by"),
    "millimetres": (lambda t: (0.0, 0.0, -1200.0), "must be within ±1000 m"),
    "raises": (lambda t: 1 / 0, "ZeroDivisionError"),
    "table": (np.zeros((4, 3)), r"must have shape \(n, 4\)"),
    "one row": (np.zeros((1, 4)), "must have 2 to"),
    "backwards": (np.array([(0, 0, 0, -1), (1, 0, 0, -1), (0.5, 0, 0, -1)]), r"time_s\[2\] = 0.5"),
    "file": ("nowhere.csv", "cannot read points"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_no_reference_is_one_sentence(wrong: str) -> None:
    given_, sentence = WRONG[wrong]
    with pytest.raises(ValueError, match=sentence) as found:
        pandion.fly("walls", duration_s=1.0, reference=given_, log=False)
    assert "\n" not in str(found.value)


LINES: dict[str, tuple[str, str]] = {
    "no header": ("0,0,0,-1\n1,0,0,-1\n", "the first line must be"),
    "empty": ("", "the first line must be"),
    "no plain digits": ("time_s,north_m,east_m,down_m\n0,0,0,1_0\n", "line 2: must be 4 finite"),
    "short": ("time_s,north_m,east_m,down_m\n0,0,0\n", "line 2: must be 4 finite numbers"),
    "text": ("time_s,north_m,east_m,down_m\n0,0,0,-1\n1,a,0,-1\n", "line 3"),
    "nan": ("time_s,north_m,east_m,down_m\n0,0,0,nan\n", "line 2"),
    "late": ("time_s,north_m,east_m,down_m\n0,0,0,-1\n99999,0,0,-1\n", "time_s"),
    "far": ("time_s,north_m,east_m,down_m\n0,0,0,-1\n1,0,0,-5000\n", "position_m"),
}


@pytest.mark.parametrize("wrong", LINES)
def test_a_file_of_points_is_read_strictly(wrong: str, tmp_path: Path) -> None:
    text, sentence = LINES[wrong]
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(pandion.ScenarioError, match=sentence):
        pandion.fly("walls", duration_s=1.0, reference=tmp_path / "p.csv", log=False)


def test_scenario_keys_are_checked() -> None:
    walls = pandion.load_scenario("walls")
    for curve, sentence in (
        (replace(CURVES["circle"], ramp_s=20.0), "at most half"),
        (replace(CURVES["polynomial"], east=()), "1 to 12 coefficients"),
        (replace(CURVES["points"], yaw_deg=(1.0,)), "1 entries for 4 times"),
        (replace(CURVES["points"], time_s=(0.0, 1.0)), "4 entries for 2 times"),
    ):
        with pytest.raises(pandion.ScenarioError, match=sentence):
            pandion.load_scenario(replace(walls, trajectory=curve))
    text = '[trajectory]\nkind = "points"\nfile = "up.csv"\ntime_s = [0.0]\n'
    with pytest.raises(pandion.ScenarioError, match="together with file"):
        parse_scenario(text, "x", None, Path())
    for named in ("3", '"../up.csv"', '"/up.csv"'):
        with pytest.raises(pandion.ScenarioError, match="beside the scenario's"):
            parse_scenario(f'[trajectory]\nkind = "points"\nfile = {named}\n', "x", None, Path())
    assert len(list(itertools.pairwise(curve_row(CURVES["points"])))) > 14
