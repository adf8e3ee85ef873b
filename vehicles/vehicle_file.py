"""Reads vehicle files. Invalid ones are rejected with the key, the value and what is allowed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from command_line.bounded_file import read_bounded
from command_line.bounded_toml import TomlError, toml_table
from command_line.toml_tables import TableReader, nearest, shown
from command_line.toml_text import toml_lines
from vehicles.description import JOINTS_MAX, ROTORS_MAX, V3, V6, Rotor, Vehicle

PACKAGED: Final = Path(__file__).parent
_MOST_BYTES: Final = 256 * 1024
_MOST_PARTS: Final = 64  # of points, parts and feet each
_ROTORS_MIN: Final = 4
_ROUNDED: Final = 0.05  # [1] by which an axis may be off a unit vector; it is scaled
_UNIT: Final = 1e-6  # [1] by which its length is off 1 without any rounding
# Share of the largest principal moment by which it may exceed the other two's sum: rounded numbers.
_TRIANGLE: Final = 1e-6
_RANK: Final = 1e-3  # singular value of the rotors' effectiveness beside the largest, per length


class VehicleError(ValueError):
    """A vehicle that cannot be; the message says which key and what is allowed."""


def vehicle_names() -> tuple[str, ...]:
    """Names of the vehicles that come with Pandion."""
    return tuple(sorted(path.stem for path in PACKAGED.glob("*.toml")))


def read_text(name_or_path: str) -> tuple[str, str]:
    """Name and text of a packaged vehicle, or of any by the path of its file.

    Raises:
        VehicleError: Unknown name or unreadable file.
    """
    path = Path(name_or_path)
    if name_or_path in vehicle_names():
        path = PACKAGED / f"{name_or_path}.toml"
    elif path.suffix == ".urdf":
        raise VehicleError(
            f"{name_or_path} is a URDF: make a vehicle's file of it first, with: pandion vehicle "
            f"import {name_or_path} --rotors FILE --out {path.stem}.toml"
        )
    elif path.suffix != ".toml":
        raise VehicleError(
            f'unknown vehicle "{name_or_path}"{nearest(name_or_path, vehicle_names())}; '
            f"known: {', '.join(vehicle_names())}, or the path of a .toml file"
        )
    try:
        return path.stem, read_bounded(path, _MOST_BYTES).decode("utf-8")
    except OSError as error:
        raise VehicleError(f"cannot read vehicle {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise VehicleError(f"vehicle {path} is not TOML: it is not UTF-8") from error


def load_vehicle(name_or_path: str) -> Vehicle:
    """Read a packaged vehicle by name, or any by path.

    Raises:
        VehicleError: Unknown name, unreadable file, unknown key or impossible value.
    """
    name, text = read_text(name_or_path)
    return parse_vehicle(text, name)


@lru_cache(maxsize=64)  # of 3 ms, and every flight asks several times
def parse_vehicle(text: str, name: str) -> Vehicle:
    """The vehicle that a TOML text describes.

    Raises:
        VehicleError: Not TOML, unknown key or impossible value.
    """
    try:
        table = toml_table(text)
        if "name" in table:
            raise VehicleError('unknown key "name": a vehicle is named by its file')
        vehicle: Vehicle = _READER.build(Vehicle, {**table, "name": name}, "")
    except TomlError as error:
        raise VehicleError(f"vehicle {name} is {error}") from error
    except RecursionError:
        raise VehicleError(f"vehicle {name} is nested too deeply") from None
    return checked(vehicle)


def vehicle_text(vehicle: Vehicle, comment: str = "") -> str:
    """The TOML text of a vehicle, after a comment of one or several lines.

    The name is left out: a vehicle is named by its file.
    """
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    return head + "\n".join(toml_lines("", vehicle, ("name",))) + "\n"


def checked(vehicle: Vehicle) -> Vehicle:
    """The vehicle with unit axes and a rest posture, if it is one that can be.

    Raises:
        VehicleError: It cannot be: the first reason.
    """
    for key, count, least, most in _counts(vehicle):
        if not least <= count <= most:
            raise VehicleError(f"{key}: must be {least} to {most} of them, are {count}")
    vehicle = replace(
        vehicle,
        rotors=tuple(
            replace(rotor, axis=_unit(rotor.axis, f"rotors[{i}].axis"))
            for i, rotor in enumerate(vehicle.rotors)
        ),
        joints=tuple(
            replace(joint, axis=_unit(joint.axis, f"joints[{i}].axis"))
            for i, joint in enumerate(vehicle.joints)
        ),
        rest_posture=vehicle.rest_posture or (0.0,) * len(vehicle.joints),
        home_posture=vehicle.home_posture or vehicle.rest_posture or (0.0,) * len(vehicle.joints),
    )
    _check_names(vehicle)
    _check_inertia(vehicle.base.inertia, "base.inertia")
    for i, joint in enumerate(vehicle.joints):
        _check_inertia(joint.link.inertia, f"joints[{i}].link.inertia")
    _check_limits(vehicle)
    _check_rotors(vehicle.rotors)
    if vehicle.battery.empty >= vehicle.battery.full:
        raise VehicleError(
            f"battery.empty = {vehicle.battery.empty:g}: must be below battery.full, which is "
            f"{vehicle.battery.full:g}"
        )
    return vehicle


def _counts(vehicle: Vehicle) -> Iterator[tuple[str, int, int, int]]:
    yield "rotors", len(vehicle.rotors), _ROTORS_MIN, ROTORS_MAX
    yield "joints", len(vehicle.joints), 1, JOINTS_MAX
    yield "feet.positions", len(vehicle.feet.positions), 3, _MOST_PARTS
    yield "critical_points", len(vehicle.critical_points), 1, _MOST_PARTS
    yield "parts", len(vehicle.parts), 0, _MOST_PARTS
    yield "coupled_limits", len(vehicle.coupled_limits), 0, JOINTS_MAX


def _unit(axis: V3, path: str) -> V3:
    length = math.hypot(*axis)
    if not abs(length - 1.0) <= _ROUNDED:
        raise VehicleError(
            f"{path} = {shown(list(axis))}: must be a unit vector, its length is {length:.4g}"
        )
    if abs(length - 1.0) <= _UNIT:
        return axis
    return axis[0] / length, axis[1] / length, axis[2] / length


def _check_names(vehicle: Vehicle) -> None:
    for key in ("joints", "coupled_limits", "critical_points", "parts"):
        seen: set[str] = {"base"} if key == "joints" else set()
        for i, one in enumerate(getattr(vehicle, key)):
            if not one.name.isidentifier() or not one.name.isascii() or len(one.name) > 32:
                raise VehicleError(
                    f"{key}[{i}].name = {shown(one.name)}: must be at most 32 letters, digits "
                    'and "_", not beginning with a digit'
                )
            if one.name in seen:
                raise VehicleError(f'{key}[{i}].name = "{one.name}": is taken; give another name')
            seen.add(one.name)
    for key in ("critical_points", "parts"):
        for i, one in enumerate(getattr(vehicle, key)):
            if one.on not in vehicle.places:
                raise VehicleError(
                    f"{key}[{i}].on = {shown(one.on)}: must be one of "
                    f"{', '.join(vehicle.places)}{nearest(one.on, vehicle.places)}"
                )


def inertia_matrix(inertia: V6) -> NDArray[np.float64]:
    """The symmetric matrix (3, 3) [kg m^2] of its six entries [kg m^2]."""
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _check_inertia(inertia: V6, path: str) -> None:
    low, middle, high = np.linalg.eigvalsh(inertia_matrix(inertia))
    if not low > 0.0:
        raise VehicleError(
            f"{path} = {shown(list(inertia))}: must have positive principal moments, the smallest "
            f"is {low:.4g} kg m^2"
        )
    if not high <= (low + middle) * (1.0 + _TRIANGLE):
        raise VehicleError(
            f"{path} = {shown(list(inertia))}: no body has this: the largest principal moment, "
            f"{high:.4g} kg m^2, must be at most the sum of the others, {low + middle:.4g}"
        )


def _check_limits(vehicle: Vehicle) -> None:
    count = len(vehicle.joints)
    for i, joint in enumerate(vehicle.joints):
        low, high = joint.position_min, joint.position_max
        if not low < high:
            raise VehicleError(
                f"joints[{i}].position_min = {low:g}: must be below position_max, which is {high:g}"
            )
    for i, limit in enumerate(vehicle.coupled_limits):
        if len(limit.row) != count or not any(limit.row):
            raise VehicleError(
                f"coupled_limits[{i}].row = {shown(list(limit.row))}: must be {count} numbers, "
                "one for each joint, not all 0"
            )
        if not limit.minimum < limit.maximum:
            raise VehicleError(
                f"coupled_limits[{i}].minimum = {limit.minimum:g}: must be below maximum, which is "
                f"{limit.maximum:g}"
            )
    for key in ("rest_posture", "home_posture"):
        problem = posture_problem(vehicle, getattr(vehicle, key))
        if problem is not None:
            raise VehicleError(f"{key}{problem}")


def posture_problem(vehicle: Vehicle, angles: tuple[float, ...], unit: float = 1.0) -> str | None:
    """Why the joints cannot be at ``angles`` (j,) [rad], to be put behind a key; None if they can.

    Angles are written in a ``unit`` [rad].
    """
    listed = [round(angle / unit, 6) for angle in angles]
    word = "rad" if unit == 1.0 else "deg"
    if len(angles) != len(vehicle.joints):
        return f" = {shown(listed)}: must be {len(vehicle.joints)} angles, one for each joint"
    for i, (angle, joint) in enumerate(zip(angles, vehicle.joints, strict=True)):
        low, high = joint.position_min, joint.position_max
        if not low <= angle <= high:
            return (
                f"[{i}] = {listed[i]:g}: must be {low / unit:g} to {high / unit:g} {word}, the "
                f'limits of joint "{joint.name}"'
            )
    for limit in vehicle.coupled_limits:
        value = sum(factor * q for factor, q in zip(limit.row, angles, strict=True))
        if not limit.minimum <= value <= limit.maximum:
            return (
                f' = {shown(listed)}: must keep the coupled limit "{limit.name}": its row makes '
                f"{value / unit:.4g}, allowed is {limit.minimum / unit:g} to "
                f"{limit.maximum / unit:g} {word}"
            )
    return None


def _check_rotors(rotors: Sequence[Rotor]) -> None:
    """Refuse rotors that cannot turn the vehicle about each axis and lift it as well."""
    columns = []
    for rotor in rotors:
        axis = np.array(rotor.axis)
        turn = rotor.torque_per_thrust * (-axis if rotor.spin == "ccw" else axis)
        columns.append([*(np.cross(rotor.position, axis) + turn), axis[2]])
    effect = np.array(columns).T
    # Torques beside their own size: that of yaw is a twentieth of that of roll on a sound vehicle.
    size = np.linalg.norm(effect, axis=1, keepdims=True)
    rank = np.linalg.matrix_rank(effect / np.where(size > 0.0, size, 1.0), tol=_RANK)
    if rank < _ROTORS_MIN:
        raise VehicleError(
            f"rotors: must be able to make torque about each axis and thrust independently, but "
            f"only {rank} of these 4 are independent; check positions, axes and spin"
        )


_READER: Final = TableReader(VehicleError)
