"""Every mode and every fault: flown on worker processes, compared with what must happen."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

from fsw.signals import Severity
from sitl.scenario_file import PERFECT
from studies.campaign import pool_of
from studies.fault_expectations import Expected, differences
from studies.fault_flights import FaultFlight, fly

ProgressReport = Callable[[int, int], None]  # cells done, cells in all
_NATURAL_S = 0.1  # a warning that comes as early or late without the fault is not about it


@dataclass(frozen=True, slots=True)
class Cell:
    """One mode with one fault."""

    mode: str
    expected: Expected
    seed: int


@dataclass(frozen=True, slots=True)
class Judged:
    """What became of a cell, and what of it is not as it must be."""

    cell: Cell
    flight: FaultFlight
    differs: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """The row of the cell."""
        cell, flight = self.cell, self.flight
        return {
            "mode": cell.mode,
            "fault": cell.expected.name,
            "sensors": cell.expected.suite,
            "seed": cell.seed,
            "told_s": flight.told_s,
            "told": flight.told,
            "actions": list(flight.actions),
            "contact": flight.contact,
            "ended": flight.ended,
            "min_margin_m": flight.least_m,
            "as_expected": not self.differs,
            "differs": list(self.differs),
            "expected": asdict(cell.expected.modes[cell.mode]),
        }


def judge(cell: Cell, flight: FaultFlight) -> Judged:
    """Compare a flight with what must happen."""
    expected = cell.expected.modes[cell.mode]
    return Judged(cell, flight, differences(cell.mode, expected, asdict(flight)))


def fly_cell(cell: Cell) -> Judged:
    """Fly one cell here and now; an exception becomes a cell that differs."""
    try:
        flight = fly(cell.mode, cell.expected.fault, cell.expected.suite, cell.seed)
        if cell.expected.fault is not None and cell.expected.suite != PERFECT:
            flight = _without_natural(flight, _natural(cell.mode, cell.expected.suite, cell.seed))
    except Exception as error:
        flight = broken(f"{type(error).__name__}: {error}")
    return judge(cell, flight)


def broken(problem: str) -> FaultFlight:
    """What stands for a flight that was none."""
    return FaultFlight(None, "", (), "", "", None, (), problem)


@cache
def _natural(mode: str, suite: str, seed: int) -> FaultFlight:
    """The same flight without a fault: its sensors have outliers of their own."""
    return fly(mode, None, suite, seed)


def _without_natural(flight: FaultFlight, natural: FaultFlight) -> FaultFlight:
    """The flight without warnings that come without the fault as well."""
    kept = [
        said
        for said in flight.texts
        if said.severity <= Severity.WARNING
        and not any(
            said.text == one.text and abs(said.after_s - one.after_s) <= _NATURAL_S
            for one in natural.texts
        )
    ]
    told_s, told = (kept[0].after_s, kept[0].text) if kept else (None, "")
    return replace(flight, told_s=told_s, told=told)


def run(cells: list[Cell], workers: int, report: ProgressReport) -> list[Judged]:
    """Fly all cells, in their order; no workers: in this process."""
    found: dict[int, Judged] = {}
    report(0, len(cells))
    for number, judged in _flown(cells, workers):
        found[number] = judged
        report(len(found), len(cells))
    return [found[number] for number in range(len(cells))]


def _flown(cells: list[Cell], workers: int) -> Iterator[tuple[int, Judged]]:
    if workers == 0:
        for number, cell in enumerate(cells):
            yield number, fly_cell(cell)
        return
    with pool_of(workers) as pool:
        try:
            out = {pool.submit(fly_cell, cell): k for k, cell in enumerate(cells)}
            for future in as_completed(out):
                number = out[future]
                try:
                    yield number, future.result()
                except BrokenProcessPool:
                    yield number, judge(cells[number], broken("the process that flew it died"))
        except BaseException:
            for process in multiprocessing.active_children():
                process.kill()  # or leaving would wait for flights that are no longer wanted
            pool.shutdown(wait=False, cancel_futures=True)
            raise
