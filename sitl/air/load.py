"""What the air adds to the plant's forces: drag of rotors and body, and surfaces nearby."""

from __future__ import annotations

from typing import NamedTuple

from sitl.air.body_drag import body_drag
from sitl.air.ceiling_effect import ceiling_effect
from sitl.air.ground_effect import ground_effect
from sitl.air.rotor_drag import rotor_drag
from sitl.air.wall_effect import wall_pull
from sitl.compiled import kernel
from sitl.plant.vector import V3, Array, add, dot, row, scale, sub, transposed_times

SURFACES = 8  # room for planes
_LEVEL = 0.7  # a plane whose normal is this steep is a floor or a ceiling
_UPRIGHT = 0.5  # and one below this a wall


class Air(NamedTuple):
    """Numbers of the air for the kernels (see ``parameters.AirModel``)."""

    active: int  # 0: there is no air but that which carries the rotors
    wind: Array  # (3,) m/s, NED, of the air; written before every exchange
    drag: Array  # (3,) N·s/m, of the rotors, along the body's axes
    area: float  # m², drag area of the body
    density: float  # kg/m³
    rotors: int
    radius: Array  # (8,) m, of each rotor
    beside: Array  # (8, 8) m, from hub to hub
    ground: int  # 1: rotors feel floors
    ceiling: int  # 1: and ceilings
    suction: float  # of walls, share of the thrust
    surfaces: Array  # (8, 4): normal into the air, NED [1], and offset [m]
    surface_count: int


@kernel
def drag_force(air: Air, v: V3, rotation: Array) -> V3:
    """Force [N, B] on a base that moves at v [m/s, NED]; R_WB is in rotation (3, 3) [1]."""
    wind = (air.wind[0], air.wind[1], air.wind[2])
    through = transposed_times(rotation, sub(v, wind))
    return add(rotor_drag(air.drag, through), body_drag(air.area, air.density, through))


@kernel
def _height(air: Air, k: int, hub: V3) -> float:
    """Distance of a hub [m, NED] from surface ``k`` [m]."""
    return dot(row(air.surfaces, k), hub) - float(air.surfaces[k, 3])


@kernel
def rotor_gain(air: Air, hub: V3, i: int) -> float:
    """Thrust of rotor ``i`` over that in free air [1], with its hub [m, NED]."""
    gain = 1.0
    for k in range(air.surface_count):
        up = -air.surfaces[k, 2]
        if up > _LEVEL and air.ground > 0:
            gain *= ground_effect(air.radius, _height(air, k, hub), air.beside, i, air.rotors)
        elif up < -_LEVEL and air.ceiling > 0:
            gain *= ceiling_effect(air.radius[i], _height(air, k, hub))
    return gain


@kernel
def wall_force(air: Air, hub: V3, i: int, thrust: float) -> V3:
    """Force [N, NED] of all walls on rotor ``i``, with its hub [m, NED] and its ``thrust`` [N]."""
    force = (0.0, 0.0, 0.0)
    for k in range(air.surface_count):
        if abs(air.surfaces[k, 2]) < _UPRIGHT:
            pull = wall_pull(air.suction, air.radius[i], _height(air, k, hub), thrust)
            force = add(force, scale(-pull, row(air.surfaces, k)))
    return force
