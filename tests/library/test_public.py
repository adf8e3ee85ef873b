"""What is public, and that nothing of it is loaded before it is asked for.

A name that is here stays until the next major version, and so do the arguments of ``fly``: whoever
changes this file changes the version in pyproject.toml.
"""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import pandion
from command_line.kernel_cache import KernelCache
from tests.cli.command import environment

NAMES = """
AIRFRAME Autopilot Log Observation OwnPartError Plan PlanFailure PlanRequest Result Scenario
ScenarioError Simulator __version__ fly load_log load_scenario save_scenario scenario_names
"""
FLY = """
scenario seed sensors duration_s params planner controller reference disturbance tracking
safety_filter allow_inconsistent allow_slow log processes
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


def test_a_first_flight_says_that_it_compiles(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    kept: list[str] = []
    monkeypatch.setattr(KernelCache, "is_due", lambda *_: "library" not in kept)
    monkeypatch.setattr(KernelCache, "note", lambda _, what: kept.append(what))
    for expected in (1, 0):
        pandion.fly("walls", duration_s=0.1, log=False)
        assert capsys.readouterr().err.count("compiles its kernels") == expected


def test_importing_it_loads_nothing_that_takes_time() -> None:
    slow = ("numpy", "numba", "scipy", "fsw", "sitl", "studies", "view")
    code = f"import sys, pandion; print([one for one in {slow} if one in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
