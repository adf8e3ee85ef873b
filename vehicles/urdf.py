"""A vehicle as URDF, for programs that know robots: base, arm and end-effector."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final
from xml.sax.saxutils import quoteattr

from vehicles.description import V3, V6, Joint, Vehicle

_BASE: Final = "base"


def urdf_text(vehicle: Vehicle) -> str:
    """The URDF of a vehicle, in its body frame (FRD).

    URDF has no rotors, no limits of sums of joints, and no armature: these are left out.
    """
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(vehicle.name)}>"]
    base = vehicle.base
    lines += _link(_BASE, base.mass, base.com, base.inertia)
    parent = _BASE
    for joint in vehicle.joints:
        child = f"{joint.name}_link"
        lines += _link(child, joint.link.mass, joint.link.com, joint.link.inertia)
        lines += _joint(joint, parent, child)
        parent = child
    lines += [
        '  <link name="end_effector"/>',
        '  <joint name="end_effector_joint" type="fixed">',
        f'    <parent link="{parent}"/>',
        '    <child link="end_effector"/>',
        f'    <origin xyz="{_row(vehicle.end_effector.position)}" rpy="0.0 0.0 0.0"/>',
        "  </joint>",
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


def _link(name: str, mass: float, com: V3, inertia: V6) -> list[str]:
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    entries = " ".join(f'{key}="{value!r}"' for key, value in zip(keys, inertia, strict=True))
    return [
        f'  <link name="{name}">',
        "    <inertial>",
        f'      <origin xyz="{_row(com)}" rpy="0.0 0.0 0.0"/>',
        f'      <mass value="{mass!r}"/>',
        f"      <inertia {entries}/>",
        "    </inertial>",
        "  </link>",
    ]


def _joint(joint: Joint, parent: str, child: str) -> list[str]:
    limited = math.isfinite(joint.position_min) and math.isfinite(joint.position_max)
    limits = f'effort="{joint.torque_max!r}" velocity="{joint.rate_max!r}"'
    if limited:
        limits = f'lower="{joint.position_min!r}" upper="{joint.position_max!r}" {limits}'
    return [
        f'  <joint name="{joint.name}" type="{"revolute" if limited else "continuous"}">',
        f'    <parent link="{parent}"/>',
        f'    <child link="{child}"/>',
        f'    <origin xyz="{_row(joint.xyz)}" rpy="{_row(joint.rpy)}"/>',
        f'    <axis xyz="{_row(joint.axis)}"/>',
        f"    <limit {limits}/>",
        f'    <dynamics damping="{joint.viscous!r}" friction="{joint.coulomb!r}"/>',
        "  </joint>",
    ]


def _row(numbers: Sequence[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)
