"""Entry point: ``pandion VERB …``. Imports are inside the verbs so that help answers at once."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from importlib import import_module
from typing import Final

from pandion.parser import COULD_NOT_START, Parser, unknown_name

HELP: Final = """\
usage: pandion VERB [options]

Flight software for aerial manipulators, with a simulator, over MAVLink.

verbs:
  fly         start the simulator and the flight software, fly a scenario, print the verdict
  sitl        run the simulator alone
  fsw         run the flight software alone
  reproduce   fly a table or a figure of the paper again
  param       list, set, import and export the parameters of a vehicle or a file
  dialect     teach MAVProxy, Wireshark and others the private messages
  replay      feed a flight log through the flight software again and compare
  export      write a flight log as CSV or MCAP

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


def main(argv: list[str] | None = None) -> int:
    """Run one verb; returns the exit code."""
    try:
        try:
            return _run(sys.argv[1:] if argv is None else argv)
        finally:
            sys.stdout.flush()  # here, where a reader that has left or a full disk has its answer
    except BrokenPipeError:
        _say_no_more()  # whoever read the output has left
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        _say_no_more()
        print(f"pandion: cannot write {error.filename or 'output'}: disk full", file=sys.stderr)
    except KeyboardInterrupt:
        print("pandion: interrupted", file=sys.stderr)
    return INTERRUPTED


def _say_no_more() -> None:
    """Nothing can be written to standard output, at exit neither."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help", "help"):
        print(HELP, end="")
        return 0
    if words[0] == "--version":
        from pandion.version import version

        print(f"pandion {version()}")
        return 0
    verb = VERBS.get(words[0])
    if verb is None:
        what = "option" if words[0].startswith("-") else "verb"
        known = ("--help", "--version") if what == "option" else VERBS
        print(f"pandion: {unknown_name(what, words[0], known)}", file=sys.stderr)
        return COULD_NOT_START
    return verb(words[1:])


def _verb(module: str) -> Callable[[list[str]], int]:
    return lambda argv: int(import_module(f"pandion.{module}").main(argv))


def _sitl(argv: list[str]) -> int:
    from sitl import __main__ as entry
    from sitl import arguments

    parser = Parser("pandion sitl", "Run the simulator alone.")
    arguments.add_arguments(parser)
    return entry.run(arguments.options(parser.read(argv)))


def _fsw(argv: list[str]) -> int:
    from fsw import __main__ as entry
    from fsw import arguments

    parser = Parser("pandion fsw", "Run the flight software alone.")
    arguments.add_arguments(parser)
    return entry.run(arguments.options(parser.read(argv)))


INTERRUPTED: Final = 1  # exit code
VERBS: Final[dict[str, Callable[[list[str]], int]]] = {
    "fly": _verb("fly"),
    "sitl": _sitl,
    "fsw": _fsw,
    "reproduce": _verb("reproduce"),
    "bench": _verb("moved_bench"),
    "param": _verb("param"),
    "dialect": _verb("dialect"),
    "replay": _verb("replay"),
    "export": _verb("export"),
}

if __name__ == "__main__":
    sys.exit(main())
