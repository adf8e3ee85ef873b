"""The numbers of a vehicle reach the kernels by name, whatever classes declare them."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from sitl.compiled import kernel
from sitl.plant.aerial_manipulator import plant
from sitl.plant.packing import pack_params
from sitl.plant.parameters import Rotors, Vehicle, chain
from sitl.plant.vector import Array


@dataclasses.dataclass(frozen=True)
class RotorsWithDrag(Rotors):
    """What a drag model would add to the declaration of the rotors."""

    drag: float = 0.25


class Numbers(NamedTuple):
    """Numbers of another plant."""

    table: Array
    rotors: RotorsWithDrag


@kernel
def drag_force(numbers: Numbers, speed: float) -> float:
    """A law of the new number."""
    return numbers.rotors.drag * speed + numbers.table[1, 2]


def test_every_number_of_the_vehicle_is_in_the_record() -> None:
    vehicle = Vehicle()
    packed = plant(vehicle)
    for name, wanted in chain(vehicle)._asdict().items():
        np.testing.assert_array_equal(getattr(packed.chain, name), wanted)
    for part in ("rotors", "joints"):
        for field in dataclasses.fields(getattr(vehicle, part)):
            wanted = getattr(getattr(vehicle, part), field.name)
            assert getattr(getattr(packed, part), field.name) == wanted, field.name
    assert packed.feet.points.shape == (4, 3)
    assert packed.gravity == vehicle.gravity


def test_a_number_that_is_declared_is_read_by_a_kernel_without_more_code() -> None:
    packed = pack_params(Numbers(np.arange(6.0).reshape(2, 3), RotorsWithDrag()))
    assert drag_force(packed, 2.0) == 0.25 * 2.0 + 5.0
