"""What a real PX4 flies; `make px4 PX4_BUILD=...` runs it, and without a build it is skipped."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.real_px4.real_px4 import HOLD, NO_BUILD, OFFBOARD, flying, there_is_one

pytestmark = [pytest.mark.long, pytest.mark.skipif(not there_is_one(), reason=NO_BUILD)]

START = 1.45  # m, where `walls` begins


def test_walls_are_kept_by_the_planner_above_px4(tmp_path: Path) -> None:
    with flying("walls", tmp_path, seed=21) as loop:
        operator = loop.operator
        operator.take_off(START)
        operator.fold(5.0)
        assert operator.until(
            lambda: operator.mode == OFFBOARD, 20.0, lambda: operator.set_mode(OFFBOARD)
        )
        operator.until(lambda: loop.sitl.poll() is not None, 100.0)
        assert operator.mode == OFFBOARD, (operator.texts[-5:], loop.said("fsw"))
        result = loop.result()
    assert result["min_margin_m"] > 0.0
    assert result["tracking_error_rms_m"] < 0.1


def test_a_planner_that_is_killed_leaves_px4_to_its_failsafe(tmp_path: Path) -> None:
    with flying("walls-calm", tmp_path, seed=22) as loop:
        operator = loop.operator
        operator.take_off(START)
        operator.fold(5.0)
        assert operator.until(
            lambda: operator.mode == OFFBOARD, 20.0, lambda: operator.set_mode(OFFBOARD)
        )
        operator.until(lambda: False, 3.0)
        assert loop.fsw is not None
        loop.fsw.kill()
        assert operator.until(lambda: operator.mode == HOLD, 5.0), operator.texts[-5:]
        assert loop.px4.poll() is None
