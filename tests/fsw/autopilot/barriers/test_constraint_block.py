"""A block of rows counts its own slacks, and starts out empty of numbers."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.autopilot.barriers.constraint_block import ConstraintBlock


@pytest.mark.parametrize(("slack", "slacks"), [([], 0), ([0], 1), ([0, 0, 1, 2, 2], 3)])
def test_it_has_as_many_slacks_as_its_rows_name(slack: list[int], slacks: int) -> None:
    nodes = np.ones(len(slack), dtype=np.intp)
    block = ConstraintBlock(nodes, np.array(slack, dtype=np.intp), unknowns=12, starts=2)
    assert block.start.shape == (2,)
    assert block.slacks == slacks
    assert block.value.shape == block.lower_bound.shape == (len(slack),)
    assert block.gradient.shape == (len(slack), 12)
    assert not block.gradient.any()
