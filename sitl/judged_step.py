"""One exchange with the flight software: plant steps, and what they mean, in one compiled call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from sitl.body import Parts
from sitl.compiled import compiled
from sitl.limits import Use, record_use
from sitl.plant.aerial_manipulator import Plant
from sitl.plant.integrator import Held, step
from sitl.plant.vector import V3, V4, Array
from sitl.world import Headroom, ZoneTable, record_if_clear

NOT_JUDGED: Final = 0  # the run is over
LIMITS_JUDGED: Final = 1  # the vehicle's limits alone
ALL_JUDGED: Final = 2  # margins as well


class Judge(NamedTuple):
    """What steps are judged by, and the records that they change."""

    table: ZoneTable
    parts: Parts
    lowest: Array  # (margins,) m, the smallest so far
    when_s: Array  # (margins,) s, when that was
    room: Headroom
    most: Array  # (limits,) SI, see ``sitl.limits``
    use: Use


@compiled
def judged_step(
    plants: Sequence[Plant],
    blocks: Sequence[Held],
    state: Array,
    thrust: V4,
    torque: tuple[float, ...],
    force_W: V3,
    torque_B: V3,
    places: Array,
    states: Array,
    judge: Judge,
    sent: tuple[float, float],
    aim: tuple[Array, float],
    instants: tuple[float, float],
    what: int,
) -> tuple[float, V3, bool]:
    """``step`` of the plant, and ``record_use`` and ``record_if_clear`` of where it went.

    Args:
        plants: One.
        blocks: One.
        state: (17 + 2j,) [SI], overwritten.
        thrust: Commanded [N], rotors 1 to 4.
        torque: (j,) commanded [N·m].
        force_W: Force on the base [N, NED].
        torque_B: Torque on the base [N·m, B].
        places: (steps, rows, 3) [m, NED], overwritten, an entry a plant step.
        states: (steps, 17 + 2j) [SI], overwritten.
        judge: By which, and where it is recorded.
        sent: Largest magnitudes commanded, torque [N·m] and thrust [N].
        aim: As of ``record_if_clear``.
        instants: Time before the first plant step, and between two [s].
        what: What is judged, ``NOT_JUDGED`` and so on.

    Returns:
        Fastest downward speed of a foot on the ground [m/s]; specific force at the base's origin in
        the last state [m/s², B]; whether the margins were judged and there was no incident.
    """
    motion = (thrust, torque, force_W, torque_B, instants[1])
    speed, felt = step(plants, blocks, state, *motion, places, states)
    if what >= LIMITS_JUDGED:
        record_use(states, sent, judge.most, instants, judge.use)
    clear = what == ALL_JUDGED and record_if_clear(
        judge.table, judge.parts, aim, places, instants, judge.lowest, judge.when_s, judge.room
    )
    return speed, felt, clear
