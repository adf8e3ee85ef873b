"""The numbers of a vehicle reach the kernels by name, whatever classes declare them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from sitl.compiled import kernel
from sitl.plant.packing import pack_params
from sitl.plant.parameters import Effects, chain, plant, rotors
from sitl.plant.state import JOINTS_MAX, ROTORS_MAX
from sitl.plant.vector import Array
from tests.sitl.vehicles import PAPER, random_vehicle


class Drag(NamedTuple):
    """What a drag model would declare."""

    blades: int
    drag: float


class Numbers(NamedTuple):
    """Numbers of another plant."""

    table: Array
    rotors: Drag


@kernel
def drag_force(numbers: Numbers, speed: float) -> float:
    """A law of the new numbers."""
    force = 0.0
    for _ in range(numbers.rotors.blades):
        force += numbers.rotors.drag * speed
    return force + numbers.table[1, 2]


def test_every_number_of_the_vehicle_is_in_the_record() -> None:
    packed = plant(PAPER, Effects(gravity=1.62))
    for part, numbers in (("chain", chain(PAPER)), ("rotors", rotors(PAPER))):
        for name, wanted in numbers._asdict().items():
            np.testing.assert_array_equal(getattr(getattr(packed, part), name), wanted)
    for name in ("torque_max", "viscous", "coulomb"):
        wanted = [getattr(joint, name) for joint in PAPER.joints]
        assert getattr(packed.drives, name)[:2].tolist() == wanted
    assert packed.feet.points[:4].tolist() == [list(foot) for foot in PAPER.feet.positions]
    assert packed.gravity == 1.62


@pytest.mark.parametrize(("joints", "rotors"), [(1, 4), (3, 5), (JOINTS_MAX, ROTORS_MAX)])
def test_the_record_of_every_vehicle_has_one_layout(joints: int, rotors: int) -> None:
    """So that one compile serves them all."""
    other = random_vehicle(joints, rotors, np.random.default_rng(joints))
    assert plant(other).dtype == plant(PAPER).dtype


def test_a_number_that_is_declared_is_read_by_a_kernel_without_more_code() -> None:
    packed = pack_params(Numbers(np.arange(6.0).reshape(2, 3), Drag(2, 0.125)))
    assert drag_force(packed, 2.0) == 0.25 * 2.0 + 5.0
