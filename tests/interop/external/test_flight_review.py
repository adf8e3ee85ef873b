"""Flight Review's own plot code on a log of walls with mocap: docs/reference/flight-log.md.

``FLIGHT_REVIEW`` is a checkout of it, with what it needs in its ``.venv``.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

from tests.cli.command import PANDION, environment

CHECKOUT = os.environ.get("FLIGHT_REVIEW")
# Plots of a PX4 quadrotor that this log has nothing for; the page says why.
LEFT = {
    "Angular Acceleration FFT",
    "Angular acceleration Power Spectral Density",
    "CPU & RAM",
    "GPS Noise & Jamming",
    "Raw Magnetic Field Strength",
    "Raw Radio Control Inputs",
    "Temperature",
    "Visual Odometry Attitude Rate",
}
OF_WINGS = {"Actuator Controls 1 (VTOL in Fixed-Wing mode)", "TECS"}


@pytest.mark.skipif(CHECKOUT is None, reason="FLIGHT_REVIEW names no checkout of Flight Review")
def test_it_draws_every_plot_but_those_that_the_page_lists(tmp_path: Path) -> None:
    assert CHECKOUT is not None
    out = tmp_path / "flown"
    words = ["fly", "walls", "--sensors", "mocap", "--duration", "8", "--out", str(out)]
    flown = subprocess.run([*PANDION, *words], env=environment(), capture_output=True, check=False)
    assert (out / "flight.ulg").exists(), flown.stderr
    done = subprocess.run(
        [
            Path(CHECKOUT, ".venv", "bin", "python"),
            Path(__file__).with_name("flight_review.py"),
            out / "flight.ulg",
        ],
        cwd=Path(CHECKOUT, "app", "plot_app"), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["type"] == "Quadrotor"
    assert len(found["drawn"]) >= 32
    assert set(found["left"]) == LEFT | OF_WINGS
