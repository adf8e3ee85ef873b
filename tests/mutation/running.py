"""A copy of the checkout, the tests of a module in it, and running them on a mutant."""

from __future__ import annotations

import ast
import compileall
import hashlib
import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

from cosmic_ray.mutating import mutate_code

from tests.mutation.mutants import OPERATORS, Mutant

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
EACH = 5.0  # s, the longest a single test may take in plain Python


class Copy:
    """What git knows, or would know, of the checkout, with kernels that are plain Python."""

    def __init__(self, work: Path) -> None:
        self.path = work / "copy"
        files = subprocess.run(
            ["git", "-c", "safe.directory=*", "ls-files", "-co", "--exclude-standard"],
            cwd=ROOT, check=True, capture_output=True, text=True,
        ).stdout.splitlines()  # fmt: skip
        shutil.rmtree(self.path, ignore_errors=True)
        for name in [*files, "messages/dialect.py"]:
            if (ROOT / name).is_file():
                (self.path / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(ROOT / name, self.path / name)
        shutil.copyfile(HERE / "plain_compiled.py", self.path / "fsw/compiled.py")
        # A run keeps no byte code, so what never changes is compiled here: the dialect takes long.
        compileall.compile_dir(self.path, quiet=1)

    def modules(self, wanted: list[str]) -> list[str]:
        """The files of files and folders."""
        found = []
        for name in wanted:
            path = self.path / name
            if not path.exists():
                sys.exit(f"{name}: no such file or folder in the checkout")
            files = sorted(path.rglob("*.py")) if path.is_dir() else [path]
            found += [self._name(file) for file in files if file.name != "__init__.py"]
        return found

    def tests_of(self, module: str, extra: dict[str, list[str]]) -> list[list[str]]:
        """The test files of a module, the nearest first: most mutants fall there.

        Its mirror; what imports it; the others of the mirror's folder; what is declared.
        """
        folder, _, name = module.rpartition("/")
        every = [self._name(path) for path in sorted((self.path / "tests/fsw").rglob("test_*.py"))]
        mirror = [test for test in every if test == f"tests/{folder}/test_{name}"]
        importing = [test for test in every if module in self.imported(test)]
        beside = [test for test in every if test.startswith(f"tests/{folder}/test_")]
        declared = [
            test for prefix, tests in extra.items() if module.startswith(prefix) for test in tests
        ]
        groups: list[list[str]] = []
        taken: set[str] = set()
        for group in (mirror, importing, beside, declared):
            groups.append([test for test in group if test not in taken])
            taken.update(group)
        return groups

    @cache  # noqa: B019 — there is one copy a run
    def imported(self, file: str) -> frozenset[str]:
        """The files of the checkout that a test imports, itself or through helpers of the tests."""
        names: list[str] = []
        for node in ast.walk(ast.parse((self.path / file).read_text())):
            if isinstance(node, ast.Import):
                names += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module is not None:
                names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        paths = {f"{name.replace('.', '/')}.py" for name in names}
        direct = {name for name in paths if (self.path / name).is_file()}
        helpers = {name for name in direct if name.startswith("tests/") and name != file}
        return frozenset(direct.union(*map(self.imported, helpers)))

    def helpers(self, test: str) -> set[str]:
        return {name for name in self.imported(test) if name.startswith("tests/")}

    def digest(self, *files: str) -> str:
        total = hashlib.sha256()
        for name in sorted(set(files)):
            total.update(name.encode() + b"\0" + (self.path / name).read_bytes())
        return total.hexdigest()[:16]

    def product(self) -> list[str]:
        return [self._name(path) for path in self.path.glob("fsw/**/*.py")]

    def _name(self, path: Path) -> str:
        return str(path.relative_to(self.path))


@dataclass(frozen=True)
class Selection:
    """The tests of a module that are fit for it."""

    files: list[str]
    left_out: list[str]  # they fail or take long in plain Python, without any mutant
    seconds: float
    state: str  # a digest


class Tests:
    """The warm process that runs tests in the copy."""

    def __init__(self, work: Path, copy: Copy, budget: float) -> None:
        """Start it.

        Args:
            work: Where results are kept.
            copy: What the tests run in.
            budget: The most that the tests of a module may take [s]: unit tests first, and the
                quickest.
        """
        self._copy, self._budget = copy, budget
        self._process = subprocess.Popen(
            [ROOT / ".venv/bin/python", HERE / "warm_pytest.py"],
            cwd=copy.path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env=os.environ | {"PYTHONPATH": ""},
        )  # fmt: skip
        self._kept = work / "baseline.json"
        self._baseline = json.loads(self._kept.read_text()) if self._kept.is_file() else {}

    def select(self, files: list[list[str]]) -> Selection:
        """Of some test files, nearest first, the tests that pass in time if nothing is changed."""
        left_out: list[str] = []
        fit: list[tuple[int, float, str, str]] = []
        for rank, group in enumerate(files):
            for file in group:
                base = self._without_mutant(file)
                left_out += base["failed"]
                fit += [
                    (rank, seconds, name, file)
                    for name, seconds in base["seconds"].items()
                    if name not in base["failed"]
                ]
        total, used = 0.0, set()
        for _, seconds, name, file in sorted(fit):
            if total + seconds <= self._budget:
                total += seconds
                used.add(file)
            else:
                left_out.append(name)
        kept = [file for group in files for file in group if file in used]
        helpers = [name for file in kept for name in self._copy.helpers(file)]
        return Selection(kept, left_out, total, self._copy.digest(*kept, *helpers))

    def killer(self, mutant: Mutant, selection: Selection) -> str:
        """The test that notices a mutant; an empty text if none does."""
        path = self._copy.path / mutant.module
        original = path.read_text()
        Path(cache_from_source(str(path))).unlink(missing_ok=True)
        path.write_text(mutate_code(original, OPERATORS[mutant.operator], mutant.occurrence))
        try:
            # The nearest file alone at first: most mutants fall there, and the others take seconds
            # to be loaded.
            for tests in filter(None, (selection.files[:1], selection.files[1:])):
                answer = self._run(
                    tests=tests, deselect=selection.left_out,
                    timeout=20.0 + 5.0 * selection.seconds, each=None, stop=True,
                )  # fmt: skip
                if answer["status"] in (4, 5):
                    sys.exit(f"pytest ran no test of {mutant.module}")
                if answer["status"] != 0:
                    return answer["failed"][0] if answer["failed"] else f"status {answer['status']}"
        finally:
            path.write_text(original)
        return ""

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(10.0)

    def _without_mutant(self, test: str) -> dict[str, Any]:
        """Seconds of each test of a file, and the ones that fail."""
        state = self._copy.digest(test, *self._copy.imported(test))
        known = self._baseline.get(test)
        if known is None or known["state"] != state:
            answer = self._run(tests=[test], deselect=[], timeout=900.0, each=EACH, stop=False)
            if answer["status"] not in (0, 1):
                sys.exit(f"{test} cannot be run in plain Python: {answer}")
            known = {"state": state, "failed": answer["failed"], "seconds": answer["seconds"]}
            self._baseline[test] = known
            self._kept.write_text(json.dumps(self._baseline))
        return known

    def _run(self, **request: Any) -> dict[str, Any]:
        """One request of warm_pytest.py."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps(request), file=self._process.stdin, flush=True)
        return json.loads(self._process.stdout.readline())


class Results:
    """What came of each mutant, kept from run to run.

    It holds as long as the module and the test that killed the mutant are the same, or all tests
    of the module if none did. A change of another module is not seen: `make clean` forgets all.
    """

    def __init__(self, work: Path, copy: Copy) -> None:
        self._copy = copy
        self._path = work / "results.jsonl"
        self._known: dict[tuple[Any, ...], dict[str, Any]] = {}
        if self._path.is_file():
            for line in self._path.read_text().splitlines():
                record = json.loads(line)
                self._known[tuple(record["key"])] = record

    def of(self, mutant: Mutant, module: str, selection: Selection) -> str | None:
        """Who killed it, an empty text for a survivor, nothing if it is not known."""
        record = self._known.get(mutant.key)
        if record is None or record["module"] != module:
            return None
        holds = record["state"] == self._state(record["killer"], selection)
        return record["killer"] if holds else None

    def keep(self, mutant: Mutant, module: str, selection: Selection, killer: str) -> None:
        state = self._state(killer, selection)
        record = {"key": mutant.key, "module": module, "killer": killer, "state": state}
        self._known[mutant.key] = record
        with self._path.open("a") as file:
            print(json.dumps(record), file=file)

    def _state(self, killer: str, selection: Selection) -> str:
        test = killer.partition("::")[0]
        return self._copy.digest(test) if test in selection.files else selection.state
