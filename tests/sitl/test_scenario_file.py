"""Scenario files: what is accepted, and the sentence that refuses the rest."""

from __future__ import annotations

import math
import os
import typing
from pathlib import Path

import pytest

from sitl.scenario import Lissajous, Uniform
from sitl.scenario_file import (
    PACKAGED,
    ScenarioError,
    check_pacing,
    load_scenario,
    parse_scenario,
    scenario_digest,
    scenario_names,
)
from sitl.scenario_validation import check
from sitl.shapes import TABLES
from sitl.simulation import Simulation
from sitl.trajectory import reference
from sitl.world import World

BASE = """
duration_s = 10.0
[start]
kind = "airborne"
[pilot]
plan = "trajectory"
[trajectory]
kind = "lissajous"
centre_m = [0.0, 0.0, -1.2]
amplitude_m = [0.1, 0.1, 0.1]
period_s = [10.0, 10.0, 10.0]
phase_deg = [0.0, 0.0, 0.0]
ramp_s = 2.0
duration_s = 9.0
"""
WALL = """
[[walls]]
name = "front"
normal = [-1.0, 0.0, 0.0]
offset_m = -1.0
clearance_m = 0.1
"""
POINT = """
[[obstacles]]
name = "branch"
position_m = [0.0, 1.0, -1.0]
clearance_m = 0.1
"""
BOX = """
[[zones]]
name = "shelf"
shape = "box"
centre_m = [2.0, 0.0, -1.0]
half_size_m = [0.2, 0.2, 0.2]
clearance_m = 0.05
"""
MOVES = """
way_points = [{ time_s = 1.0, moved_m = [0, 0, 0] }, { time_s = 2.0, moved_m = [0, 1, 0] }]
"""
SPHERE = "[workspace]\nradius_m = 0.1\nd_iw_m = 0.225\n"


def several(table: str, count: int) -> str:
    """So many tables of different names."""
    return "".join(table.replace('name = "', f'name = "{k}') for k in range(count))


@pytest.mark.parametrize("name", scenario_names())
def test_every_packaged_scenario_can_start(name: str) -> None:
    simulation = Simulation(load_scenario(name), 0)
    assert simulation.ended is None
    assert simulation.min_margin_m is None or simulation.min_margin_m > 0.0


def test_the_papers_cases_are_there() -> None:
    assert {"walls", "workspace", "walls-calm", "workspace-calm"} <= set(scenario_names())
    walls, calm = load_scenario("walls"), load_scenario("walls-calm")
    assert walls.duration_s == 120.0
    assert walls.disturbances == (Uniform(0.8, 0.1),)
    assert calm.disturbances == ()
    assert calm.walls == walls.walls
    assert isinstance(walls.trajectory, Lissajous)
    sphere = load_scenario("workspace").workspace
    assert sphere is not None
    assert (sphere.radius_m, sphere.d_iw_m) == (0.075, 0.225)


@pytest.mark.parametrize(
    ("old", "new", "reported"),
    [
        ("duration_s = 10.0", "duratoin_s = 10.0", ['"duratoin_s"', '"duration_s"', "10.0"]),
        ("duration_s = 10.0", "duration_s = -1", ["duration_s = -1", "0.1 to 86400"]),
        ("duration_s = 10.0", "duration_s = nan", ["duration_s = nan", "0.1 to 86400"]),
        ("duration_s = 10.0", 'duration_s = "long"', ["'long'", "must be a number"]),
        ("duration_s = 10.0", "duration_s = true", ["True", "must be a number"]),
        ("duration_s = 10.0", "", ['missing key "duration_s"', "0.1 to 86400"]),
        ("ramp_s = 2.0", "ramp = 2.0", ['"trajectory.ramp"', '"ramp_s"']),
        ("ramp_s = 2.0", "ramp_s = 6.0", ["trajectory.ramp_s = 6", "at most half"]),
        ('"airborne"', '"airbourne"', ["start.kind", '"airborne", "ground"', "did you mean"]),
        ('"lissajous"', "[1.0]", ["trajectory.kind = [1.0]", '"lissajous"']),
        ('"lissajous"', '"lisajous"', ["trajectory.kind", "'lisajous'", '"lissajous"']),
        ("[0.1, 0.1, 0.1]", "[0.1, 0.1]", ["trajectory.amplitude_m", "array of 3 numbers"]),
        ("[0.1, 0.1, 0.1]", "[0.1, -1, 0.1]", ["trajectory.amplitude_m[1] = -1", "0 to 1000"]),
        ('"trajectory"', '"hop"', ["pilot.plan", "airborne"]),
        ('"airborne"', '"airborne"\nposition_m = [1.0, 0.0]', ["start.position_m", "ground"]),
        ('"airborne"', '"ground"\narm_deg = [10.0, 0.0]', ["start.arm_deg", "limp"]),
        ('"airborne"', '"airborne"\narm_deg = [70.0, 0.0]', ["start.arm_deg[0] = 70", "-60 to 60"]),
        (
            '"airborne"',
            '"airborne"\narm_deg = [50.0, 50.0]',
            ["link2", "-90 to 90"],
        ),
    ],
)
def test_a_wrong_line_is_refused_with_key_value_and_what_is_allowed(
    old: str, new: str, reported: list[str]
) -> None:
    with pytest.raises(ScenarioError) as refusal:
        Simulation(parse_scenario(BASE.replace(old, new, 1), "test"), 0)
    assert all(part in str(refusal.value) for part in reported), str(refusal.value)


@pytest.mark.parametrize(
    ("extra", "reported"),
    [
        (WALL.replace("-1.0, 0.0, 0.0", "-1.0, 0.5, 0.0"), ["walls[0].normal", "1.118"]),
        (WALL.replace("clearance_m", "clearence_m"), ['"walls[0].clearence_m"', '"clearance_m"']),
        (WALL + WALL, ["walls[1].name", "differ"]),
        (WALL.replace("offset_m = -1.0", "offset_m = -0.05"), ["front/base", "-130.0 mm"]),
        (WALL + POINT.replace("branch", "front"), ["obstacles[0].name", "differ"]),
        (POINT.replace("0.1", "0.0"), ["obstacles[0].clearance_m", "0.001 to 10"]),
        (POINT.replace("1.0, -1.0", "0.05, -1.2"), ["branch/end_effector", "-75.0 mm"]),
        (several(WALL, 40) + several(POINT, 25), ["are 65", "at most 64"]),
        (BOX.replace('"box"', '"bx"'), ["zones[0].shape = 'bx'", '"box"', "did you mean"]),
        (BOX.replace('shape = "box"', ""), ['missing key "zones[0].shape"', '"half-space"']),
        (BOX.replace("0.2, 0.2, 0.2", "0.2, 0.0, 0.2"), ["zones[0].half_size_m[1]", "0.001"]),
        (BOX + "radius_m = 1.0", ['"zones[0].radius_m"']),
        (BOX + 'keep_in = "yes"', ["zones[0].keep_in", "true or false"]),
        (WALL + BOX.replace("shelf", "front"), ["zones[0].name", "differ"]),
        (BOX + MOVES + "velocity_m_s = [1, 0, 0]", ["zones[0].velocity_m_s", "way_points"]),
        (BOX + MOVES.replace("2.0", "1.0"), ["zones[0].way_points[1].time_s = 1", "after 1"]),
        (BOX.replace("2.0, 0.0, -1.0", "0.4, 0.0, -1.4"), ["shelf/leg1", "at t = 0"]),
        ("[workspace]\nradius_m = 0.0\nd_iw_m = 0.225", ["workspace.radius_m", "0.001 to 10"]),
        ("[workspace]\nradius_m = 0.1\nd_iw_m = 0.4", ["workspace/base", "-75.0 mm"]),
        ('[[disturbances]]\nkind = "unifrom"\n', ["disturbances[0].kind", '"uniform"']),
        ('[[disturbances]]\nkind = "uniform"\n', ['"disturbances[0].amplitude_m_s2"']),
        ("disturbances = 3\n", ["must be"]),
        ("[sensors.imu]\nlatency_ms = 3", ["sensors.imu.latency_ms", "steps of 2"]),
        ("[sensors]\nimmu = {}", ['"sensors.immu"', '"imu"']),
        ("[vehicle_scale]\nmass = 30", ["vehicle_scale.mass = 30", "0.2 to 5"]),
        ("[vehicle_scale]\nmass = 3", ["home_posture", "rotor 1 would need"]),
        ('name = "x"', ['unknown key "name"']),
    ],
)
def test_a_wrong_addition_is_refused(extra: str, reported: list[str]) -> None:
    # Bare keys belong before the first table.
    text = BASE + extra if extra.lstrip().startswith("[") else extra + BASE
    with pytest.raises(ScenarioError) as refusal:
        Simulation(parse_scenario(text, "test"), 0)
    assert all(part in str(refusal.value) for part in reported), str(refusal.value)


DEEP = 2_000


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        ("a = " + "[" * DEEP + "]" * DEEP, "nested too deeply"),
        ("a = " + "{b = " * DEEP + "1" + "}" * DEEP, "nested too deeply"),
        ("a" + ".a" * DEEP + " = 1\n" + BASE, "nested too deeply"),
        (f"duration_s = 1{'0' * 400}\n", "duration_s = 1.*at most 64 bits"),
        (f"duration_s = -{(1 << 64) - 1}\n", "must be 0.1 to 86400"),
        (f"duration_s = 0x1{'0' * 5000}\n", "number too long to show: an integer must have"),
        (f"duration_s = 1{'0' * 5000}\n", "must have at most 64 bits"),
        (f"duration_s = {1 << 64}\n", "must have at most 64 bits"),
        (f"duration_s = {[0] * 50_000}\n", "must be a number"),
        (f"{'x' * 200_000} = 1\n", "a key must have at most 128 characters"),
        (f"{'x' * 128} = 1\n", "unknown key"),
        ('"\\u001b[2Jname" = 1\n', "unknown key"),
    ],
)
def test_a_damaged_scenario_is_refused_in_one_short_sentence(text: str, reported: str) -> None:
    text = text if BASE in text else text + BASE.replace("duration_s = 10.0", "", 1)
    with pytest.raises(ScenarioError, match=reported) as refusal:
        parse_scenario(text, "damaged")
    assert len(str(refusal.value)) < 1_000


def test_a_name_that_a_terminal_would_obey_is_refused() -> None:
    for name in ("a\\u001b[2J", "a\\nPASS", "a\\u202e"):
        with pytest.raises(ScenarioError, match=r"walls\[0\].name = .*printable") as refusal:
            check(parse_scenario(BASE + WALL.replace("front", name), "test"))
        assert str(refusal.value).isprintable()


def test_a_file_of_any_length_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "long.toml"
    path.write_text(BASE + "".join(WALL.replace("front", f"w{k}") for k in range(100_000)))
    with pytest.raises(ScenarioError, match="too long: must be at most"):
        load_scenario(str(path))
    endless = tmp_path / "endless.toml"
    endless.symlink_to("/dev/zero")
    with pytest.raises(ScenarioError, match="it is not a regular file"):
        load_scenario(str(endless))
    endless.unlink()
    os.mkfifo(endless)  # whose writer never comes
    with pytest.raises(ScenarioError, match="it is not a regular file"):
        load_scenario(str(endless))
    os.truncate(path, 1 << 40)  # as long as a disk, and empty
    with pytest.raises(ScenarioError, match="too long"):
        load_scenario(str(path))


def test_an_unknown_scenario_names_the_nearest_and_all() -> None:
    with pytest.raises(ScenarioError, match='did you mean "walls"') as refusal:
        load_scenario("wals")
    assert all(name in str(refusal.value) for name in scenario_names())


def test_a_path_is_read_and_a_missing_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(BASE)
    assert load_scenario(str(path)).name == "mine"
    with pytest.raises(ScenarioError, match="No such file"):
        load_scenario(str(tmp_path / "none.toml"))


def test_what_is_not_toml_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="not TOML"):
        parse_scenario("duration_s = ", "broken")
    (tmp_path / "latin.toml").write_bytes(b"# gr\xfc\xdfe\n")
    with pytest.raises(ScenarioError, match="not UTF-8"):
        load_scenario(str(tmp_path / "latin.toml"))


def test_a_scenario_of_the_same_name_with_another_disturbance_has_another_digest(
    tmp_path: Path,
) -> None:
    content = (PACKAGED / "walls.toml").read_bytes()
    mine = tmp_path / "walls.toml"
    mine.write_bytes(content)
    assert scenario_digest(str(mine)) == scenario_digest("walls")
    mine.write_bytes(content.replace(b"0.8", b"0.9"))
    assert load_scenario(str(mine)) != load_scenario("walls")
    assert scenario_digest(str(mine)) != scenario_digest("walls")


def test_the_grazing_path_touches_every_safety_zone_and_enters_none() -> None:
    walls, grazing = load_scenario("walls"), load_scenario("walls-grazing")
    assert (grazing.walls, grazing.disturbances) == (walls.walls, walls.disturbances)
    path = reference(grazing.trajectory)
    for wall in grazing.walls:
        gaps = [
            sum(n * x for n, x in zip(wall.normal, path.at(0.02 * k).p, strict=True))
            - wall.offset_m
            - wall.clearance_m
            for k in range(6000)
        ]
        assert -1e-9 < min(gaps) < 2e-3


ZONES = {
    "half-space": ("normal = [-1.0, 0.0, 0.0]\noffset_m = 1.0", ["normal = ", "length 1"]),
    "ball": ("centre_m = [3.0, 0.0, 0.0]\nradius_m = 0.1\nkeep_in = true", ["radius_m", "above"]),
    "vertical cylinder": (
        "north_east_m = [3.0, 0.0]\nradius_m = 0.1\ntop_m = 0.0\nbottom_m = -1.0",
        ["bottom_m = -1", "below top_m"],
    ),
    "cylinder": (
        "begin_m = [3.0, 0.0, 0.0]\nend_m = [3.0, 0.0, 0.0]\nradius_m = 0.1",
        ["end_m", "from begin_m"],
    ),
    "box": (
        "centre_m = [3.0, 0.0, 0.0]\nhalf_size_m = [0.1, 1.0, 1.0]\nkeep_in = true",
        ["half_size_m", "above clearance_m"],
    ),
    "target sphere": ("offset_m = [0.0, 0.0, 0.0]\nradius_m = 1.0\nkeep_in = false", ["keep_in"]),
}


@pytest.mark.parametrize("shape", ZONES)
def test_every_shape_says_what_is_wrong_with_its_numbers(shape: str) -> None:
    numbers, reported = ZONES[shape]
    numbers = numbers.replace("normal = [-1.0", "normal = [-0.5")
    table = f'[[zones]]\nname = "one"\nshape = "{shape}"\nclearance_m = 0.2\n{numbers}\n'
    with pytest.raises(ScenarioError) as refusal:
        check(parse_scenario(BASE + table, "test"))
    assert all(part in str(refusal.value) for part in ["zones[0].", *reported])


@pytest.mark.parametrize(
    "normal",
    [(-0.98, 0.28, 0.0), (-0.9487, 0.3162, 0.0), (0.0, 0.6, -0.77), (-1.02, 0.0, 0.0)],
)
def test_a_normal_that_was_rounded_is_a_unit_vector(normal: tuple[float, ...]) -> None:
    wall = WALL.replace("[-1.0, 0.0, 0.0]", str(list(normal)))
    zone = (
        '[[zones]]\nname = "one"\nshape = "half-space"\nclearance_m = 0.2\n'
        f"normal = {list(normal)}\noffset_m = -1.0\n"
    )
    scenario = parse_scenario(BASE + wall + zone, "test")
    length = math.hypot(*normal)
    for plane in (scenario.walls[0], scenario.zones[0]):
        assert plane.normal == pytest.approx([part / length for part in normal])  # type: ignore[union-attr]
        assert math.hypot(*plane.normal) == pytest.approx(1.0, abs=1e-12)  # type: ignore[union-attr]


def test_a_unit_normal_stays_to_the_bit() -> None:
    normal = (-0.6000001, 0.8, 0.0)
    scenario = parse_scenario(BASE + WALL.replace("[-1.0, 0.0, 0.0]", str(list(normal))), "test")
    assert scenario.walls[0].normal == normal


def test_all_shapes_have_been_tried() -> None:
    words = {typing.get_args(typing.get_type_hints(table)["shape"])[0] for table in TABLES}
    assert words == set(ZONES)


def test_any_mixture_of_zones_walls_points_and_workspace_is_judged_together() -> None:
    text = BASE + WALL + POINT + BOX + SPHERE
    zones = [key.partition("/")[0] for key in World(parse_scenario(text, "test")).keys]
    assert list(dict.fromkeys(zones)) == ["front", "branch", "shelf", "workspace"]
    assert zones.count("workspace") == 1
    assert zones.count("shelf") == 13
    points = World(parse_scenario('body = "points"\n' + text, "test"))
    assert len(points.keys) == 3 + 3 + 3 + 1


FAULT = '[[faults]]\nunit = "{}"\nkind = "{}"\n{}\n'


@pytest.mark.parametrize(
    ("unit", "kind", "more", "sentence"),
    [
        ("gyros", "off", "", 'faults[0].unit = "gyros": must be one of "gyro"'),
        ("gyro", "of", "", 'faults[0].kind = "of": must be one of "off"'),
        ("gyro", "full", "", 'faults[0].kind = "full": a gyro can be "off", "stuck"'),
        ("mag", "off", "", 'faults[0].unit = "mag": not on board; the sensors are gyro, accel'),
        ("motor", "off", "instance = 5", "faults[0].instance = 5: must be 0 (all) to 4"),
        ("joint", "off", "instance = 3", "faults[0].instance = 3: must be 0 (all) to 2"),
        ("gps", "off", "instance = 1", "faults[0].instance = 1: must be 0, because"),
        (
            "clock",
            "jump",
            "jump_s = -2.0\nstart_s = 1.0",
            "faults[0].jump_s = -2: must be at least -1",
        ),
        ("gyro", "off", "start_s = -1", "faults[0].start_s = -1: must be 0 to 86400"),
        ("gyro", "off", "duration = 1", 'unknown key "faults[0].duration" = 1, did you mean'),
    ],
)
def test_a_fault_that_cannot_be_is_refused_in_a_sentence(
    unit: str, kind: str, more: str, sentence: str
) -> None:
    with pytest.raises(ScenarioError) as refused:
        check(parse_scenario(BASE + FAULT.format(unit, kind, more), "one"))
    assert str(refused.value).startswith(sentence)
    assert "\n" not in str(refused.value)


def test_a_fault_that_means_nothing_in_lockstep_is_refused_there() -> None:
    late = parse_scenario(BASE + FAULT.format("to vehicle", "delayed", ""), "one")
    check_pacing(late, realtime=True)
    with pytest.raises(ScenarioError, match=r"faults\[0\]: to vehicle delayed needs real time"):
        check_pacing(late, realtime=False)


def test_encoders_of_a_suite_share_a_message_and_lose_it_together() -> None:
    text = BASE + FAULT.format("encoder", "off", "instance = 1")
    check(parse_scenario(text, "one"))
    with pytest.raises(ScenarioError, match=r"instance = 1: must be 0 \(all\)"):
        check(parse_scenario(text, "one", "mocap"))


def test_a_fault_of_a_sensor_needs_the_sensor_in_the_suite_that_is_flown() -> None:
    text = BASE + FAULT.format("mag", "stuck", "")
    check(parse_scenario(text, "one", "gnss"))
    with pytest.raises(ScenarioError, match="not on board"):
        check(parse_scenario(text, "one", "mocap"))
