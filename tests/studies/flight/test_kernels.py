"""Kernels are compiled once, before processes that need them are many."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import fsw.compiled
import sitl.compiled
from command_line.kernel_cache import KernelCache
from studies.flight import kernels
from tests.waiting import wait_for

FLY = """
from dataclasses import replace
from fsw.autopilot.parameters.flight_config import flight_config
from sitl.scenario_file import load_scenario
from studies.flight.closed_loop import simulate
for name, suite in (("walls", "perfect"), ("workspace", "mocap"), ("field", "rtk")):
    scenario = replace(load_scenario(name, suite), duration_s=0.5)
    simulate(scenario, 0, flight_config(body=scenario.body))
"""


@pytest.fixture
def folders(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Path]:
    """Where the kernels of either half are kept: an earlier flight has left some of them."""
    found = []
    for half in (fsw.compiled, sitl.compiled):
        folder = tmp_path / half.__name__
        folder.mkdir()
        (folder / "some.nbc").touch()
        cache = KernelCache(folder, 90, "numba")
        monkeypatch.setattr(half, "cache", lambda cache=cache: cache)
        found.append(folder)
    return found


def test_where_all_is_on_disk_no_process_is_started(
    folders: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernels, "_build", lambda half: None)
    for half in kernels.HALVES:
        kernels.compile_half(half)
    monkeypatch.setattr(kernels.subprocess, "Popen", lambda *_, **__: pytest.fail("started"))
    kernels.compile_first(pytest.fail)


@pytest.mark.usefixtures("folders")
def test_what_is_not_on_disk_is_compiled_and_an_interrupt_ends_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    compiler, asked = tmp_path / "compiler", tmp_path / "asked"
    compiler.write_text(f'#!/bin/sh\necho "$$ $4" >> {asked}\nexec sleep 60\n')
    compiler.chmod(0o755)
    monkeypatch.setattr(kernels.sys, "executable", str(compiler))
    said: list[str] = []

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.5)
    try:
        with pytest.raises(KeyboardInterrupt):
            kernels.compile_first(said.append)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert said == ["compiling 180 kernels before the first flight"]
    started = dict(line.split() for line in asked.read_text().splitlines())
    assert sorted(started.values()) == ["fsw", "sitl"]
    for process in started:
        with pytest.raises(ProcessLookupError):
            os.kill(int(process), 0)


@pytest.mark.long
def test_what_is_compiled_first_is_all_that_flights_need(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}

    def run(*words: str) -> set[Path]:
        subprocess.run([sys.executable, *words], env=environment, check=True)
        return set(tmp_path.rglob("*.nbc"))

    for half in ("fsw", "sitl"):
        compiled = run("-m", "studies.flight.kernels", half)
    assert compiled
    assert run("-c", FLY) == compiled


@pytest.mark.long
def test_a_process_that_dies_takes_its_compilers_with_it(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    code = "from studies.flight.kernels import compile_first; compile_first(print)"
    with subprocess.Popen([sys.executable, "-c", code], env=environment) as first:
        children = Path(f"/proc/{first.pid}/task/{first.pid}/children")
        wait_for(lambda: len(children.read_text().split()) == 2 or None, "compilers", 20.0)
        compilers = children.read_text().split()
        time.sleep(0.5)  # they ask to end with it as their first act
        first.kill()
    wait_for(lambda: not any(Path(f"/proc/{one}").exists() for one in compilers) or None, "ends")
