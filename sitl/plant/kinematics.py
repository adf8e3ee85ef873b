"""Critical points of the vehicle in the world."""

from __future__ import annotations

from sitl.compiled import compilable, kernel
from sitl.plant.aerial_manipulator import Plant, Workspace
from sitl.plant.state import P_WB, V_WB, W_WB_B
from sitl.plant.vector import V3, Array, add, cross, row, times, times_one, triple


@compilable
def places_of_bodies(plant: Plant, state: Array, work: Workspace, k: int, out: Array) -> None:
    """Rows of ``sitl.plant.places``, of a state (n,) [SI], into entry k.

    Of out (steps, rows, 3) [m, NED]; where it has room for three more rows, they are the base's
    axes [1, NED]. ``work`` has placed the bodies.
    """
    frames, points, at = plant.chain.joints + 2, plant.points, work.posture
    base = triple(state, P_WB)
    for i in range(frames):
        _put(out, k, i, add(base, times(work.rotation, row(at.origin, i))))
    for i in range(points.number):
        body = int(points.body[i])
        place = add(row(at.origin, body), times_one(at.axes, body, row(points.place, i)))
        _put(out, k, frames + i, add(base, times(work.rotation, place)))
    rows = frames + points.number
    if out.shape[1] > rows:
        for i in range(3):
            axis = (work.rotation[0, i], work.rotation[1, i], work.rotation[2, i])
            _put(out, k, rows + i, axis)


@kernel
def _put(out: Array, k: int, i: int, p: V3) -> None:
    out[k, i, 0], out[k, i, 1], out[k, i, 2] = p


@compilable
def touch_down_speed(plant: Plant, state: Array, work: Workspace) -> float:
    """Largest downward speed [m/s] of a foot below ground in a state (n,) [SI]; 0 if none is.

    ``work.rotation`` must be that of ``state``.
    """
    fastest = 0.0
    if state[P_WB + 2] + plant.feet.reach < 0.0:
        return fastest
    for i in range(plant.feet.number):
        foot = row(plant.feet.points, i)
        if state[P_WB + 2] + times(work.rotation, foot)[2] > 0.0:
            turn = times(work.rotation, cross(triple(state, W_WB_B), foot))
            fastest = max(fastest, state[V_WB + 2] + turn[2])
    return fastest
