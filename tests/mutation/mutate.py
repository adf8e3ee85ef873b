"""Change the flight software a little, again and again, and see whether a test notices.

cosmic-ray says what can be changed where and writes the change; this picks the changes worth a
test run, draws a sample, works on a copy of the checkout, and runs the tests of the changed module
in forks of one warm process (warm_pytest.py). docs/decisions tells why these tools.

What is known stays known: a mutant is tested again only if its module, or a test that killed it,
or, for a survivor, any of its tests has changed since.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import sys
import time
import tomllib
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tests.mutation.mutants import Mutant, mutants
from tests.mutation.running import HERE, ROOT, Copy, Results, Tests


@dataclass
class Count:
    """Of a folder or of a file."""

    name: str
    mutants: int = 0
    tested: int = 0
    killed: int = 0
    equivalent: int = 0

    def text(self) -> str:
        judged = self.tested - self.equivalent
        if judged == 0:
            return f"{self.name:34} {self.mutants:6} mutants, none tested"
        low, high = wilson(self.killed, judged)
        return (
            f"{self.name:34} {self.mutants:6} mutants, killed {self.killed:4} of {judged:4}: "
            f"{100 * self.killed / judged:5.1f} % ({100 * low:.1f}–{100 * high:.1f})"
            + (f", {self.equivalent} equivalent" if self.equivalent else "")
        )


def wilson(killed: int, judged: int) -> tuple[float, float]:
    """Wilson's interval of a share at 95 %; by hand, because this environment has no SciPy."""
    z2, share = 1.959963984540054**2, killed / judged
    middle = (share + z2 / (2 * judged)) / (1 + z2 / judged)
    root = math.sqrt(z2 * (share * (1 - share) / judged + z2 / (4 * judged**2)))
    half = root / (1 + z2 / judged)
    return max(middle - half, 0.0), min(middle + half, 1.0)


@dataclass(frozen=True)
class Equivalent:
    """One entry of the list of mutants that no test can kill."""

    module: str
    function: str
    reason: str
    line: list[str]  # each of them
    mutated: list[str] | None = None  # one of them, or whatever is made of the line
    operator: str = ""  # begins so

    def is_about(self, mutant: Mutant) -> bool:
        return (
            (self.module, self.function) == (mutant.module, mutant.function)
            and mutant.line in self.line
            and (self.mutated is None or mutant.mutated in self.mutated)
            and mutant.operator.startswith(self.operator)
        )


def _equivalents(copy: Copy, entries: list[dict[str, Any]]) -> list[Equivalent]:
    """The list; a mutant in it that does not exist ends the run."""
    listed = [Equivalent(**entry) for entry in entries]
    for entry in listed:
        exists = (copy.path / entry.module).is_file()
        every = mutants(copy.path, entry.module) if exists else ()
        meant = [mutant for mutant in every if entry.is_about(mutant)]
        gone = [f"line: {line}" for line in entry.line if line not in {m.line for m in meant}]
        gone += [
            f"mutated: {text}"
            for text in entry.mutated or []
            if text not in {m.mutated for m in meant}
        ]
        if gone:
            where = f"{entry.module} {entry.function}"
            sys.exit(f"mutation.toml lists a mutant that does not exist: {where}\n  {gone[0]}")
    return listed


@dataclass
class Report:
    """Of a run."""

    folders: dict[str, Count] = field(default_factory=dict)
    files: list[Count] = field(default_factory=list)
    survivors: list[Mutant] = field(default_factory=list)
    left_out: dict[str, list[str]] = field(default_factory=dict)

    def begin(self, module: str, number: int) -> tuple[Count, Count]:
        """The counts of a module and of its folder."""
        name = module.rpartition("/")[0]
        counts = Count(module), self.folders.setdefault(name, Count(name))
        self.files.append(counts[0])
        for count in counts:
            count.mutants += number
        return counts

    def as_json(self, seconds: float) -> str:
        record = {
            "folders": [asdict(count) for count in self.folders.values()],
            "files": [asdict(count) for count in self.files],
            "survivors": [asdict(mutant) for mutant in self.survivors],
            "left_out": self.left_out,
            "seconds": seconds,
        }
        return json.dumps(record, indent=1, ensure_ascii=False)

    def as_text(self) -> str:
        left_out = sum(len(tests) for tests in self.left_out.values())
        return "\n".join(
            [
                "\nsurvivors:" if self.survivors else "\nno survivors",
                *map(str, self.survivors),
                "",
                *(count.text() for count in self.folders.values()),
                *([f"left out, too slow or other in plain Python: {left_out}"] if left_out else []),
            ]
        )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Mutation testing of the flight software.")
    parser.add_argument("files", nargs="*", help="files, folders (default: those of mutation.toml)")
    parser.add_argument("--sample", type=int, help="mutants of each file (default: all)")
    parser.add_argument("--modules", type=int, help="files drawn of these (default: all)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default: 1)")
    parser.add_argument(
        "--budget", type=float, default=20.0, help="of the tests of a module [s] (default: 20)"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--check", action="store_true", help="check the list of equivalents only")
    parser.add_argument(
        "--work", type=Path, default=ROOT / ".mutation", help="what is kept (default: .mutation)"
    )
    return parser.parse_args()


def _drawn(every: tuple[Mutant, ...], module: str, size: int | None, seed: int) -> list[Mutant]:
    if size is None or size >= len(every):
        return list(every)
    # A larger sample begins with the smaller one: what is known of it stays of use.
    drawn = random.Random(f"{seed} {module}").sample(every, len(every))[:size]
    return sorted(drawn, key=lambda mutant: (mutant.number, mutant.occurrence))


class Run:
    """A sample of the mutants of some modules."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._options = options
        config = tomllib.loads((HERE / "mutation.toml").read_text())
        work = options.work.resolve()
        work.mkdir(exist_ok=True)
        self._copy = Copy(work)
        self._extra = config["extra_tests"]
        self._equivalents = _equivalents(self._copy, config.get("equivalent", []))
        modules = self._copy.modules(options.files or config["folders"])
        if options.modules is not None and options.modules < len(modules):
            modules = sorted(random.Random(options.seed).sample(modules, options.modules))
        self.modules = modules
        self._tests = Tests(work, self._copy, options.budget)
        self._results = Results(work, self._copy)
        self.report = Report()
        self._started = time.monotonic()

    def take_all(self) -> None:
        for at, module in enumerate(self.modules, start=1):
            every = mutants(self._copy.path, module)
            sample = _drawn(every, module, self._options.sample, self._options.seed)
            if sample:
                self._take(f"{at}/{len(self.modules)} {module}", module, len(every), sample)
        self._tests.close()

    def seconds(self) -> float:
        return time.monotonic() - self._started

    def _take(self, title: str, module: str, number: int, sample: list[Mutant]) -> None:
        self._progress(f"{title}: its tests without a mutant")
        selection = self._tests.select(self._copy.tests_of(module, self._extra))
        counts = self.report.begin(module, number)
        if selection.left_out:
            self.report.left_out[module] = selection.left_out
        state = self._copy.digest(module)
        for done, mutant in enumerate(sample, start=1):
            killer = self._results.of(mutant, state, selection) if selection.files else ""
            if killer is None:
                killer = self._tests.killer(mutant, selection)
                self._results.keep(mutant, state, selection, killer)
            self._count(mutant, killer, counts)
            self._progress(
                f"{title}: {done}/{len(sample)} mutants, killed {counts[0].killed}, "
                f"{self.seconds():.0f} s"
            )
        self._progress("")
        if not self._options.json:
            print(f"{counts[0].text()}  [{selection.seconds:.0f} s of tests]", flush=True)

    def _count(self, mutant: Mutant, killer: str, counts: tuple[Count, Count]) -> None:
        is_listed = any(entry.is_about(mutant) for entry in self._equivalents)
        if is_listed and killer:
            sys.exit(f"listed as equivalent, but killed by {killer}:\n{mutant}")
        for count in counts:
            count.tested += 1
            count.equivalent += is_listed
            count.killed += bool(killer)
        if not killer and not is_listed:
            self.report.survivors.append(mutant)

    def _progress(self, text: str) -> None:
        if sys.stderr.isatty() and not self._options.json:
            print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)


def main() -> None:
    options = _arguments()
    run = Run(options)
    if options.check:
        return
    run.take_all()
    print(run.report.as_json(run.seconds()) if options.json else run.report.as_text())


if __name__ == "__main__":
    main()
