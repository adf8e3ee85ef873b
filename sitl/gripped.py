"""The payload of a flight: where it lies, when the tool takes it and when it lets go of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sitl.plant.aerial_manipulator import Plant
from sitl.plant.integrator import Held
from sitl.plant.payload import last_link, put_link, take_up, with_payload
from sitl.plant.vector import Array
from sitl.scenario import V3, Scenario
from vehicles.description import Vehicle


@dataclass(frozen=True, slots=True)
class PayloadUse:
    """What became of a payload."""

    mass_kg: float
    taken_s: float | None  # when it was taken up; None if it never was
    released_s: float | None  # and let go of
    released_m: V3 | None  # where the end-effector was then, NED


class Gripped:
    """The payload of one flight, taken up and released by time or by the gripper."""

    def __init__(self, scenario: Scenario, vehicle: Vehicle, plant: Plant, plants: Any) -> None:
        """Of a ``vehicle`` whose numbers are in ``plant``, and in ``plants`` (1,), for kernels."""
        self._keys = scenario.payload
        self._joints = len(vehicle.joints)
        self._records = plant, plants
        self._bare = last_link(plant, vehicle)
        self._loaded = self._bare
        self.taken_s: float | None = None
        self._released: tuple[float, V3] | None = None
        if self._keys is not None:
            keys = self._keys
            about = keys.mass_kg, keys.inertia_kg_m2, keys.offset_m
            self._loaded = with_payload(self._bare, vehicle, *about)

    def __bool__(self) -> bool:
        """Whether there is a payload."""
        return self._keys is not None

    @property
    def held_kg(self) -> float:
        """Mass that the tool holds now [kg]."""
        held = self.taken_s is not None and self._released is None
        return self._keys.mass_kg if held and self._keys is not None else 0.0

    def update(
        self, time_s: float, gripper: float, tip: V3, blocks: Sequence[Held], state: Array
    ) -> None:
        """Take it up or let go of it, before the step of ``time_s`` [s].

        By the command to the ``gripper`` [1], 1 to close and −1 to open; the end-effector is at
        ``tip`` [m, NED]. The ``state`` (n,) [SI] takes up the impulse; ``blocks`` is one, for
        memory.
        """
        keys = self._keys
        if keys is None or self._released is not None:
            return
        plant, plants = self._records
        if self.taken_s is None:
            wanted = gripper > 0.0 if keys.gripper else time_s >= keys.attach_at_s
            there = keys.position_m is None or math.dist(tip, keys.position_m) <= keys.reach_m
            if wanted and there:
                # As of the kernels' record: which motors their joints carry, and which are locked.
                take_up(plants[0], blocks, state, self._loaded, self._joints)
                put_link(plant, self._loaded, self._joints)
                self.taken_s = time_s
        elif gripper < 0.0 if keys.gripper else time_s >= keys.release_at_s:
            for record in (plant, plants):
                put_link(record, self._bare, self._joints)
            self._released = time_s, tip

    def use(self) -> PayloadUse | None:
        """What became of it so far; None where there is none."""
        if self._keys is None:
            return None
        at_s, place = self._released or (None, None)
        return PayloadUse(self._keys.mass_kg, self.taken_s, at_s, place)
