"""The bench: rows for everyone, the same problem for everyone, honest about who is missing."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import __main__ as benchmarks
from benchmarks.optimiser import casadi_method
from benchmarks.optimiser.casadi_method import SOLVERS, CasadiMethod
from benchmarks.optimiser.converged import ConvergedOcp
from benchmarks.optimiser.instances import Instance, planner_of, record
from benchmarks.optimiser.measurement import Effort, Samples, run
from benchmarks.optimiser.methods import Entry, guess_for
from benchmarks.optimiser.report import lines
from benchmarks.optimiser.solved import stopwatch_us
from fsw.autopilot.mpc.planner import Planner

KEYS = {"n", "method", "sqp_iterations", "median_us", "p99_us", "max_us", "suboptimality_p50"}
LITTLE = Effort(instances=2, duration_s=3.0, budget_us=5e5)


def silent(what: str, done: int, total: int) -> None:
    """Report nothing."""


@pytest.fixture(scope="module")
def measured() -> list[Samples]:
    return run((1, 5), LITTLE, silent)


@pytest.fixture(scope="module")
def recorded() -> list[Instance]:
    return record(5, 3, 4.0)


def by_name(measured: list[Samples], name: str, iterations: int | None, n: int) -> Samples:
    return next(
        samples
        for samples in measured
        if (samples.entry.name, samples.entry.sqp_iterations, samples.horizon)
        == (name, iterations, n)
    )


@pytest.mark.long
def test_every_method_has_a_row_for_every_horizon(measured: list[Samples]) -> None:
    rows = [samples.row() for samples in measured]
    assert all(set(row) == KEYS for row in rows)
    assert json.loads(json.dumps(rows, allow_nan=False)) == rows
    names = ["clarabel"] * 3 + ["slsqp-numeric", "slsqp-analytic", "casadi-ipopt", "casadi-fatrop"]
    assert [(row["n"], row["method"]) for row in rows] == [(n, m) for n in (1, 5) for m in names]


@pytest.mark.long
def test_times_are_ordered_and_ours_are_made_of_their_stages(measured: list[Samples]) -> None:
    for n in (1, 5):
        ours = by_name(measured, "clarabel", 2, n)
        row, stages = ours.row(), ours.stages()
        assert 0.0 < float(row["median_us"] or 0.0) <= float(row["p99_us"] or 0.0)
        assert float(row["p99_us"] or 0.0) <= float(row["max_us"] or 0.0)
        assert stages is not None
        assert all(stage > 0.0 for stage in stages)
        assert ours.failed == 0


@pytest.mark.long
def test_everyone_reaches_the_converged_cost(measured: list[Samples]) -> None:
    for n in (1, 5):
        # The optimum in formation costs next to nothing, and tolerances are a share of that.
        for name, iterations, most in (
            ("clarabel", 3, 0.002),
            ("slsqp-numeric", None, 0.02),
        ):
            excess = by_name(measured, name, iterations, n).row()["suboptimality_p50"]
            assert excess is not None
            assert 0.0 <= float(excess) < most


def test_what_is_not_installed_has_an_empty_row_and_is_named() -> None:
    missing = Samples(5, Entry("casadi-fatrop", None, None, "functions in C"))
    row = missing.row()
    assert set(row) == KEYS
    assert row["median_us"] is None
    assert row["suboptimality_p50"] is None
    assert "not installed" in "\n".join(lines([missing]))


def test_without_casadi_nobody_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(casadi_method.importlib.util, "find_spec", lambda name: None)
    assert not any(casadi_method.installed(solver) for solver in SOLVERS)


@pytest.mark.parametrize(
    ("found", "said"), [("clang", "compiled by clang"), (None, "no C compiler")]
)
def test_the_table_says_in_what_form_casadi_computes(
    found: str | None, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        casadi_method.shutil, "which", lambda name: found if name == found else None
    )
    method = Entry("casadi-fatrop", None, None, casadi_method.given())
    assert said in method.given
    built = replace(method, build=lambda *_: pytest.fail("is not built"))
    assert method.given in "\n".join(lines([Samples(5, built)]))


@pytest.mark.parametrize("solver", SOLVERS)
def test_casadi_solves_the_same_problem(solver: str, recorded: list[Instance]) -> None:
    """An independent writing of costs, rows, slacks and limits has its optimum where ours is."""
    pytest.importorskip("casadi")
    flown = planner_of(5)
    config, airframe = flown.planner, flown.airframe
    for instance in recorded:
        converged = ConvergedOcp(config, airframe, instance.request.safe_set)
        guess = guess_for(Planner(config, airframe, stopwatch_us), instance)
        optimum, best = converged.solve(instance.request, guess)
        method = CasadiMethod(config, airframe, instance.request.safe_set, solver)
        answer = method.solve(instance, guess, optimum)
        assert answer.inputs is not None
        np.testing.assert_allclose(answer.inputs[:3], optimum[:3], atol=5e-3)
        assert converged.cost(instance.request, answer.inputs) == pytest.approx(best, rel=5e-3)


def test_instances_are_consecutive_and_of_both_cases(recorded: list[Instance]) -> None:
    assert [instance.case for instance in recorded] == ["I", "II"] * 3
    for instance in recorded:
        times = [request.t_apply_us for request in (*instance.before, instance.request)]
        assert np.diff(times).tolist() == [100_000, 100_000]
        assert len(instance.request.targets) == 6


@pytest.mark.parametrize(
    "argv",
    [
        ["mpc", "--instances", "0"],
        ["mpc", "--horizons", "5,x"],
        ["planet"],
        ["mpc", "--json", "/no/such/directory/file.json"],
    ],
)
def test_what_makes_no_sense_is_refused_at_once(
    argv: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = benchmarks.main(argv)
    except SystemExit as stop:
        code = int(stop.code or 0)
    assert code == 2
    assert "python -m benchmarks" in capsys.readouterr().err


def test_the_verb_writes_a_list_and_what_it_was_measured_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("benchmarks.optimiser.measurement.QUICK", LITTLE)
    target = tmp_path / "bench.json"
    argv = ["mpc", "--quick", "--horizons", "1", "--instances", "1", "--json", str(target)]
    assert benchmarks.main(argv) == 0
    rows = json.loads(target.read_text())
    assert isinstance(rows, list)
    assert {row["n"] for row in rows} == {1}
    beside = json.loads(Path(f"{target}.machine.json").read_text())
    assert beside["machine"]["blas_threads"] == 1
    assert "median us" in capsys.readouterr().out
