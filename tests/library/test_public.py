"""What is public, and that nothing of it is loaded before it is asked for.

A name that is here stays until the next major version, and so do the arguments of ``fly``: whoever
changes this file changes the version in pyproject.toml.
"""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import fsw.compiled
import pandion
import sitl.compiled
from command_line.kernel_cache import KernelCache
from studies.flight import kernels
from tests.cli.command import environment

NAMES = """
AIRFRAME Autopilot Log Observation OwnPartError Plan PlanFailure PlanRequest Result Scenario
ScenarioError Simulator __version__ fly load_log load_scenario save_scenario scenario_names
"""
FLY = """
scenario seed sensors duration_s params planner controller reference disturbance tracking
body safety_filter allow_inconsistent allow_slow vehicle log processes
"""
OF_A_RESULT = """
completed frame information margins metrics min_margin overridden_s parameters path reason report
row save scenario seed texts topics tracking_rms truth view
"""
OF_A_SIMULATOR = """
end_reason hover linear_model observe over reset result step time_s truth
"""


def _public(kind: type) -> list[str]:
    return sorted(name for name in dir(kind) if not name.startswith("_"))


def test_the_public_names_are_these() -> None:
    assert pandion.__all__ == NAMES.split()
    assert list(inspect.signature(pandion.fly).parameters) == FLY.split()
    assert _public(pandion.Result) == OF_A_RESULT.split()
    assert _public(pandion.Simulator) == OF_A_SIMULATOR.split()
    for name in pandion.__all__:
        assert getattr(pandion, name) is not None
    assert set(pandion.__all__) <= set(dir(pandion))
    with pytest.raises(AttributeError, match="flie"):
        pandion.flie  # noqa: B018


def test_its_types_are_for_users_as_well() -> None:
    root = Path(pandion.__file__).parents[1]
    packages = "pandion fsw sitl vehicles studies command_line messages view"
    for package in packages.split():
        assert (root / package / "py.typed").exists()


@pytest.mark.parametrize(
    ("package", "words"),
    [
        pytest.param("cmaes", ["tune", "x.toml"], marks=pytest.mark.long),
        pytest.param("cmaes", ["falsify", "walls"], marks=pytest.mark.long),
        pytest.param(
            "distributed",
            ["reproduce", "table4", "--seeds=100:102", "--duration=1", "--workers=2"],
            marks=pytest.mark.long,
        ),
    ],
)
def test_what_an_extra_is_missing_for_says_so(
    package: str, words: list[str], tmp_path: Path
) -> None:
    code = f"import sys; sys.modules[{package!r}] = None; from pandion.__main__ import main"
    done = subprocess.run(
        [sys.executable, "-c", f"{code}; sys.exit(main({words}))"],
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert f"pip install {package}" in done.stderr
    assert "Traceback" not in done.stderr


COMPILES = """#!/bin/sh
cd {folder}/$4
for k in 1 2 3 4 5 6 7 8 9; do touch $k.nbi; done
sleep 1.2
{end}
"""


@pytest.mark.long
@pytest.mark.parametrize("end", ["touch campaign-numba.complete", "exit 1"])
def test_a_first_flight_says_how_far_compiling_is_once(
    end: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    compiler = tmp_path / "compiler"
    compiler.write_text(COMPILES.format(folder=tmp_path, end=end), encoding="utf-8")
    compiler.chmod(0o755)
    for half in (fsw.compiled, sitl.compiled):
        folder = tmp_path / half.__name__.partition(".")[0]
        folder.mkdir()
        kept = KernelCache(folder, 90, "numba")
        monkeypatch.setattr(half, "cache", lambda kept=kept: kept)
    monkeypatch.setattr(kernels.sys, "executable", str(compiler))
    monkeypatch.setattr(kernels, "_SAY_S", 0.0)
    monkeypatch.setattr(kernels, "_failed", set())
    pandion.fly("walls", duration_s=0.1, log=False)
    first, *more = capsys.readouterr().err.splitlines()
    assert first == "pandion: compiling 180 kernels before the first flight"
    assert re.fullmatch(r"pandion: compiling: 18 of 180 kernels, about \d+ s left", more[-1])
    pandion.fly("walls", duration_s=0.1, log=False)
    assert capsys.readouterr().err == ""


def test_importing_it_loads_nothing_that_takes_time() -> None:
    slow = ("numpy", "numba", "scipy", "fsw", "sitl", "studies", "view")
    code = f"import sys, pandion; print([one for one in {slow} if one in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
