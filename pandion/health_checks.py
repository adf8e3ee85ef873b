"""What ``pandion doctor`` looks at: a function a thing, each returns what it found."""

from __future__ import annotations

import ctypes
import os
import platform
import re
import shutil
import socket
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.output import EXTRAS
from fsw.autopilot.parameters.control_choice import ControlChoice
from pandion.own_modules import our_modules

OK, WARN, FAIL = "ok", "warn", "fail"

_GB: Final = 1e9
_MIN_FREE: Final = 200e6  # bytes: a flight of two minutes with LOG_PROFILE 1, and its telemetry
_FEW_FREE: Final = 2e9
_MEMORY: Final = 1.5e9  # bytes that both processes and the compiler take
_LATE_US: Final = 500.0  # a quarter of a tick
_NAPS, _NAP_S = 60, 0.002
_SLOW_CLOCKS: Final = ("hpet", "acpi_pm", "jiffies")
_CLOCK_ERROR: Final = 5  # TIME_ERROR of adjtimex(2): nothing disciplines the clock
_YEAR: Final = 2026  # of the first release
_OTHER_PORT: Final = "another vehicle flies: yours takes any free port instead, and says which"
_PORTS: Final = (  # number, who binds it, and what to do where it is taken
    (4560, "pandion sitl", "give --listen another port; pandion fly does not need it"),
    (14580, "the vehicle, for programs", _OTHER_PORT),
    (18570, "the vehicle, for ground stations", _OTHER_PORT),
)
_REQUIREMENT: Final = re.compile(r"([\w.-]+)\s*>=\s*([\d.]+)$")
# In a process of its own, because what it asks for changes the process.
_CLAIM: Final = (
    "from fsw.runtime.process import TICK_PRIORITY, claim_real_time\n"
    "print(*claim_real_time(TICK_PRIORITY), sep='\\n')"
)


@dataclass(frozen=True, slots=True)
class Check:
    """One thing, in the state in which it was found."""

    name: str
    state: str  # OK, WARN: flies all the same, FAIL: does not fly
    found: str
    remedy: str = ""  # what to do; empty where there is nothing to do


def all_checks(out: Path) -> list[Check]:
    """Everything, in the order in which it is printed; flights go to ``out``."""
    return [
        machine(),
        memory(),
        real_time(),
        timer(),
        clock(),
        versions(),
        extras(),
        modules(),
        code(),
        output(),
        home(),
        compile_cache(),
        *(port(*row) for row in _PORTS),
        disk(out),
    ]


def machine() -> Check:
    """System, Python and processors."""
    version, cores = sys.version_info[:3], len(os.sched_getaffinity(0))
    load = os.getloadavg()[0]
    found = (
        f"{platform.system()} {platform.machine()}, Python {'.'.join(map(str, version))}, "
        f"{cores} processor{'s' * (cores != 1)}, load {load:.1f}"
    )
    if not (3, 11) <= version[:2] <= (3, 13):
        return Check("machine", FAIL, found, "use Python 3.11, 3.12 or 3.13")
    if cores < 2:
        return Check("machine", WARN, found, "real time needs two processors: one for the planner")
    if load > 0.75 * cores:
        return Check("machine", WARN, found, "end other programs before a flight in real time")
    return Check("machine", OK, found)


def memory() -> Check:
    """What the system can still hand out."""
    text = Path("/proc/meminfo").read_text(encoding="ascii")
    match = re.search(r"^MemAvailable:\s+(\d+) kB", text, re.M)
    free = 1024.0 * int(match[1]) if match else 0.0
    found = f"{free / _GB:.1f} GB available"
    if free < _MEMORY:
        return Check(
            "memory", WARN, found, f"free {_MEMORY / _GB:.1f} GB: the kernels compile in it"
        )
    return Check("memory", OK, found)


def real_time() -> Check:
    """Whether the system grants what ``--realtime`` asks for."""
    done = subprocess.run(
        [sys.executable, "-c", _CLAIM], capture_output=True, text=True, check=False, timeout=60.0
    )
    refused = done.stdout.split("\n")[:-1] if done.returncode == 0 else ["the question"]
    refused = [what for what in refused if what]
    if not refused:
        return Check("real time", OK, "SCHED_FIFO and locked memory are granted")
    remedy = "allow rtprio 50 and memlock unlimited in limits.conf; lockstep needs neither"
    return Check("real time", WARN, f"refused: {', '.join(refused)}", remedy)


def timer() -> Check:
    """How late an ordinary process is woken."""
    late = []
    for _ in range(_NAPS):
        due = time.monotonic() + _NAP_S
        time.sleep(_NAP_S)
        late.append(1e6 * (time.monotonic() - due))
    late.sort()
    found = f"woken {late[_NAPS // 2]:.0f} us late (median), {late[-1]:.0f} us at worst"
    if late[_NAPS // 2] > _LATE_US:
        return Check("timer", WARN, found, "flights in real time will miss ticks: use lockstep")
    return Check("timer", OK, found)


def clock() -> Check:
    """The wall clock, which dates telemetry logs and signed frames, and what it counts on."""
    source_file = Path("/sys/devices/system/clocksource/clocksource0/current_clocksource")
    source = source_file.read_text("ascii").strip() if source_file.exists() else "unknown"
    found = f"{time.strftime('%Y-%m-%d %H:%M:%S', time.gmtime())} UTC, source {source}"
    if time.gmtime().tm_year < _YEAR:
        return Check("clock", WARN, found, "set the clock: signed frames of the past are refused")
    if source in _SLOW_CLOCKS:
        return Check("clock", WARN, found, "boot with clocksource=tsc: reading this one takes long")
    if ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(512)) == _CLOCK_ERROR:
        return Check("clock", OK, f"{found}, not synchronised (nothing here needs it)")
    return Check("clock", OK, f"{found}, synchronised")


def versions() -> Check:
    """What is installed, against what the distribution needs."""
    from importlib import metadata

    from command_line.version import version

    try:
        needed = metadata.requires("pandion") or []
    except metadata.PackageNotFoundError:
        return Check("versions", WARN, "pandion is not installed", "run make setup")
    pairs = [match.groups() for text in needed if (match := _REQUIREMENT.match(text))]
    missing = [f"{name} >= {least}" for name, least in pairs if not _has(name, least)]
    if missing:
        return Check("versions", FAIL, f"missing: {', '.join(missing)}", "run make setup")
    shown = ", ".join(f"{name} {metadata.version(name)}" for name, _ in pairs)
    return Check("versions", OK, f"pandion {version()}, {shown}")


def _has(name: str, least: str) -> bool:
    from importlib import metadata

    try:
        return _numbers(metadata.version(name)) >= _numbers(least)
    except metadata.PackageNotFoundError:
        return False


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version.partition("+")[0])[:3])


def extras() -> Check:
    """Packages that only some verbs need."""
    from importlib.util import find_spec

    lacking = [name for name in EXTRAS if find_spec(name) is None]
    missing = sorted({EXTRAS[name] for name in lacking})
    if not missing:
        known = ", ".join(sorted(set(EXTRAS.values())))
        return Check("extras", OK, f"{known} can be used")
    remedy = f"pip install {' '.join(lacking)} where they are wanted"
    return Check("extras", OK, f"not installed: {', '.join(missing)}", remedy)


def modules() -> Check:
    """Whether our own modules are found, and those of this environment."""
    from importlib.util import find_spec

    root = str(our_modules())
    others = {str(_found(name)) for name in ("fsw", "sitl", "messages", "view")} - {root}
    if others:
        found = f"modules come from {', '.join(sorted(others))} as well as from {root}"
        return Check("modules", FAIL, found, "take what is not Pandion's out of PYTHONPATH")
    beside = Path(sys.prefix).parent
    brought = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    if (
        (beside / "pandion" / "fly.py").is_file()
        and not beside.samefile(root)
        and root not in brought
    ):
        return Check(
            "modules", WARN, f"{beside} runs the code of {root}", f"make setup in {beside}"
        )
    numpy = find_spec("numpy")
    if numpy is None or numpy.origin is None or not numpy.origin.startswith(sys.prefix):
        return Check(
            "modules",
            WARN,
            f"NumPy is not this environment's: {numpy and numpy.origin}",
            "unset PYTHONPATH, or run make setup",
        )
    return Check("modules", OK, f"Pandion from {root}, packages from {sys.prefix}")


def _found(name: str) -> Path | None:
    from importlib.util import find_spec

    spec = find_spec(name)
    return None if spec is None or spec.origin is None else Path(spec.origin).parents[1]


def code() -> Check:
    """Which code flies, as flight logs say it."""
    from command_line.revision import revision

    known = revision()
    if "unknown" in known:
        return Check("code", WARN, known, "flight logs will not say which commit flew")
    return Check("code", OK, known)


def output() -> Check:
    """Whether the terminal shows every character."""
    encoding = (sys.stdout.encoding or "unknown").lower()
    if encoding in ("utf-8", "utf8"):
        return Check("output", OK, "UTF-8")
    return Check("output", OK, f"{encoding}: signs that it does not know are shown in ASCII")


def home() -> Check:
    """Where keys of signed links are kept."""
    from command_line.folders import NoHomeError, state_folder

    try:
        folder = state_folder()
    except NoHomeError as error:
        return Check("home", WARN, str(error), "signed links need it, or --keys; flights do not")
    nearest = next(one for one in (folder, *folder.parents) if one.exists())
    if not os.access(nearest, os.W_OK):
        return Check("home", WARN, f"{nearest} cannot be written", "signed links need --keys DIR")
    return Check("home", OK, f"keys of signed links in {folder}")


def compile_cache() -> Check:
    """Whether the kernels are on disk, or the next flight compiles them first."""
    from fsw import compiled as fsw
    from sitl import compiled as sitl

    caches = fsw.cache(), sitl.cache()
    folders = [cache.folder.parent for cache in caches if cache.folder is not None]
    if len(folders) < len(caches):
        remedy = "set NUMBA_CACHE_DIR to a folder that can be written"
        found = "nowhere can kernels be kept: every flight compiles for a minute"
        return Check("compile cache", WARN, found, remedy)
    where = f"in {' and '.join(map(str, dict.fromkeys(folders)))}"
    if caches[0].is_due(ControlChoice().kernels) or caches[1].is_due("flight"):
        number = sum(cache.kernels for cache in caches)
        return Check("compile cache", OK, f"the first flight compiles {number} kernels, {where}")
    return Check("compile cache", OK, f"the kernels are compiled, {where}")


def port(number: int, whose: str, remedy: str) -> Check:
    """Whether a UDP port of this machine can still be bound."""
    name = f"port {number}"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("127.0.0.1", number))
        except OSError:
            return Check(name, WARN, f"taken ({whose})", remedy)
    return Check(name, OK, f"free ({whose})")


def disk(out: Path) -> Check:
    """Room for logs, and whether they can be written."""
    folder = out.absolute()
    while not folder.is_dir():
        folder = folder.parent
    free = shutil.disk_usage(folder).free
    found = f"{free / _GB:.1f} GB free for {out}"
    if not os.access(folder, os.W_OK):
        return Check("disk", FAIL, f"{folder} cannot be written", "name another folder with --out")
    if free < _MIN_FREE:
        return Check("disk", FAIL, found, "make room: a minute of flight takes 11 to 23 MB")
    if free < _FEW_FREE:
        return Check("disk", WARN, found, "a minute of flight takes 11 to 23 MB")
    return Check("disk", OK, found)
