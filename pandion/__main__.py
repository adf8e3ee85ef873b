"""Entry point: ``pandion VERB …``. Imports are inside the verbs so that help answers at once."""

from __future__ import annotations

import errno
import os
import signal
import sys
from importlib import import_module
from typing import Final

from pandion.own_modules import put_first

put_first()

from command_line.output import EXTRAS, print_anything, print_error, without  # noqa: E402
from command_line.parser import COULD_NOT_START, unknown_name  # noqa: E402
from fsw.runtime.process import pin_numerics_to_one_thread  # noqa: E402

# Module, and what the verb does, by what it is for.
GROUPS: Final[dict[str, dict[str, tuple[str, str]]]] = {
    "fly": {
        "fly": (
            "pandion.fly_verb",
            "fly a scenario with both processes, print the result",
        ),
        "sitl": ("sitl.__main__", "run the simulator alone"),
        "fsw": ("pandion.flight_software", "run the flight software alone"),
        "param": (
            "pandion.param",
            "list, set, import and export parameters of a vehicle or a file",
        ),
        "vehicle": ("pandion.vehicle", "list, show, check, import and export vehicles"),
        "px4": ("pandion.px4", "print what PX4 needs to fly the simulated vehicle"),
    },
    "look": {
        "view": ("pandion.view", "show a flight in the browser, from its log or live"),
        "report": ("pandion.report", "write one or several flights as a self-contained HTML page"),
        "top": ("pandion.top", "inspect a running vehicle in the terminal: rates, fields, margins"),
        "replay": (
            "pandion.replay",
            "feed a flight log through the flight software again, compare",
        ),
        "export": ("pandion.export", "write a flight log as CSV or MCAP, or layouts that show it"),
    },
    "study": {
        "campaign": ("pandion.campaign", "fly many flights from one file, here or on a cluster"),
        "certify": (
            "pandion.certify",
            "state what a campaign shows, with exact bounds; or verify it",
        ),
        "compare": ("pandion.compare", "compare two campaigns: plans, margins, violations"),
        "falsify": (
            "pandion.falsify",
            "search for the disturbance that pushes furthest off the plan",
        ),
        "splitting": ("pandion.splitting", "estimate how rare a small margin is"),
        "tune": ("pandion.tune", "improve parameters on some flights, judge them on others"),
        "search": (
            "pandion.search",
            "search for a scenario that decides between controllers",
        ),
        "faults": ("pandion.faults", "let something fail in flight, compare with what must happen"),
        "reproduce": ("pandion.reproduce", "fly a table or a figure of the paper again"),
    },
    "tools": {
        "doctor": ("pandion.doctor", "check this machine and this set-up"),
        "dialect": ("pandion.dialect", "teach MAVProxy, Wireshark and others the private messages"),
        "completion": ("pandion.completion", "print what lets a shell complete verbs and options"),
    },
}
VERBS: Final = {name: verb for group in GROUPS.values() for name, verb in group.items()}


def _listed() -> str:
    """The verbs by groups."""
    return "\n".join(
        f"{title}:\n" + "\n".join(f"  {name:11} {what}" for name, (_, what) in verbs.items())
        for title, verbs in GROUPS.items()
    )


HELP: Final = f"""\
usage: pandion VERB [options]

Flight software for aerial manipulators, with a simulator, over MAVLink.

{_listed()}

options:
  --version   print the version
  -h, --help  print this; `pandion VERB --help` prints the options of a verb

examples:
  pandion fly walls
  pandion fly workspace-calm --realtime --duration 20
  pandion sitl walls --listen udp:127.0.0.1:4560
  pandion fsw --sim udp:127.0.0.1:4560 --gcs udp:127.0.0.1:14550
  pandion replay runs/walls-seed0-1 --verify
  pandion reproduce table4 --plant double-integrator --seeds 100:120
"""

_INTERRUPTED: Final = 1  # exit code


def main(argv: list[str] | None = None) -> int:
    """Run one verb; returns the exit code."""
    try:
        try:
            return _run(sys.argv[1:] if argv is None else argv)
        finally:
            sys.stdout.flush()  # here, where a reader that has left or a full disk has its answer
    except BrokenPipeError:
        _silence_stdout()  # the reader of the output has left
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        print_error("pandion", without(error, EXTRAS[error.name]))
        return COULD_NOT_START
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        _silence_stdout()
        print_error("pandion", f"cannot write {error.filename or 'output'}: disk full")
    except KeyboardInterrupt:
        print_error("pandion", "interrupted")
    return _INTERRUPTED


def _silence_stdout() -> None:
    """Nothing can be written to standard output, at exit neither."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run(words: list[str]) -> int:
    if "_ARGCOMPLETE" in os.environ:
        from pandion.completion import complete

        words = complete(VERBS)
    if words[:1] == ["help"] and len(words) > 1:
        words = [words[1], "--help"]
    if not words or words[0] in ("-h", "--help", "help"):
        print(HELP, end="")
        return 0
    if words[0] in ("--version", "-V", "version"):
        from command_line.version import version

        print(f"pandion {version()}")
        return 0
    name, *options = words
    if name not in VERBS:
        what = "option" if name.startswith("-") else "verb"
        known = ("--help", "--version") if what == "option" else VERBS
        print_error("pandion", unknown_name(what, name, known))
        return COULD_NOT_START
    module = VERBS[name][0]
    # Before NumPy loads, whose idle threads spin: a flight would find the processors busy.
    pin_numerics_to_one_thread()
    entry = import_module(module).main
    # The two processes have programs of their own, which call themselves by another name.
    return int(
        entry(options) if module.startswith("pandion") else entry(options, f"pandion {name}")
    )


def program() -> int:
    """``main`` as a program of its own, which a batch system ends as Ctrl-C does."""
    print_anything()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    return main()


if __name__ == "__main__":
    sys.exit(program())
