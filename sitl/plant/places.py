"""Where the points of a vehicle are in the rows that the plant places.

Row 0 is the base's origin, row k joint k, and the one behind the last joint the end-effector. Then
come points of the vehicle that are none of these: critical points, and ends of parts on links.
"""

from __future__ import annotations

import math

from sitl.plant.vector import V3
from vehicles.description import Vehicle

_SAME: float = 1e-9  # m


def own_points(vehicle: Vehicle) -> tuple[tuple[int, V3], ...]:
    """Body, 0 the base, and place in its frame [m] of every point that is no joint."""
    wanted = [(vehicle.places[one.on], one.position) for one in vehicle.critical_points]
    for part in vehicle.parts:
        on = vehicle.places[part.on]
        wanted += [(on, end) for end in (part.position, part.end) if on and end is not None]
    return tuple(dict.fromkeys(one for one in wanted if _frame_row(vehicle, *one) is None))


def row_of(vehicle: Vehicle, body: int, place: V3) -> int:
    """Row of a point of ``own_points``, or of a joint or end-effector at its place [m, link]."""
    row = _frame_row(vehicle, body, place)
    if row is None:
        row = 2 + len(vehicle.joints) + own_points(vehicle).index((body, place))
    return row


def rows_of(vehicle: Vehicle) -> int:
    """How many rows there are; where there is room for three more, they are the base's axes."""
    return 2 + len(vehicle.joints) + len(own_points(vehicle))


def _frame_row(vehicle: Vehicle, body: int, place: V3) -> int | None:
    following = [joint.xyz for joint in vehicle.joints] + [vehicle.end_effector.position]
    if math.hypot(*place) <= _SAME:
        return body
    return body + 1 if math.dist(place, following[body]) <= _SAME else None
