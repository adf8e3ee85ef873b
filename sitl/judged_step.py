"""One exchange with the flight software: plant steps, and what they mean, in a call each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from sitl.body import Parts
from sitl.compiled import kernel
from sitl.limits import Bounds, Use, record_use
from sitl.plant.aerial_manipulator import Plant
from sitl.plant.integrator import Held, step
from sitl.plant.vector import V3, V6, V8, Array
from sitl.world import Headroom, ZoneTable, record_if_clear, travel

Free: TypeAlias = tuple[Array, int, float, float]
"""Where the vehicle was, the row of its axes and its reach [m], as ``travel`` has them, and how far
all may travel from there until there can be an incident [m]."""


class Judge(NamedTuple):
    """What steps are judged by, and the records that they change."""

    table: ZoneTable
    parts: Parts
    lowest: Array  # (margins,) m, the smallest so far
    when_s: Array  # (margins,) s, when that was
    room: Headroom
    bounds: Bounds
    use: Use


@kernel
def watched_step(
    plants: Sequence[Plant],
    blocks: Sequence[Held],
    state: Array,
    thrust: V8,
    torque: V6,
    force_W: V3,
    torque_B: V3,
    step_s: float,
    places: Array,
    states: Array,
    free: Free,
) -> tuple[float, V3, bool]:
    """``step`` of the plant, and whether judging it can wait, because it can have no incident.

    Args:
        plants: One.
        blocks: One.
        state: (n,) [SI], overwritten.
        thrust: Commanded [N], of the rotors, with anything behind.
        torque: Commanded [N·m], of the joints, likewise.
        force_W: Force on the base [N, NED].
        torque_B: Torque on the base [N·m, B].
        step_s: Of a plant step [s].
        places: (steps, rows, 3) [m, NED], overwritten, an entry a plant step.
        states: (steps, n) [SI], overwritten.
        free: In which there can be no incident.

    Returns:
        Fastest downward speed of a foot on the ground [m/s]; specific force at the base's origin in
        the last state [m/s², B]; whether all have travelled less than is ``free``.
    """
    motion = (thrust, torque, force_W, torque_B, step_s)
    speed, felt = step(plants, blocks, state, *motion, places, states)
    before, axes, reach, most = free
    clear = True
    for k in range(places.shape[0]):
        # Written so that what is not a number is judged.
        if not travel(before, places[k], axes, reach) < most:
            clear = False
    return speed, felt, clear


@kernel
def judge_steps(
    judge: Judge,
    places: Array,
    states: Array,
    sent: tuple[float, float],
    aim: tuple[Array, float],
    instants: tuple[float, float],
    margins: bool,
) -> float:
    """``record_use`` and ``record_if_clear`` of what ``watched_step`` has written.

    Args:
        judge: By which, and where it is recorded.
        places: (steps, rows, 3) [m, NED], an entry a plant step.
        states: (steps, n) [SI].
        sent: Largest commanded, of the most of a joint and of a rotor [1].
        aim: As of ``record_if_clear``.
        instants: Time before the first plant step, and between two [s].
        margins: Whether they are judged, or the vehicle's limits alone.

    Returns:
        As of ``record_if_clear``; minus infinity if margins were not judged.
    """
    record_use(states, sent, judge.bounds, instants, judge.use)
    if not margins:
        return -math.inf
    room = (judge.lowest, judge.when_s, judge.room)
    return record_if_clear(judge.table, judge.parts, aim, places, instants, *room)
