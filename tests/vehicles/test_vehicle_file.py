"""Vehicle files: what is accepted, and the sentence that refuses the rest."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from fsw.autopilot.model.airframe import AIRFRAME
from tests.fsw.paper_arm import LENGTHS, LIMIT1, LIMIT12
from vehicles.vehicle_file import (
    PACKAGED,
    VehicleError,
    inertia_matrix,
    load_vehicle,
    parse_vehicle,
    vehicle_names,
)

PAPER = (PACKAGED / "paper.toml").read_text(encoding="utf-8")


def refused(*changes: tuple[str, str], text: str = PAPER) -> str:
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    with pytest.raises(VehicleError) as error:
        parse_vehicle(text, "mine")
    sentence = str(error.value)
    assert "\n" not in sentence
    return sentence


@pytest.mark.parametrize("name", vehicle_names())
def test_a_packaged_vehicle_can_be_read_and_kept_as_a_key(name: str) -> None:
    vehicle = load_vehicle(name)
    assert vehicle.name == name
    assert hash(vehicle) == hash(load_vehicle(name))


def test_paper_is_the_vehicle_that_the_flight_software_knows() -> None:
    paper = load_vehicle("paper")
    assert math.isclose(paper.mass, AIRFRAME.mass)
    assert paper.base.inertia[:3] == AIRFRAME.bodies.base_inertia[:3]
    assert [rotor.thrust_max for rotor in paper.rotors] == [AIRFRAME.weakest_thrust] * 4
    lengths = [paper.joints[1].xyz[2], paper.end_effector.position[2]]
    assert lengths == list(LENGTHS)
    assert [joint.link.mass for joint in paper.joints] == list(AIRFRAME.bodies.mass[:2])
    assert [joint.link.inertia[1] for joint in paper.joints] == [4.256e-5, 8.321e-5]
    assert paper.joints[0].position_max == LIMIT1
    assert paper.coupled_limits[0].maximum == LIMIT12
    assert paper.limits.tilt == AIRFRAME.tilt_max


def test_its_parts_and_points_are_what_the_flight_software_keeps_clear() -> None:
    paper = load_vehicle("paper")
    kept = {part.name: part for part in AIRFRAME.parts}
    for part in paper.parts:
        one = kept[part.name]
        assert (one.begin, one.end, one.radius) == (part.position, part.end, part.radius)
        assert one.on == paper.places[part.on]
    assert [point.name for point in AIRFRAME.points] == ["base", "joint2", "end_effector"]
    assert AIRFRAME.leg_length == 0.32


def test_axes_that_are_rounded_are_scaled() -> None:
    text = PAPER.replace("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.707, 0.707]")
    for joint in parse_vehicle(text, "mine").joints:
        assert math.isclose(math.hypot(*joint.axis), 1.0, rel_tol=1e-15)


def test_joints_without_a_rest_posture_rest_at_zero() -> None:
    assert parse_vehicle(PAPER.replace("rest_posture", "# "), "mine").rest_posture == (0.0, 0.0)


def test_the_six_entries_are_those_of_the_matrix() -> None:
    matrix = inertia_matrix((1.0, 2.0, 3.0, 0.1, 0.2, 0.3))
    np.testing.assert_array_equal(matrix, matrix.T)
    assert (matrix[0, 1], matrix[0, 2], matrix[1, 2]) == (0.1, 0.2, 0.3)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass = 3.1", "mass = -1.0", "base.mass = -1.0: must be 1e-06 to 1000 kg"),
        ("mass = 3.1", "mass = nan", "base.mass = nan: must be"),
        ("mass = 3.1", 'mass = "3"', "base.mass = '3': must be a number"),
        ("mass = 3.1", "mas = 3.1", 'unknown key "base.mas" = 3.1, did you mean "mass"?'),
        ("mass = 3.1", "", 'missing key "base.mass"'),
        ("rest_posture = [0.0, 0.0]", "name = 'x'", 'unknown key "name"'),
        ("rest_posture = [0.0, 0.0]", "rest_posture = [0.0]", "must be 2 angles"),
        ("rest_posture = [0.0, 0.0]", "rest_posture = [2.0, 0.0]", "rest_posture[0] = 2:"),
        ("rest_posture = [0.0, 0.0]", "rest_posture = [1.0, 1.0]", "must keep the coupled limit"),
        ("[0.3, 0.3, 0.6, 0.0, 0.0, 0.0]", "[0.3, 0.3, 0.7, 0.0, 0.0, 0.0]", "no body has this"),
        ("[0.3, 0.3, 0.6, 0.0, 0.0, 0.0]", "[0.3, 0.3, 0.6, 0.0, 0.6, 0.0]", "positive principal"),
        ("[0.3, 0.3, 0.6, 0.0, 0.0, 0.0]", "[0.3, 0.3, 0.6]", "must be an array of 6 numbers"),
        ('spin = "ccw"', 'spin = "left"', 'rotors[0].spin = "left": must be one of "ccw", "cw"'),
        ("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0, 0.0]", "joints[0].axis = [0.0, 0.0, 0.0]"),
        ('name = "joint2"', 'name = "joint1"', 'joints[1].name = "joint1": is taken'),
        ('name = "joint1"', 'name = "a b\\u001b"', "must be at most 32 letters"),
        ('on = "joint1"', 'on = "joint3"', "critical_points[1].on = 'joint3': must be one of base"),
        ("row = [1.0, 1.0]", "row = [1.0]", "coupled_limits[0].row = [1.0]: must be 2 numbers"),
        ("row = [1.0, 1.0]", "row = [0.0, 0.0]", "not all 0"),
        ("minimum = -1.5707963267948966", "minimum = 2.0", "must be below maximum"),
        ("position_min = -1.0471975511965976", "position_min = 2.0", "must be below position_max"),
        ("empty = 13.6", "empty = 16.8", "battery.empty = 16.8: must be below battery.full"),
        ("[0.2, 0.2, 0.32], [0.2, -0.2, 0.32], ", "", "feet.positions: must be 3 to 64"),
        ("tilt = 0.43", "tilt = 25", "limits.tilt = 25"),
    ],
)
def test_what_cannot_be_is_refused_by_key_value_and_what_is_allowed(
    old: str, new: str, words: str
) -> None:
    assert words in refused((old, new))


def test_rotors_that_cannot_yaw_without_lifting_are_refused() -> None:
    with pytest.raises(VehicleError, match="only 3 of these 4 are independent"):
        parse_vehicle(PAPER.replace('"cw"', '"ccw"'), "mine")


def test_as_many_joints_and_rotors_as_there_is_room_for() -> None:
    joint = PAPER[PAPER.index("[[joints]]") : PAPER.index("[[joints]]", PAPER.index("joint1"))]
    rotor = PAPER[PAPER.index("[[rotors]]") : PAPER.index("[[rotors]]  # left")]
    more = "".join(joint.replace("joint1", f"more{k}") for k in range(5))
    rows = ("row = [1.0, 1.0]", "row = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]")
    rest = ("rest_posture = [0.0, 0.0]", "")
    assert refused(rows, rest, text=PAPER + more) == "joints: must be 1 to 6 of them, are 7"
    assert refused(text=PAPER + 5 * rotor) == "rotors: must be 4 to 8 of them, are 9"


def test_a_file_that_is_none_is_refused_in_a_sentence(tmp_path) -> None:
    with pytest.raises(VehicleError, match='unknown vehicle "papr", did you mean "paper"'):
        load_vehicle("papr")
    with pytest.raises(VehicleError, match="cannot read vehicle"):
        load_vehicle(str(tmp_path / "none.toml"))
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(VehicleError, match="not UTF-8"):
        load_vehicle(str(tmp_path / "bytes.toml"))
    (tmp_path / "long.toml").write_text("# " + "x" * 300_000)
    with pytest.raises(VehicleError, match=re.escape("must be at most 262144 bytes")):
        load_vehicle(str(tmp_path / "long.toml"))
    with pytest.raises(VehicleError, match="nested too deeply"):
        parse_vehicle("a = " + "[" * 5000, "mine")


def test_a_urdf_in_place_of_a_vehicle_is_to_be_imported_first() -> None:
    with pytest.raises(VehicleError, match=r"import my/octo.urdf --rotors FILE --out octo.toml$"):
        load_vehicle("my/octo.urdf")
