"""`pandion doctor` finds what is wrong with a machine and says what to do."""

from __future__ import annotations

import json
import os
import re
import shutil
import socket
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from command_line.output import EXTRAS
from pandion import doctor, health_checks
from pandion.health_checks import FAIL, OK, WARN

ROOT = Path(__file__).parents[2]


def test_a_taken_port_is_seen_and_a_free_one_too() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", 0))
        number = holder.getsockname()[1]
        taken = health_checks.port(number, "somebody", "end it")
    assert (taken.state, taken.remedy) == (WARN, "end it")
    assert health_checks.port(number, "somebody", "end it").state == OK


def test_a_full_disk_fails_and_names_the_need(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert health_checks.disk(tmp_path / "not" / "there").state == OK
    for free, state in ((1e9, WARN), (1e8, FAIL)):
        usage = SimpleNamespace(free=free)
        monkeypatch.setattr(shutil, "disk_usage", lambda _, usage=usage: usage)
        found = health_checks.disk(tmp_path)
        assert found.state == state
        assert "MB" in found.remedy


def test_an_old_package_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib import metadata

    monkeypatch.setattr(metadata, "requires", lambda _: ["numpy>=2.4", "plotly>=1; extra == 'x'"])
    assert health_checks.versions().state == OK
    monkeypatch.setattr(metadata, "requires", lambda _: ["numpy>=99", "nosuch>=1"])
    found = health_checks.versions()
    assert found.state == FAIL
    assert "numpy >= 99, nosuch >= 1" in found.found


def test_every_extra_of_the_package_is_looked_for() -> None:
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = pyproject["project"]["optional-dependencies"]
    del extras["bench"]  # of `python -m benchmarks`, which is not in the wheel
    named = {(name, re.match("[a-z]+", one)[0]) for name, needs in extras.items() for one in needs}
    assert named | {("campaign", "dask")} == {(name, one) for one, name in EXTRAS.items()}


def test_one_processor_is_not_enough_for_real_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    monkeypatch.setattr(os, "getloadavg", lambda: (0.0, 0.0, 0.0))
    assert health_checks.machine().state == WARN
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    assert health_checks.machine().state == OK


def test_refused_privileges_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    claim = "print('real-time scheduling')"
    monkeypatch.setattr(health_checks, "_CLAIM", claim)
    found = health_checks.real_time()
    assert found.state == WARN
    assert "real-time scheduling" in found.found
    assert "limits.conf" in found.remedy


@pytest.mark.parametrize(("state", "code"), [(OK, 0), (WARN, 0), (FAIL, 1)])
def test_a_line_each_the_same_as_json_and_the_exit_code(
    state: str, code: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Any
) -> None:
    checks = [
        health_checks.Check("disk", OK, "much"),
        health_checks.Check("clock", state, "slow", "wind it"),
    ]
    monkeypatch.setattr(doctor, "all_checks", lambda _: checks)
    file = tmp_path / "found.json"
    assert doctor.main([f"--json={file}"]) == code
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    assert lines[1].endswith("slow; wind it")
    found = json.loads(file.read_text())
    assert found["fit"] is (code == 0)
    assert [check["state"] for check in found["checks"]] == [OK, state]


def test_everything_is_looked_at(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(health_checks, "_NAPS", 2)
    names = [check.name for check in health_checks.all_checks(tmp_path)]
    for name in ("machine", "real time", "clock", "versions", "compile cache", "disk"):
        assert name in names
