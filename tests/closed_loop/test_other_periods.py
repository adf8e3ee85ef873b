"""The planner at 20 Hz is one line, the tick at 1 kHz one of each program, and all fly.

The periods are constants that other modules read while they are imported, so each flight has a
process of its own: ``python -m tests.closed_loop.test_other_periods PERIODS SUITE`` sets them,
flies and prints how it went.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from typing import Any

import pytest

SECONDS = 10.0  # past the first wall of the scenario
PLANNING = {"fsw.autopilot.periods.PLANNING_US": 50_000}
# The tick's line, and the simulator's, which answers as often and knows nothing of the other.
TICK = {"fsw.autopilot.periods.TICK_US": 1_000, "sitl.periods.STEP_US": 1_000}


@pytest.mark.long
@pytest.mark.parametrize("suite", ["exact", "mocap"])
@pytest.mark.parametrize(
    ("periods", "planning_us"),
    [
        pytest.param({}, 100_000, id="as it is"),
        pytest.param(PLANNING, 50_000, id="planner at 20 Hz"),
        pytest.param(TICK, 100_000, id="tick at 1 kHz"),
        pytest.param(PLANNING | TICK, 50_000, id="both"),
    ],
)
def test_other_periods_are_a_line_or_two_and_fly(
    periods: dict[str, int], planning_us: int, suite: str
) -> None:
    command = ["-m", "tests.closed_loop.test_other_periods", json.dumps(periods), suite]
    flown = subprocess.run([sys.executable, *command], capture_output=True, text=True, check=False)
    assert flown.returncode == 0, flown.stderr
    found = json.loads(flown.stdout)
    assert abs(found["plans"] - 1e6 * SECONDS / planning_us) <= 2
    assert found["ticks"] == 1e6 * SECONDS / periods.get("fsw.autopilot.periods.TICK_US", 2_000)
    assert found["failures"] == 0
    assert found["left"] == []
    assert not any("limited" in text for text in found["texts"]), found["texts"]
    assert found["end"] == ""
    assert found["margin_m"] > 0.07  # as it is: 83 mm exactly, 89 mm with mocap
    assert found["error_m"] < 0.04  # 31 and 33 mm


def _fly(suite: str) -> dict[str, Any]:
    from fsw.autopilot.parameters.flight_config import flight_config
    from sitl.scenario_file import load_scenario
    from studies.flight.closed_loop import ClosedLoop, simulate

    ticks, controls = 0, ClosedLoop.controls

    def counted(*args: Any, **more: Any) -> Any:
        nonlocal ticks
        ticks += 1
        return controls(*args, **more)

    ClosedLoop.controls = counted  # type: ignore[method-assign]
    scenario = load_scenario("walls", None if suite == "exact" else suite)
    scenario = replace(scenario, duration_s=SECONDS)
    result = simulate(scenario, 100, flight_config(body=scenario.body))
    truth, planner = result.truth, result.planner
    return {
        "ticks": ticks,
        "plans": planner.plans,
        "failures": planner.failures,
        "left": planner.modes,
        "texts": [text for _, text in planner.texts],
        "end": "" if truth.completed else truth.end_reason,
        "margin_m": truth.min_margin_m,
        "error_m": truth.tracking_error_rms_m,
    }


if __name__ == "__main__":
    for name, value in json.loads(sys.argv[1]).items():
        module, constant = name.rsplit(".", 1)
        setattr(import_module(module), constant, value)
    print(json.dumps(_fly(sys.argv[2])))
