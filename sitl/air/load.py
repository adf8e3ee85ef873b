"""What the air adds to the plant's forces: drag of rotors and body, and surfaces nearby."""

from __future__ import annotations

from typing import NamedTuple

from sitl.air.body_drag import body_drag
from sitl.air.ceiling_effect import ceiling_effect
from sitl.air.ground_effect import ground_effect
from sitl.air.rotor_drag import rotor_drag
from sitl.air.wall_effect import wall_pull
from sitl.compiled import kernel
from sitl.plant.vector import V3, V4, Array, add, scale, sub, times, transposed_times

SURFACES = 8  # room for planes
_LEVEL = 0.7  # a plane whose normal is this steep is a floor or a ceiling
_UPRIGHT = 0.5  # and one below this a wall


class Air(NamedTuple):
    """Numbers of the air for the kernels (see ``parameters.AirModel``)."""

    active: float  # 0: there is no air but that which carries the rotors
    wind: Array  # (3,) m/s, NED, of the air; written before every exchange
    drag: Array  # (3,) N·s/m, of the rotors, along the body's axes
    area: float  # m², drag area of the body
    density: float  # kg/m³
    radius: float  # m, of a rotor
    arm: float  # m, from the base's origin to a hub
    ground: float  # 1: rotors feel floors
    ceiling: float  # 1: and ceilings
    suction: float  # of walls, share of the thrust
    surfaces: Array  # (8, 4): normal into the air, NED [1], and offset [m]
    surface_count: float


@kernel
def _hub(arm: float, i: int) -> V3:
    """Place of rotor ``i`` in B [m]: rear, left, front, right."""
    if i == 0:
        return (-arm, 0.0, 0.0)
    if i == 1:
        return (0.0, -arm, 0.0)
    if i == 2:
        return (arm, 0.0, 0.0)
    return (0.0, arm, 0.0)


@kernel
def drag_force(air: Air, v: V3, rotation: Array) -> V3:
    """Force [N, B] on a base that moves at v [m/s, NED]; R_WB is in rotation (3, 3) [1]."""
    wind = (air.wind[0], air.wind[1], air.wind[2])
    through = transposed_times(rotation, sub(v, wind))
    return add(rotor_drag(air.drag, through), body_drag(air.area, air.density, through))


@kernel
def rotor_gain(air: Air, p: V3, rotation: Array, i: int) -> float:
    """Thrust of rotor ``i`` over that in free air [1]; the base is at p [m, NED].

    R_WB is in rotation (3, 3) [1].
    """
    hub = add(p, times(rotation, _hub(air.arm, i)))
    gain = 1.0
    for k in range(int(air.surface_count)):
        nx, ny, nz = air.surfaces[k, 0], air.surfaces[k, 1], air.surfaces[k, 2]
        distance = nx * hub[0] + ny * hub[1] + nz * hub[2] - air.surfaces[k, 3]
        if nz < -_LEVEL and air.ground > 0.0:
            gain *= ground_effect(air.radius, distance, air.arm)
        elif nz > _LEVEL and air.ceiling > 0.0:
            gain *= ceiling_effect(air.radius, distance)
    return gain


@kernel
def wall_force(air: Air, p: V3, rotation: Array, thrust: V4) -> V3:
    """Force [N, B] of all walls on rotors with a ``thrust`` [N]; the base is at p [m, NED].

    R_WB is in rotation (3, 3) [1].
    """
    force = (0.0, 0.0, 0.0)
    for k in range(int(air.surface_count)):
        normal = (air.surfaces[k, 0], air.surfaces[k, 1], air.surfaces[k, 2])
        if abs(normal[2]) < _UPRIGHT:
            pull = 0.0
            for i in range(4):
                hub = add(p, times(rotation, _hub(air.arm, i)))
                distance = normal[0] * hub[0] + normal[1] * hub[1] + normal[2] * hub[2]
                distance -= air.surfaces[k, 3]
                pull += wall_pull(air.suction, air.radius, distance, thrust[i])
            force = add(force, scale(-pull, normal))
    return transposed_times(rotation, force)
