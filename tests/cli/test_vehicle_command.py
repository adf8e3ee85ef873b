"""``pandion vehicle`` as somebody types it."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from pandion.vehicle import main
from pandion.vehicle_figures import figures, warnings
from tests.vehicles.test_urdf import EXPORTED, PARAMS, ROBOT
from vehicles.description import EndEffector
from vehicles.vehicle_file import load_vehicle, vehicle_names, vehicle_text

PAPER = load_vehicle("paper")


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = main(list(words))
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return code, out, err


def test_paper_is_listed_shown_and_drawn(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "list")
    assert (code, err) == (0, "")
    assert "paper        3.50 kg, 4 rotors, 2 joints" in out.splitlines()
    code, out, _ = run(capsys, "show", "paper")
    assert code == 0
    assert "hover throttle    50 % of full thrust" in out
    assert "thrust to weight  2.00" in out
    assert "at start          the base stays within 71 mm of its plan under 0.8 m/s^2" in out
    # Rotor 3 is ahead, 1 behind, 2 to the left, and the arm hangs down.
    rows = [line.strip() for line in out[out.index("from above") :].splitlines()]
    assert rows[1] == "3"
    assert "2" in next(row for row in rows if "*" in row).split()[0]
    assert "." in out[out.index("from the right") :]


@pytest.mark.parametrize(
    ("words", "missing"),
    [(("import", "robot.urdf"), "--rotors"), (("export", "paper"), "--urdf")],
)
def test_a_file_that_is_needed_must_be_given(
    words: tuple[str, str], missing: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(list(words))
    assert stop.value.code == 2
    assert capsys.readouterr().err == f"pandion vehicle {words[0]}: {missing} must be given\n"


def test_the_figures_of_paper_are_those_of_a_plus_quadrotor() -> None:
    found = figures(PAPER)
    assert found.hover_throttle == pytest.approx(0.5)
    assert found.thrust_to_weight == pytest.approx(2.0)
    hover = 3.5 * 9.81 / 4.0
    assert found.authority["pitch"] == pytest.approx(2.0 * 0.3 * hover / 0.3, rel=1e-6)
    assert found.authority["yaw"] == pytest.approx(4.0 * 0.016 * hover / 0.60002, rel=1e-4)
    # Straight out at its limit of 60 degrees, and the second link at 90.
    most = 0.2 * 9.81 * (0.075 * 0.866 + 0.15 * 0.866 + 0.075)
    assert 0.85 * most < found.joint_load[0] <= most
    assert found.joint_load[1] == pytest.approx(0.2 * 9.81 * 0.075, rel=0.02)
    assert not warnings(PAPER, found)


def test_friction_that_hides_a_drive_that_fails_is_said() -> None:
    rough = tuple(replace(joint, coulomb=0.1, viscous=0.1) for joint in PAPER.joints)
    small = replace(rough[1], torque_max=0.3)
    vehicle = replace(PAPER, joints=(rough[0], small))
    told = [line for line in warnings(vehicle, figures(vehicle)) if "is not found" in line]
    assert len(told) == 2
    assert "friction takes up to 0.6 N m, and torque_max is 0.3 N m" in told[1]


def test_as_json_the_figures_are_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "show", "paper", "--json")
    table = json.loads(out)
    assert (code, table["name"], table["warnings"]) == (0, "paper", [])
    assert table["authority"].keys() == {"roll", "pitch", "yaw"}


def test_what_the_analysis_of_any_arm_finds_is_shown(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "mine.toml"
    across = replace(PAPER.joints[0], axis=(1.0, 0.0, 0.0))
    path.write_text(vehicle_text(replace(PAPER, joints=(across, PAPER.joints[1]))))
    code, out, _ = run(capsys, "show", str(path))
    assert code == 0
    assert "at start          the base stays within " in out


@pytest.mark.parametrize(
    ("share", "code", "words"),
    [
        (0.55, 0, "hovers at 91 % of a rotor's thrust: above 80 %"),
        (0.45, 1, "it cannot hover"),
    ],
)
def test_too_little_thrust_is_said(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, share: float, code: int, words: str
) -> None:
    rotors = tuple(replace(rotor, thrust_max=share * rotor.thrust_max) for rotor in PAPER.rotors)
    path = tmp_path / "weak.toml"
    path.write_text(vehicle_text(replace(PAPER, rotors=rotors)))
    got, _, err = run(capsys, "check", str(path))
    assert got == code
    assert words in err


def test_what_the_simulator_or_the_flight_software_refuse_is_said(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    stiff = replace(PAPER, end_stops=replace(PAPER.end_stops, stiffness=1e5))
    path = tmp_path / "stiff.toml"
    path.write_text(vehicle_text(stiff), encoding="utf-8")
    code, out, err = run(capsys, "check", str(path))
    assert code == 0
    said = " ".join(err.split())
    assert "no flight of it begins: vehicle stiff: end_stops would move it at" in said
    assert "1 warning" in out
    # With its end-effector aside, the sphere of `workspace` is not where it begins.
    aside = replace(PAPER, end_effector=EndEffector(position=(0.2, 0.0, 0.15)))
    path.write_text(vehicle_text(aside), encoding="utf-8")
    _, _, err = run(capsys, "check", str(path))
    said = " ".join(err.split())
    assert "it does not fly workspace: the scenario starts outside its safe set" in said
    assert "or begin in another posture (start.arm_deg, or home_posture of the vehicle)" in said


def test_feet_above_the_body_and_rotors_within_walls_are_said(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    x500 = load_vehicle("x500-2r")
    above = tuple((x, y, -0.3) for x, y, _ in x500.feet.positions)
    rotors = tuple(replace(rotor, radius=2.0) for rotor in x500.rotors)
    path = tmp_path / "mine.toml"
    path.write_text(
        vehicle_text(replace(x500, rotors=rotors, feet=replace(x500.feet, positions=above)))
    )
    code, _, err = run(capsys, "check", str(path))
    said = " ".join(err.split())
    assert code == 0
    assert "it does not fly ground: the base hit the ground at 0.00 s: see where feet" in said
    assert "it does not fly gate: the scenario starts outside its safe set" in said


def test_weak_joints_and_tilted_rotors_are_said(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    weak = replace(PAPER.joints[0], torque_max=0.3)
    side = replace(PAPER.rotors[1], axis=(0.0, math.sin(0.2), -math.cos(0.2)))
    vehicle = replace(
        PAPER,
        joints=(weak, PAPER.joints[1]),
        rotors=(PAPER.rotors[0], side, *PAPER.rotors[2:]),
    )
    path = tmp_path / "mine.toml"
    path.write_text(vehicle_text(vehicle))
    code, out, err = run(capsys, "check", str(path))
    assert code == 0
    assert "joint joint1 cannot hold its own arm" in err
    assert "torque_max is 0.3 N m" in err
    assert "lateral thrust of tilted rotors is not used: 2" in err
    assert "it does not fly walls, gate, workspace, branches: home_posture = [" in " ".join(
        err.split()
    )
    assert "3 warnings" in out


def test_what_cannot_be_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(vehicle_text(PAPER).replace("mass = 3.1", "mass = 0"))
    code, out, err = run(capsys, "check", str(path))
    assert (code, out) == (1, "")
    assert err == "pandion vehicle: base.mass = 0: must be 1e-06 to 1000 kg\n"
    code, _, err = run(capsys, "show", "papr")
    assert (code, 'did you mean "paper"' in err) == (1, True)


def test_a_urdf_and_px4s_rotors_become_a_file_and_a_urdf_again(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    robot, rotors, out = tmp_path / "r.urdf", tmp_path / "r.params", tmp_path / "mine.toml"
    robot.write_text(ROBOT)
    rotors.write_text(PARAMS)
    words = ("import", str(robot), "--rotors", str(rotors))
    code, printed, _ = run(capsys, *words)
    assert code == 0
    assert run(capsys, *words, "--out", str(out))[0] == 0
    assert out.read_text() == printed
    assert load_vehicle(str(out)).mass == pytest.approx(2.27)
    assert run(capsys, "export", str(out), "--urdf", str(tmp_path / "again.urdf"))[0] == 0
    assert "<robot" in (tmp_path / "again.urdf").read_text()
    code, _, err = run(capsys, "export", "paper", "--urdf", str(tmp_path / "no" / "where.urdf"))
    assert (code, "cannot write" in err) == (2, True)


def test_what_is_imported_flies_as_it_is(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """It was refused: a URDF knows no armature, and stops and feet were too stiff for its links."""
    (tmp_path / "robot.urdf").write_text(EXPORTED, encoding="utf-8")
    (tmp_path / "rotors.toml").write_text(vehicle_text(PAPER), encoding="utf-8")
    read, out = str(tmp_path / "robot.urdf"), str(tmp_path / "mine.toml")
    code, _, err = run(
        capsys, "import", read, "--rotors", str(tmp_path / "rotors.toml"), "--out", out
    )
    assert code == 0
    assert "armature of" in err
    code, _, err = run(capsys, "check", out)
    assert code == 0
    assert "begins" not in err


def test_numbers_of_a_urdf_are_kept_in_their_ranges(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    robot, rotors = tmp_path / "r.urdf", tmp_path / "r.params"
    robot.write_text(ROBOT.replace('xyz="0 0 -0.2"', 'xyz="0 0 -200"'))
    rotors.write_text(PARAMS)
    code, out, err = run(capsys, "import", str(robot), "--rotors", str(rotors))
    assert (code, out) == (1, "")
    assert "must be -10 to 10 m" in err


@pytest.mark.drawn(2)
@pytest.mark.parametrize("name", vehicle_names())
def test_every_vehicle_that_comes_with_pandion_is_sound(
    capsys: pytest.CaptureFixture[str], name: str, tmp_path: Path
) -> None:
    code, out, err = run(capsys, "check", name)
    assert code == 0
    if name == "probe-2r":  # its tool is ahead of the base, not below it
        assert "it does not fly workspace: " in err
        assert err.count("\n") == 1
    else:
        assert err == ""
        assert "no warning" in out
    assert run(capsys, "show", name)[0] == 0
    assert run(capsys, "export", name, "--urdf", str(tmp_path / "robot.urdf"))[0] == 0
