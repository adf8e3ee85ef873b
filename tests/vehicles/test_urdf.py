"""URDF in and out, with Pinocchio as the one who reads it as well."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.vehicles.random_vehicles import random_vehicle
from vehicles.rotor_files import read_rotors, rotors_from_parameters
from vehicles.urdf import urdf_text
from vehicles.urdf_reader import vehicle_from_urdf
from vehicles.vehicle_file import PACKAGED, VehicleError, load_vehicle, parse_vehicle, vehicle_text

PAPER = load_vehicle("paper")
# A base with a battery that is fixed to it, a propeller that turns, and an arm with a gripper.
ROBOT = """<?xml version="1.0"?>
<robot name="r">
  <link name="base"><inertial><origin xyz="0.01 0 0.02" rpy="0.1 0.2 0.3"/><mass value="1.5"/>
    <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0.002" iyz="-0.001"/>
  </inertial></link>
  <link name="battery"><inertial><origin xyz="0 0 0.01"/><mass value="0.4"/>
    <inertia ixx="0.001" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="b" type="fixed"><parent link="base"/><child link="battery"/>
    <origin xyz="-0.05 0.01 -0.04" rpy="0 0.3 1.0"/></joint>
  <link name="p1"><inertial><mass value="0.02"/>
    <inertia ixx="1e-5" iyy="1e-5" izz="2e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="j_p1" type="continuous"><parent link="base"/><child link="p1"/>
    <origin xyz="0.2 0.2 0.03"/><axis xyz="0 0 1"/></joint>
  <link name="upper"><inertial><origin xyz="0 0 -0.1"/><mass value="0.2"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.0001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder.yaw" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0.03 0 -0.05" rpy="0.2 0 -0.4"/><axis xyz="0 0 2"/>
    <limit lower="-1.5" upper="2.0" effort="1.5" velocity="6"/>
    <dynamics damping="0.01" friction="0.02"/></joint>
  <link name="lower"><inertial><origin xyz="0.1 0 0"/><mass value="0.1"/>
    <inertia ixx="0.0001" iyy="0.0005" izz="0.0005" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 -0.2" rpy="0 1.57 0"/><axis xyz="0 1 0"/>
    <limit effort="0" velocity="1e4"/></joint>
  <link name="gripper"><inertial><mass value="0.05"/>
    <inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="g" type="fixed"><parent link="lower"/><child link="gripper"/>
    <origin xyz="0.2 0.01 0" rpy="0 0 0.5"/></joint>
</robot>
"""


def mass_matrix(urdf: str, angles: dict[str, float]) -> Any:
    """Pinocchio's, of base and named joints, others locked at zero."""
    model = pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())
    locked = [k for k in range(2, model.njoints) if model.names[k] not in angles]
    q = pin.neutral(model)
    model = pin.buildReducedModel(model, locked, q)
    q = pin.neutral(model)
    for name, angle in angles.items():
        joint = model.joints[model.getJointId(name)]
        turn = (angle,) if joint.nq == 1 else (math.cos(angle), math.sin(angle))
        q[joint.idx_q : joint.idx_q + joint.nq] = turn
    mass = pin.crba(model, model.createData(), q)
    return np.triu(mass) + np.triu(mass, 1).T


def test_a_robot_is_the_same_bodies_when_it_has_been_read_and_written() -> None:
    vehicle, notes = vehicle_from_urdf(ROBOT, "mine", PAPER.rotors)
    assert [joint.name for joint in vehicle.joints] == ["shoulder_yaw", "elbow"]
    assert vehicle.mass == pytest.approx(2.27)
    random, half_turn = np.random.default_rng(1), np.diag([1.0, -1.0, -1.0])
    turn = np.eye(8)
    turn[:3, :3] = turn[3:6, 3:6] = half_turn
    for first, second in random.uniform(-1.5, 1.5, (20, 2)):
        read = mass_matrix(ROBOT, {"shoulder.yaw": first, "elbow": second})
        ours = mass_matrix(urdf_text(vehicle), {"shoulder_yaw": first, "elbow": second})
        np.testing.assert_allclose(ours, turn @ read @ turn, atol=1e-12)
    shoulder, elbow = vehicle.joints
    limits = (shoulder.position_min, shoulder.position_max, shoulder.torque_max, shoulder.rate_max)
    assert limits == (-1.5, 2.0, 1.5, 6.0)
    assert (shoulder.viscous, shoulder.coulomb) == (0.01, 0.02)
    assert (elbow.position_min, elbow.rate_max, elbow.torque_max) == (-math.inf, 5.0, 2.0)
    assert any("velocity = 10000 is no limit: 5 rad/s is assumed" in note for note in notes)
    assert max(z for _, _, z in vehicle.feet.positions) > 0.3


@pytest.mark.parametrize("joints", range(1, 7))
def test_what_is_exported_is_imported_again(joints: int) -> None:
    random = np.random.default_rng(joints)
    for _ in range(5):
        vehicle = random_vehicle(random, joints, 6)
        text = urdf_text(vehicle)
        again, _ = vehicle_from_urdf(text, "made_up", vehicle.rotors, frd=True)
        names = [joint.name for joint in vehicle.joints]
        angles = dict(zip(names, random.uniform(-1.9, 1.9, joints), strict=True))
        np.testing.assert_allclose(
            mass_matrix(urdf_text(again), angles), mass_matrix(text, angles), atol=1e-12
        )
        tip = again.end_effector.position
        np.testing.assert_allclose(tip, vehicle.end_effector.position, atol=1e-12)


def test_a_vehicle_is_the_same_when_its_text_has_been_read() -> None:
    random = np.random.default_rng(5)
    for vehicle in (PAPER, *(random_vehicle(random, k, 4 + k % 5, 0.1) for k in range(1, 7))):
        assert parse_vehicle(vehicle_text(vehicle, "two\nlines"), vehicle.name) == vehicle


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("<robot", "<!DOCTYPE r [<!ENTITY a 'b'>]><robot", "defines entities"),
        ("</robot>", "", "not XML"),
        ('<robot name="r">', '<robot name="r"></robot><robot>', "not XML"),
        ("<robot", "<robot><xacro:include filename='a'/>", "expand it first"),
        ('child link="lower"', 'child link="nowhere"', "there is no link 'nowhere'"),
        ('mass value="1.5"', 'mass value="x"', "value = 'x': must be a number of at most"),
        ('mass value="1.5"', 'mass value="nan"', "value = 'nan': must be a number of at most"),
        ('mass value="1.5"', 'mass value="1e300"', "must be a number of at most 1e+06"),
        ('mass value="1.5"', 'mass value="-1"', 'link "base": mass = -1: must be 0 or more'),
        ('mass value="1.5"', 'mass value="1_0.5"', "value = '1_0.5': must be a number of at most"),
        ('xyz="0 0 -0.2"', 'xyz="0 0 \u0661"', "xyz = '0 0 \u0661': must be 3 numbers"),
        ('xyz="0 0 -0.2"', 'xyz="0 0"', "xyz = '0 0': must be 3 numbers of at most"),
        ('mass value="0.2"', 'mass value="0"', 'link "upper" has no mass'),
        ('axis xyz="0 1 0"', 'axis xyz="0 0 0"', "joints[1].axis"),
        ('child link="upper"', 'child link="base"', "as one tree"),
        ('link name="battery"', 'link name="base"', "there are 2 links 'base': rename"),
        ('joint name="elbow"', 'joint name="g"', "there are 2 joints 'g'"),
        ('ixx="0.001" iyy="0.001" izz="0.0001"', 'ixx="0.001" iyy="0.001" izz="0.1"',
         "no body has this"),
    ],
)  # fmt: skip
def test_what_is_no_robot_with_an_arm_is_refused_in_a_sentence(
    old: str, new: str, words: str
) -> None:
    assert old in ROBOT
    with pytest.raises(VehicleError) as error:
        vehicle_from_urdf(ROBOT.replace(old, new, 1), "mine", PAPER.rotors)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_of_several_arms_one_is_named() -> None:
    second = ROBOT.replace('parent link="upper"', 'parent link="base"')
    with pytest.raises(VehicleError, match=r"3 links are behind 1 joints each.*--tip"):
        vehicle_from_urdf(second, "mine", PAPER.rotors)
    vehicle, _ = vehicle_from_urdf(second, "mine", PAPER.rotors, "gripper")
    assert [joint.name for joint in vehicle.joints] == ["elbow"]
    with pytest.raises(VehicleError, match="there is no link 'griper', did you mean \"gripper\""):
        vehicle_from_urdf(ROBOT, "mine", PAPER.rotors, "griper")
    with pytest.raises(VehicleError, match="no joint moves"):
        vehicle_from_urdf(ROBOT, "mine", PAPER.rotors, "battery")


# What exporters write: a dummy root, a frame without a body at the tip, limits nobody filled in, a
# link without an inertia, meshes that are not here, tags of others, and a gripper's two fingers.
EXPORTED = """<?xml version="1.0"?>
<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <link name="world_frame"/>
  <link name="base"><inertial><mass value="2.0"/>
    <inertia ixx="0.02" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="package://nowhere/meshes/base.dae"/></geometry></visual>
    <collision><geometry><mesh filename="package://nowhere/meshes/base.stl"/></geometry></collision>
  </link>
  <joint name="root" type="fixed"><parent link="world_frame"/><child link="base"/></joint>
  <link name="upper"><inertial><origin xyz="0 0 -0.06"/><mass value="0.15"/>
    <inertia ixx="2e-4" iyy="2e-4" izz="2e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="arm/1" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 -0.05"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0" effort="0" velocity="0"/></joint>
  <link name="lower"><inertial><origin xyz="0 0 -0.05"/><mass value="0.08"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="arm/2" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 -0.12"/><axis xyz="0 1 0"/><limit effort="1.5" velocity="5"/>
    <dynamics damping="0.01" friction="0.05"/></joint>
  <link name="hand"><inertial><mass value="0.0"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="tool" type="fixed"><parent link="lower"/><child link="hand"/>
    <origin xyz="0 0 -0.1"/></joint>
  <link name="left"><inertial><mass value="0.01"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="finger_left" type="prismatic"><parent link="hand"/><child link="left"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.03" effort="5" velocity="1"/></joint>
  <link name="right"><inertial><mass value="0.01"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="finger_right" type="prismatic"><parent link="hand"/><child link="right"/>
    <mimic joint="finger_left" multiplier="-1"/>
    <axis xyz="0 1 0"/><limit lower="-0.03" upper="0" effort="5" velocity="1"/></joint>
  <transmission name="t1"><type>a</type><joint name="arm/1"/></transmission>
  <gazebo reference="base"><mu1>0.2</mu1></gazebo>
</robot>
"""


def test_what_exporters_write_is_read_and_what_was_assumed_is_said() -> None:
    vehicle, notes = vehicle_from_urdf(EXPORTED, "mine", PAPER.rotors)
    assert vehicle.mass == pytest.approx(2.0 + 0.15 + 0.08 + 0.02), "fingers are part of the hand"
    shoulder, elbow = vehicle.joints
    assert (shoulder.name, elbow.name) == ("arm_1", "arm_2")
    assert vehicle.end_effector.position == pytest.approx((0.0, 0.0, 0.1))
    assert (shoulder.position_min, shoulder.position_max) == (-math.inf, math.inf)
    assert any("joint arm/1: 0 to 0 is no limit" in note for note in notes)
    assert any("link lower: no inertia: 20 mm of gyration" in note for note in notes)
    assert (
        "the arm ends before joint finger_left (prismatic), finger_right (prismatic), so these "
        "stay at zero: finger_left, finger_right; the end-effector is the link hand"
    ) in notes
    assert min(elbow.link.inertia[:3]) == pytest.approx(0.1 * 0.02**2), "of hand and fingers"


FINGER = """
  <link name="finger"><inertial><mass value="0.01"/>
    <inertia ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="lower"/><child link="finger"/></joint>
</robot>"""


def test_fingers_leave_the_end_effector_at_the_link_that_is_fixed_beyond_them() -> None:
    vehicle, notes = vehicle_from_urdf(
        ROBOT.replace("</robot>", FINGER), "mine", PAPER.rotors, frd=True
    )
    assert vehicle.end_effector.position == pytest.approx((0.2, 0.01, 0.0))
    assert any("before joint slide (prismatic)" in n and n.endswith("link gripper") for n in notes)
    assert "1 joints beside the arm stay at zero: j_p1" in notes


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('name="elbow" type="continuous"', 'name="elbow" type="planar"', "elbow (planar)"),
        ('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><mimic joint="g"/>', "elbow (mimic)"),
    ],
)
def test_a_joint_that_ends_the_arm_early_is_named(old: str, new: str, why: str) -> None:
    robot = ROBOT.replace(old, new, 1).replace("j_p1", "j_p2").replace("continuous", "fixed", 1)
    vehicle, notes = vehicle_from_urdf(robot, "mine", PAPER.rotors)
    assert [joint.name for joint in vehicle.joints] == ["shoulder_yaw"]
    assert any(f"the arm ends before joint {why}" in note for note in notes)
    assert any(note.endswith("elbow; the end-effector is the link upper") for note in notes)


@pytest.mark.parametrize(
    ("names", "called"),
    [
        (("关节", "夹子"), ["joint_1", "joint_2"]),
        (("1", "2"), ["joint_1", "joint_2"]),
        (("base", "end_effector"), ["base_1", "end_effector_2"]),
        (("a b", "a.b"), ["a_b", "a_b_2"]),
        (("2", "关节"), ["joint_2", "joint_2_2"]),
        (("x" * 40, "x" * 41), ["x" * 32, "x" * 28 + "_2"]),
    ],
)
def test_joints_get_names_that_a_vehicle_may_have(
    names: tuple[str, str], called: list[str]
) -> None:
    robot = ROBOT.replace("shoulder.yaw", names[0]).replace('"elbow"', f'"{names[1]}"')
    vehicle, notes = vehicle_from_urdf(robot, "mine", PAPER.rotors)
    assert [joint.name for joint in vehicle.joints] == called
    assert any(note.endswith(f"{names[1]!r} is {called[1]}") for note in notes)


def test_a_joint_that_cannot_be_at_zero_rests_as_near_to_it_as_allowed() -> None:
    robot = ROBOT.replace('lower="-1.5"', 'lower="0.3"')
    vehicle, notes = vehicle_from_urdf(robot, "mine", PAPER.rotors)
    assert vehicle.rest_posture == vehicle.home_posture == (0.3, 0.0)
    assert "a joint cannot be at zero: rest_posture is [0.3, 0.0] rad, the nearest allowed" in notes


def test_a_root_that_floats_is_refused_with_its_reason() -> None:
    root = '<link name="world"/><joint name="free" type="floating"><parent link="world"/>'
    root += '<child link="base"/></joint></robot>'
    with pytest.raises(VehicleError, match=r'joint "free" is floating: .* the link "world"'):
        vehicle_from_urdf(ROBOT.replace("</robot>", root), "mine", PAPER.rotors)


@pytest.mark.parametrize(
    ("tip", "words"),
    [
        ("left", "joint \"finger_left\" is 'prismatic': joints of an arm must be revolute"),
        ("right", "joint \"finger_right\" is 'prismatic'"),
    ],
)
def test_an_arm_that_is_named_further_than_it_turns_is_refused(tip: str, words: str) -> None:
    with pytest.raises(VehicleError) as error:
        vehicle_from_urdf(EXPORTED, "mine", PAPER.rotors, tip)
    assert words in str(error.value)
    followed = EXPORTED.replace('type="prismatic"', 'type="revolute"')
    with pytest.raises(VehicleError, match="follows another one"):
        vehicle_from_urdf(followed, "mine", PAPER.rotors, "right")


def test_an_end_effector_on_the_last_joint_is_said() -> None:
    vehicle, notes = vehicle_from_urdf(ROBOT, "mine", PAPER.rotors, "lower")
    assert vehicle.end_effector.position == (0.0, 0.0, 0.0)
    assert any(note.startswith("the end-effector lies on the last joint") for note in notes)


PARAMS = "\n".join(
    f"1\t1\tCA_ROTOR{i}_{key}\t{value}\t9"
    for i, (x, y, km) in enumerate(
        ((0.15, 0.15, 0.05), (-0.15, -0.15, 0.05), (0.15, -0.15, -0.05), (-0.15, 0.15, -0.05))
    )
    for key, value in (("PX", x), ("PY", y), ("KM", km))
)


def test_px4s_parameters_are_rotors_with_px4s_defaults() -> None:
    rotors, notes = rotors_from_parameters("# a comment\n1\t1\tCA_ROTOR_COUNT\t4\t6\n" + PARAMS)
    assert [rotor.spin for rotor in rotors] == ["ccw", "ccw", "cw", "cw"]
    assert rotors[2].position == (0.15, -0.15, 0.0)
    assert (rotors[0].thrust_max, rotors[0].axis) == (6.5, (0.0, 0.0, -1.0))
    assert (rotors, notes) == rotors_from_parameters(PARAMS)
    (note,) = notes
    assert "CA_ROTORn_PZ = 0, " in note
    assert "CA_ROTORn_CT = 6.5, lag = 0.04 s, radius = 0.165 m, half_height = 0.02 m" in note
    assert "KM" not in note
    with pytest.raises(VehicleError, match=r"CA_ROTOR_COUNT = 0: must be 4 to 8"):
        rotors_from_parameters("1\t1\tMPC_XY_VEL_MAX\t4\t9")
    with pytest.raises(VehicleError, match=r"line 1 = .*: must be a name of at most 16 .* number"):
        rotors_from_parameters("1\t1\tCA_ROTOR0_PX\tfast\t9")


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("CA_ROTOR_COUNT nan", "must be a name of at most 16 characters and a number"),
        ("CA_ROTOR_COUNT 0_4", "must be a name of at most 16 characters and a number"),
        ("CA_ROTOR_COUNT inf", "and a number from -1e"),
        ("CA_ROTOR_COUNT 4.7", "CA_ROTOR_COUNT = 4.7: must be 4 to 8"),
        (f"CA_ROTOR{'9' * 5000}_PX 1", "must be a name of at most 16 characters"),
        ("CA_ROTOR0_AX 1e200", "and a number from -1e"),
        ("CA_ROTOR0_PX inf", "and a number from -1e"),
        ("CA_ROTOR0_PX 100", r"position.* = .*100.0.*: must be .*-10 to 10"),
    ],
)
def test_parameters_that_no_rotor_has_are_refused(line: str, why: str) -> None:
    with pytest.raises(VehicleError, match=why):
        rotors_from_parameters(f"{PARAMS}\n{line}")


def test_rotors_are_those_of_a_vehicles_file(tmp_path) -> None:
    whole = PACKAGED / "x500-2r.toml"
    assert read_rotors(whole) == (load_vehicle("x500-2r").rotors, [])
    (tmp_path / "some.toml").write_text(whole.read_text().replace("lag = ", "# ", 1))
    (note,) = read_rotors(tmp_path / "some.toml")[1]
    assert note == "rotors: not given for each, so assumed: lag = 0.04 s: put in the real ones"
    with pytest.raises(VehicleError, match="cannot read rotors"):
        read_rotors(tmp_path / "none.params")
    (tmp_path / "empty.toml").write_text("")
    with pytest.raises(VehicleError, match='missing key "rotors"'):
        read_rotors(tmp_path / "empty.toml")
