"""Critical points of the vehicle in the world."""

from __future__ import annotations

from sitl.compiled import compiled
from sitl.plant.aerial_manipulator import Plant, Workspace, empty_workspace
from sitl.plant.newton_euler import posture_into
from sitl.plant.state import JOINTS_FROM, P_WB, Q_WB, V_WB, W_WB_B
from sitl.plant.vector import Array, add, cross, put, rotation_into, row, times


@compiled
def place_into(plant: Plant, state: Array, work: Workspace, out: Array) -> None:
    """Positions in W of the base origin and of every DH frame's origin.

    Args:
        plant: Numbers of the vehicle.
        state: (17 + 2j,).
        work: Memory; its rotation and posture are left valid for ``state``.
        out: (2 + j, 3) m: base, DH frame 0 (joint 1), …, DH frame j (end-effector).
    """
    joints = work.still.shape[0]
    q = state[Q_WB]
    rotation_into(q[0], q[1], q[2], q[3], work.rotation)
    posture_into(plant.chain, state[JOINTS_FROM : JOINTS_FROM + joints], work.posture)
    base = row(state[P_WB])
    put(out[0], base)
    for i in range(joints + 1):
        put(out[1 + i], add(base, times(work.rotation, row(work.posture.origin[i]))))


@compiled
def points_into(plant: Plant, trace: Array, out: Array) -> None:
    """``place_into`` for each state of ``trace`` (k, 17 + 2j); ``out`` is (k, 2 + j, 3)."""
    work = empty_workspace((trace.shape[1] - JOINTS_FROM) // 2)
    for k in range(trace.shape[0]):
        place_into(plant, trace[k], work, out[k])


@compiled
def touch_down_speed(plant: Plant, state: Array) -> float:
    """Largest downward speed of a foot that is below ground [m/s]; 0 if none is."""
    work = empty_workspace((state.shape[0] - JOINTS_FROM) // 2)
    q = state[Q_WB]
    rotation_into(q[0], q[1], q[2], q[3], work.rotation)
    fastest = 0.0
    for i in range(plant.feet.points.shape[0]):
        foot = row(plant.feet.points[i])
        if state[P_WB][2] + times(work.rotation, foot)[2] > 0.0:
            turn = times(work.rotation, cross(row(state[W_WB_B]), foot))
            fastest = max(fastest, state[V_WB][2] + turn[2])
    return fastest
