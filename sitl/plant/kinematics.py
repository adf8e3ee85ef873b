"""Critical points of the vehicle in the world."""

from __future__ import annotations

from sitl.compiled import kernel
from sitl.plant.aerial_manipulator import Plant, Workspace
from sitl.plant.state import P_WB, V_WB, W_WB_B
from sitl.plant.vector import V3, Array, add, cross, row, times, triple


@kernel
def places_of_bodies(state: Array, work: Workspace, k: int, out: Array) -> None:
    """Positions in W of base origin and DH frames of a state (17 + 2j,) [SI], into entry k.

    Entries of out (n, 2 + j, 3) [m, NED] are base, DH frame 0 (joint 1), …, DH frame j
    (end-effector); where there is room for three more, the base's axes [1, NED]. ``work`` has
    placed the bodies.
    """
    joints = work.still.shape[0]
    base = triple(state, P_WB)
    _put(out, k, 0, base)
    for i in range(joints + 1):
        _put(out, k, 1 + i, add(base, times(work.rotation, row(work.posture.origin, i))))
    if out.shape[1] > joints + 2:
        for i in range(3):
            axis = (work.rotation[0, i], work.rotation[1, i], work.rotation[2, i])
            _put(out, k, 2 + joints + i, axis)


@kernel
def _put(out: Array, k: int, i: int, p: V3) -> None:
    out[k, i, 0], out[k, i, 1], out[k, i, 2] = p


@kernel
def touch_down_speed(plant: Plant, state: Array, work: Workspace) -> float:
    """Largest downward speed [m/s] of a foot below ground in a state (17 + 2j,) [SI]; 0 if none is.

    ``work.rotation`` must be that of ``state``.
    """
    fastest = 0.0
    if state[P_WB + 2] + plant.feet.reach < 0.0:
        return fastest
    for i in range(plant.feet.points.shape[0]):
        foot = row(plant.feet.points, i)
        if state[P_WB + 2] + times(work.rotation, foot)[2] > 0.0:
            turn = times(work.rotation, cross(triple(state, W_WB_B), foot))
            fastest = max(fastest, state[V_WB + 2] + turn[2])
    return fastest
