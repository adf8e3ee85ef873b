"""The judgement of a measurement: over budget, or on a machine too noisy to measure."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path

import pytest

from benchmarks.bare_loop import BareLoops
from benchmarks.budgets import MachineNoise, judge, load_budgets, result
from benchmarks.loop import main
from fsw.runtime.clock import now_us

BUDGETS = load_budgets()
QUIET = MachineNoise(others=0.05, stolen=0.0)
AT_BUDGET = {group: dict(values) for group, values in BUDGETS.items()}


def test_every_budget_of_the_file_is_judged() -> None:
    assert len(judge({}, BUDGETS)) == sum(len(values) for values in BUDGETS.values())


def test_at_its_budget_everything_is_kept() -> None:
    rows = judge(AT_BUDGET, BUDGETS)
    assert all(row.kept for row in rows)
    assert result(rows, QUIET) == "pass"


@pytest.mark.parametrize("group", sorted(BUDGETS))
def test_one_figure_above_its_budget_is_no_pass(group: str) -> None:
    key = next(iter(BUDGETS[group]))
    measured = {**AT_BUDGET, group: {**AT_BUDGET[group], key: BUDGETS[group][key] + 1.0}}
    assert result(judge(measured, BUDGETS), QUIET) == "over budget"


@pytest.mark.parametrize("value", [None, float("nan")])
def test_what_was_not_measured_is_not_kept(value: float | None) -> None:
    measured = {**AT_BUDGET, "wake_up": {"p50_us": 1.0, "p99_us": value}}
    assert result(judge(measured, BUDGETS), QUIET) == "over budget"


@pytest.mark.parametrize(
    "noise",
    [
        MachineNoise(0.5, 0.0),
        MachineNoise(0.0, 0.1),
        MachineNoise(float("nan"), 0.0),
        MachineNoise(0.0, 0.0, stopped=0.001),
    ],
)
def test_on_a_noisy_machine_there_is_no_pass_and_no_fail(noise: MachineNoise) -> None:
    assert result(judge(AT_BUDGET, BUDGETS), noise) == "too noisy"


@pytest.mark.long
def test_a_loop_that_only_sleeps_sees_the_machine_stand_still_and_leaves_nothing() -> None:
    before = _descendants()
    with BareLoops() as bare:
        loops = [int(process) for process in _descendants() if process not in before]
        _wait_until_each_sleeps_at_its_priority_or_ended(loops)
        begin_us = now_us()
        for loop in loops:
            os.kill(loop, signal.SIGSTOP)
        time.sleep(0.5)
        for loop in loops:
            os.kill(loop, signal.SIGCONT)
    assert _descendants() == before
    if bare.stops is not None:  # the machine grants real-time priority
        assert bare.stops.share(begin_us, 250) > 0.9
        missed = [(begin_us + 100_000, begin_us + 300_000)]
        assert bare.stops.missed_elsewhere(missed, begin_us, 1_000) == 0.0
        before_it = [(begin_us - 400_000, begin_us - 200_000)]
        assert bare.stops.missed_elsewhere(before_it, begin_us - 500_000, 1_000) > 0.1


@pytest.mark.long
def test_a_short_flight_beside_a_busy_program_is_measured_and_leaves_nothing(
    tmp_path: Path,
) -> None:
    before = _descendants()
    target = tmp_path / "loop.json"
    code = main(["--duration", "2", "--hogs", "1", "--json", str(target)])
    (flight,) = json.loads(target.read_text())["flights"]
    assert code == (0 if flight["result"] == "pass" else 1)
    assert flight["hogs"] == 1
    assert flight["vehicle"]["inner"]["ticks"] > 900
    measured = {name: figure["value"] for name, figure in flight["figures"].items()}
    assert 50.0 < measured["resident MB"] < 400.0
    assert measured.pop("growth MB") is None, "two seconds say nothing about growth"
    times = [name for name in measured if name.endswith(" us")]
    assert len(times) == 13
    assert all(measured[name] > 0.0 for name in times), measured
    assert _descendants() == before


@pytest.mark.parametrize(
    "words", [["--hogs", "x"], ["--json", "/nowhere/at/all.json"], ["--duration", "0"]]
)
def test_bad_options_are_one_sentence(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(words)
    sentence = capsys.readouterr().err
    assert sentence.startswith("python -m benchmarks loop: ")
    assert sentence.count("\n") == 1


def _wait_until_each_sleeps_at_its_priority_or_ended(loops: list[int]) -> None:
    deadline = time.monotonic() + 20.0  # a start takes seconds where the machine is busy
    while any(os.sched_getscheduler(loop) != os.SCHED_FIFO and not _ended(loop) for loop in loops):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    time.sleep(0.1)  # from the priority to the first release


def _ended(process: int) -> bool:
    return Path(f"/proc/{process}/stat").read_text().rsplit(") ", 1)[1].startswith("Z")


def _descendants() -> list[str]:
    children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text()
    return children.split()
