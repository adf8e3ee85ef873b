"""``pandion dialect``: teach other programs the private messages."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final

from messages import export
from messages.generate import DEFINITION, GenerationError
from pandion.parser import COULD_NOT_START, Parser

_MAVPROXY: Final = """\
definitions in {folder}
MAVProxy generates the dialect when it is asked for it the first time:
  MDEF={folder} mavproxy.py --dialect=pandion --master=udpin:127.0.0.1:14550
other programs that use pymavlink:
  MDEF={folder} MAVLINK_DIALECT=pandion MAVLINK20=1 python your_program.py
"""
_WIRESHARK: Final = """\
plugin in {path}
Wireshark and tshark load it when they start; messages are shown on UDP ports 14550, 14540 and 4560:
  tshark -i lo -f 'udp port 14550'
"""


def main(argv: list[str]) -> int:
    """Install or print; returns the exit code."""
    parser = Parser("pandion dialect", "Teach other programs the private messages.")
    parser.add_argument(
        "what",
        choices=("install", "wireshark", "xml"),
        help="install: for MAVProxy and pymavlink; wireshark: a plugin; xml: print the definition",
    )
    parser.add_argument(
        "--to", metavar="DIR", type=Path, help="write there (default a directory of the user's)"
    )
    parser.add_argument("--path", action="store_true", help="with xml: print where the file is")
    arguments = parser.read(argv)
    if arguments.what == "xml":
        print(DEFINITION if arguments.path else DEFINITION.read_text(encoding="utf-8").rstrip())
        return 0
    install = {"install": _install, "wireshark": _wireshark}[arguments.what]
    try:
        print(install(arguments.to), end="")
    except (GenerationError, OSError) as error:
        print(f"pandion dialect: {_reason(error)}", file=sys.stderr)
        return COULD_NOT_START
    return 0


def _install(wanted: Path | None) -> str:
    folder = (wanted or _data_home() / "pandion" / "message_definitions").absolute()
    export.write_definitions(folder)
    return _MAVPROXY.format(folder=folder)


def _wireshark(wanted: Path | None) -> str:
    folder = wanted or Path.home() / ".local" / "lib" / "wireshark" / "plugins"
    path = folder.absolute() / "pandion.lua"
    export.write_wireshark_plugin(path)
    return _WIRESHARK.format(path=path)


def _data_home() -> Path:
    return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share")


def _reason(error: Exception) -> str:
    if isinstance(error, OSError):
        return f"cannot write {error.filename}: {error.strerror}"
    return str(error)
