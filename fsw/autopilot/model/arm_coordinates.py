r"""Coordinates of the arm in which the limits of its angles do not depend on each other.

Limits hold for joints and for sums of joints. With one coordinate a joint,

.. math:: c_k = \sum_{i \le k} L_{ki} q_i,

the coupled limit that ends at joint k where there is one and the joint's own angle elsewhere, most
arms have nothing but bounds on c. Limits that are left over, the ``others``, are few.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fsw.autopilot.geometry.vectors import clamp
from fsw.autopilot.model.airframe import Airframe, AngleLimit
from fsw.autopilot.model.multibody import Several
from fsw.autopilot.signals import JointVector, Vec2
from fsw.compiled import compilable
from fsw.record import ANGLE_LIMITS, JOINTS, Floats, padded, padded_rows


@dataclass(frozen=True, slots=True)
class ArmCoordinates:
    """The coordinates of an arm, with room for ``JOINTS`` joints."""

    joints: int
    row: Several  # (JOINTS,) [1] a coordinate: L
    column: Several  # (JOINTS,) [1] a coordinate: how the joints turn with it alone, of L's inverse
    low: Several  # (JOINTS,) rad, minus infinity where there is no limit
    high: Several  # (JOINTS,) rad
    others: int  # limits beside those
    other_row: Several  # (JOINTS,) [1] each
    other_low: Several  # (ANGLE_LIMITS,) rad
    other_high: Several  # (ANGLE_LIMITS,) rad


@lru_cache(maxsize=8)
def arm_coordinates(airframe: Airframe) -> ArmCoordinates:
    """The coordinates of a vehicle's arm."""
    n, limits = airframe.bodies.joints, airframe.angle_limits
    own = [tuple([float(i == k) for i in range(n)]) for k in range(n)]
    chosen = [AngleLimit(row, -math.inf, math.inf) for row in own]
    for limit in limits:
        # Of those that end at the same joint the last: a joint's own limits come first.
        chosen[max(k for k in range(n) if limit.row[k] != 0.0)] = limit
    left = [limit for limit in limits if not any(limit is one for one in chosen)]
    inverse = np.linalg.inv(np.array([one.row for one in chosen]))
    return ArmCoordinates(
        joints=n,
        row=_matrix([one.row for one in chosen], JOINTS),
        column=_matrix(inverse.T.tolist(), JOINTS),
        low=padded(tuple([one.low for one in chosen]), JOINTS),
        high=padded(tuple([one.high for one in chosen]), JOINTS),
        others=len(left),
        other_row=_matrix([one.row for one in left], ANGLE_LIMITS),
        other_low=padded(tuple([one.low for one in left]), ANGLE_LIMITS),
        other_high=padded(tuple([one.high for one in left]), ANGLE_LIMITS),
    )


def _matrix(rows: Iterable[Iterable[float]], room: int) -> Several:
    """Rows (j,) of numbers as (JOINTS,) each, with ``room`` for so many."""
    return padded_rows([padded(tuple(row), JOINTS) for row in rows], room * JOINTS)


@compilable
def to_coordinates(arm: ArmCoordinates, q: Several | Floats, out: Floats) -> None:
    """What joints at ``q`` (j,) [rad] are in coordinates, into ``out`` (j,) [rad]; of rates too."""
    for k in range(int(arm.joints)):
        total = 0.0
        for i in range(k + 1):
            total += arm.row[JOINTS * k + i] * q[i]
        out[k] = total


@compilable
def to_joints(arm: ArmCoordinates, c: Several | Floats, out: Floats) -> None:
    """The joints (j,) [rad] of coordinates ``c`` (j,) [rad] into ``out``; of rates too."""
    for k in range(int(arm.joints)):
        rest = c[k]
        for i in range(k):
            rest -= arm.row[JOINTS * k + i] * out[i]
        out[k] = rest / arm.row[JOINTS * k + k]


@compilable
def along_other(arm: ArmCoordinates, other: int, q: Several | Floats) -> float:
    """The sum of joints (j,) [rad] that one of the ``others`` limits; of rates too."""
    total = 0.0
    for i in range(int(arm.joints)):
        total += arm.other_row[JOINTS * other + i] * q[i]
    return total


@compilable
def bounds_of(arm: ArmCoordinates, k: int, margin: float) -> Vec2:
    """Lowest and highest value [rad] of coordinate ``k``, a ``margin`` [rad] within its limits."""
    return arm.low[k] + margin, arm.high[k] - margin


def within_limits(arm: ArmCoordinates, q: JointVector, margin: float) -> JointVector:
    """The angles (j,) [rad] next to ``q`` [rad] that are a ``margin`` [rad] within limits."""
    c, found = np.zeros(arm.joints), np.zeros(arm.joints)
    to_coordinates(arm, q, c)
    for k in range(arm.joints):
        c[k] = clamp(float(c[k]), *bounds_of(arm, k, margin))
    to_joints(arm, c, found)
    return tuple(found.tolist())


def first_beyond(limits: tuple[AngleLimit, ...], q: JointVector, room: float) -> str | None:
    """The first joint, or sum of joints, that is more than ``room`` [rad] beyond its limits.

    As a sentence, of joints at ``q`` (j,) [rad].
    """
    for one in limits:
        angle = sum(a * b for a, b in zip(one.row, q, strict=True) if a)
        if not one.low - room <= angle <= one.high + room:
            are = "are beyond their" if " and " in one.name else "is beyond its"
            return f"{one.name} at {math.degrees(angle):.0f} deg {are} limit"
    return None
