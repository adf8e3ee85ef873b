"""The programs on the pages about clients run, with a vehicle at the other end."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.fences import PAGES, fences
from tests.interop.vehicle import FAST, Vehicle

PACING = FAST
PROGRAMS = [
    pytest.param(
        fence.text,
        id=f"{page.stem}-{fence.line}",
        marks=[pytest.mark.long] if "mavsdk" in page.stem else [],  # it waits a real minute
    )
    for page in PAGES
    for fence in fences(page)
    if fence.mark == "run in" and fence.reason == "tests/interop/test_pages.py"
]


@pytest.mark.parametrize("code", PROGRAMS)
def test_the_program_on_the_page_runs(vehicle: Vehicle, tmp_path: Path, code: str) -> None:
    assert "127.0.0.1:14540" in code
    program = tmp_path / "program.py"
    program.write_text(code.replace("14540", str(vehicle.api_port)), encoding="utf-8")
    command = [sys.executable, str(program)]
    try:
        reported = subprocess.run(command, capture_output=True, text=True, timeout=120.0)
    except subprocess.TimeoutExpired:
        pytest.fail(f"it does not end; the vehicle: {vehicle.reported.read_text()[-2000:]}")
    assert reported.returncode == 0, reported.stdout[-1000:] + reported.stderr[-1000:]
