"""``make fuzz``: new inputs for every reader, guided by the lines of it that they reach.

Atheris (libFuzzer) makes them from those kept in ``tests/fuzz/corpus``, one archive a reader. A
finding ends a run with its traceback; its input is then in ``build/fuzz``. Without one, the inputs
that reach something new are kept with ``--keep``, the fewest that reach all of it.
"""

from __future__ import annotations

import argparse
import hashlib
import shutil
import subprocess
import sys
import zipfile
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path

CORPUS = Path(__file__).parent / "corpus"
WORK = Path("build/fuzz")
LONGEST = 8192  # bytes of an input
SLOWEST = 10  # s for one input
PACKAGES = {  # of each target: in which an input may reach something new
    "scenario": ["sitl.scenario_file", "sitl.scenario_validation", "tomllib"],
    "parameters": ["fsw.storage.parameter_file", "fsw.autopilot.parameters.param_type"],
    "key": ["fsw.link.signing", "json"],
    "flight-log": ["messages.ulog_reader", "messages.ulog", "pandion.log_summary"],
    "datagrams": ["messages.frames"],
    "ground-link": ["fsw.link"],
    "simulator-link": ["fsw.link.sim_link", "fsw.link.wire"],
    "vehicle-replies": ["sitl.link", "messages.status_text", "messages.lockstep_codec"],
    "replay": ["pandion.flight_replay", "fsw.log", "messages.ulog_reader", "command_line"],
    "log-pages": ["view", "messages.ulog_reader", "command_line", "fsw.log.json_codec"],
    "results": ["view", "command_line", "pandion.report", "pandion.result"],
    "tlog": ["view", "messages.tlog_reader", "fsw.link.wire.decode"],
}
# Imported as they are: what compiles kernels cannot be traced.
PLAIN = {name: ["view.vehicle"] for name in ("tlog", "log-pages", "results")} | {
    "replay": ["tests.closed_loop.harness"]
}


def kept(name: str) -> list[bytes]:
    """The inputs that are kept for a target."""
    archive = CORPUS / f"{name}.zip"
    if not archive.exists():
        return []
    with zipfile.ZipFile(archive) as files:
        return [files.read(entry) for entry in files.namelist()]


def main() -> int:
    """Fuzz the targets that are named, or all, one after another; 1 after a finding."""
    parser = argparse.ArgumentParser(prog="make fuzz")
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="all if none is named")
    parser.add_argument("--seconds", type=int, default=60, help="for each target")
    parser.add_argument("--keep", action="store_true", help="keep what reached something new")
    parser.add_argument("--here", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    options = parser.parse_args()
    unknown = [name for name in options.targets if name not in PACKAGES]
    if unknown:
        parser.error(f"unknown target {unknown[0]}; known: {', '.join(PACKAGES)}")
    if options.here:
        _fuzz(options.targets[0], options.here)
    found = []
    for name in options.targets or PACKAGES:
        print(f"fuzz: {name}, {options.seconds} s", flush=True)
        if not _runs_clean(name, options.seconds):
            found.append(name)
        elif options.keep:
            _keep(name)
    print(f"fuzz: findings in {', '.join(found)}" if found else "fuzz: no finding")
    return 1 if found else 0


def _runs_clean(name: str, seconds: int) -> bool:
    corpus = WORK / name / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    for data in kept(name):
        (corpus / hashlib.sha1(data, usedforsecurity=False).hexdigest()).write_bytes(data)
    return _libfuzzer(name, str(corpus), f"-max_total_time={seconds}", "-print_final_stats=1") == 0


def _keep(name: str) -> None:
    """Write the fewest inputs that reach everything into the archive."""
    corpus, least = WORK / name / "corpus", WORK / name / "least"
    shutil.rmtree(least, ignore_errors=True)
    least.mkdir()
    if _libfuzzer(name, "-merge=1", str(least), str(corpus)) != 0:
        raise SystemExit(f"fuzz: the inputs of {name} could not be merged")
    CORPUS.mkdir(exist_ok=True)
    with zipfile.ZipFile(CORPUS / f"{name}.zip", "w", zipfile.ZIP_DEFLATED) as files:
        for path in sorted(least.iterdir()):
            files.writestr(zipfile.ZipInfo(path.name), path.read_bytes())


def _libfuzzer(name: str, *words: str) -> int:
    command = [sys.executable, "-m", "tests.fuzz.fuzz", name, "--here", *words]
    return subprocess.run(command, check=False).returncode


def _fuzz(name: str, words: list[str]) -> None:
    """Fuzz one target in this process, which libFuzzer ends."""
    import atheris

    for plain in PLAIN.get(name, ()):
        import_module(plain)
    with atheris.instrument_imports(include=PACKAGES[name], enable_loader_override=False):
        from tests.fuzz.targets import SET_UPS, seeds
    corpus = WORK / name / "corpus"
    if not any(corpus.iterdir()):
        for k, seed in enumerate(seeds(name)):
            (corpus / f"seed-{k}").write_bytes(seed)
    with ExitStack() as stack:
        attempt = SET_UPS[name](stack)
        limits = [f"-max_len={LONGEST}", f"-timeout={SLOWEST}", "-rss_limit_mb=2048"]
        # libFuzzer starts itself again by its first word to merge.
        again = f"{sys.executable} -m tests.fuzz.fuzz {name} --here"
        atheris.Setup([again, *words, f"-artifact_prefix={WORK / name}/", *limits], attempt)
        atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main())
