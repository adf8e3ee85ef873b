"""``pandion vehicle``: the files that vehicles are described in."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from command_line.actions import read_action
from command_line.options import option, switch
from command_line.output import json_text, print_error, say
from command_line.parser import COULD_NOT_START

if TYPE_CHECKING:
    from pandion.vehicle_figures import Figures
    from vehicles.description import Vehicle

DONE, REFUSED = 0, 1  # exit codes


def _named() -> Any:
    return option("VEHICLE", "name of one that comes with Pandion, or a .toml file", required=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class _List:
    pass


@dataclass(frozen=True, slots=True, kw_only=True)
class _Show:
    vehicle: str = _named()
    json: bool = switch("--json", "figures as JSON, without the drawing")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Check:
    vehicle: str = _named()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Import:
    urdf: Path = option("ROBOT.urdf", "URDF of base and arm", Path, required=True)
    rotors: Path = option(
        "--rotors FILE",
        "its rotors: .toml with [[rotors]], or PX4's parameters CA_ROTORn_*",
        Path,
        required=True,
    )
    out: Path | None = option("--out FILE", "where to, .toml (default: standard output)", Path)
    tip: str = option(
        "--tip LINK", "link at the end of the arm (default: behind most joints)", default=""
    )
    frd: bool = switch("--frd", "the URDF counts y to the right and z down, not left and up")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Export:
    vehicle: str = _named()
    urdf: Path = option("--urdf FILE", "write base and arm as URDF, in FRD", Path, required=True)


def main(argv: list[str]) -> int:
    """Do one thing with vehicles; returns the exit code."""
    found = read_action("pandion vehicle", _USAGE, _PURPOSE, ACTIONS, argv)
    if isinstance(found, int):
        return found
    options, act = found
    from vehicles.vehicle_file import VehicleError

    try:
        return act(options)
    except VehicleError as error:
        print_error("pandion vehicle", error)
        return REFUSED
    except OSError as error:
        print_error("pandion vehicle", f"cannot write {error.filename}: {error.strerror}")
        return COULD_NOT_START


def _list(_: _List) -> int:
    from vehicles.vehicle_file import load_vehicle, vehicle_names

    for name in vehicle_names():
        one = load_vehicle(name)
        say(f"{name:10} {one.mass:6.2f} kg, {len(one.rotors)} rotors, {len(one.joints)} joints")
    return DONE


def _show(options: _Show) -> int:
    from pandion.vehicle_figures import figures, start_up, warnings
    from vehicles.vehicle_file import load_vehicle

    vehicle = load_vehicle(options.vehicle)
    found = figures(vehicle)
    if options.json:
        told = warnings(vehicle, found)
        print(
            json_text(
                asdict(found)
                | {"name": vehicle.name, "warnings": told, "start_up": start_up(vehicle)},
                2,
            )
        )
        return DONE
    from pandion.vehicle_drawing import drawing

    for title, text in _rows(vehicle, found):
        say(f"{title:17} {text}")
    say(f"{'at start':17} {start_up(vehicle)}")
    for warning in warnings(vehicle, found):
        say(f"{'warning':17} {warning}")
    print(drawing(vehicle))
    return DONE


def _rows(vehicle: Vehicle, found: Figures) -> list[tuple[str, str]]:
    authority = ", ".join(f"{name} {most:.1f}" for name, most in found.authority.items())
    rows = [
        ("vehicle", vehicle.name),
        ("mass", f"{found.mass:.3f} kg, {found.arm_mass:.3f} kg of it the arm"),
        ("rotors", f"{len(vehicle.rotors)}, {vehicle.rotors[0].thrust_max:.2f} N the first"),
        ("hover throttle", f"{100.0 * found.hover_throttle:.0f} % of full thrust"),
        ("thrust to weight", f"{found.thrust_to_weight:.2f}"),
        ("in hover", f"{authority} rad/s^2 at most"),
        ("reach", f"{found.reach:.3f} m from the body's origin at most"),
    ]
    for joint, load, most in zip(vehicle.joints, found.joint_load, found.joint_torque, strict=True):
        limits = "no limits of its own"
        if math.isfinite(joint.position_min) or math.isfinite(joint.position_max):
            low, high = math.degrees(joint.position_min), math.degrees(joint.position_max)
            limits = f"{low:.0f} to {high:.0f} deg"
        rows.append((f"joint {joint.name}", f"{limits}; holds {load:.2f} of {most:.2f} N m"))
    return rows


def _check(options: _Check) -> int:
    from pandion.vehicle_figures import figures, warnings
    from pandion.vehicle_trial import refusals
    from vehicles.vehicle_file import load_vehicle

    vehicle = load_vehicle(options.vehicle)
    found = figures(vehicle)
    told = warnings(vehicle, found)
    if found.hover_throttle <= 1.0:
        told += refusals(options.vehicle)
    for warning in told:
        print_error("pandion vehicle", f"{vehicle.name}: {warning}")
    if found.hover_throttle > 1.0:
        return REFUSED
    notes = {0: "no warning", 1: "1 warning"}.get(len(told), f"{len(told)} warnings")
    say(
        f"{vehicle.name}: {found.mass:.2f} kg, {len(vehicle.rotors)} rotors, "
        f"{len(vehicle.joints)} joints, hovers at {100.0 * found.hover_throttle:.0f} %; {notes}"
    )
    return DONE


def _import(options: _Import) -> int:
    from command_line.bounded_file import read_bounded
    from sitl.plant.stiffness import soften
    from vehicles.rotor_files import read_rotors
    from vehicles.urdf_reader import MAX_BYTES, vehicle_from_urdf
    from vehicles.vehicle_file import VehicleError, parse_vehicle, vehicle_text

    rotors, assumed = read_rotors(options.rotors)
    try:
        robot = read_bounded(options.urdf, MAX_BYTES).decode("utf-8-sig")
    except OSError as error:
        raise VehicleError(f"cannot read {options.urdf}: {error.strerror}") from error
    except UnicodeDecodeError:
        raise VehicleError(f"{options.urdf} is not UTF-8") from None
    name = options.out.stem if options.out is not None else options.urdf.stem
    read, notes = vehicle_from_urdf(robot, name, rotors, options.tip, frd=options.frd)
    vehicle, softer = soften(read)
    notes = [*assumed, *notes, *softer]
    comment = f"From {options.urdf.name} and {options.rotors.name}, by pandion vehicle import."
    text = vehicle_text(vehicle, comment)
    parse_vehicle(text, name)  # every number within its range
    for note in notes:
        print_error("pandion vehicle", note)
    if options.out is None:
        print(text, end="")
        return DONE
    options.out.write_text(text, encoding="utf-8")
    say(f"{options.out}: {vehicle.mass:.3f} kg, {len(vehicle.joints)} joints; "
        f"pandion vehicle show {options.out} draws it")  # fmt: skip
    return DONE


def _export(options: _Export) -> int:
    from vehicles.urdf import urdf_text
    from vehicles.vehicle_file import load_vehicle

    vehicle = load_vehicle(options.vehicle)
    options.urdf.write_text(urdf_text(vehicle), encoding="utf-8")
    say(f"{options.urdf}: base and {len(vehicle.joints)} joints of {vehicle.name}, in FRD; "
        "rotors, coupled limits and armatures are left out")  # fmt: skip
    return DONE


_USAGE: Final = "[options]"
_PURPOSE: Final = "Vehicles: those that come with Pandion, and files of your own."
ACTIONS: Final[dict[str, tuple[type[Any], Callable[[Any], int], str]]] = {
    "list": (_List, _list, "List the vehicles that come with Pandion."),
    "show": (_Show, _show, "Show what a vehicle can do, and draw it."),
    "check": (_Check, _check, "Say in a sentence each what is wrong with a vehicle's file."),
    "import": (_Import, _import, "Make a vehicle's file of a URDF and a file of rotors."),
    "export": (_Export, _export, "Write a vehicle's base and arm as URDF."),
}
