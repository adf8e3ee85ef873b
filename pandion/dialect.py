"""``pandion dialect``: teach other programs the private messages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from command_line.folders import data_folder, home
from command_line.options import option, read, switch
from command_line.output import print_error, unwritable
from command_line.parser import COULD_NOT_START
from command_line.values import one_of
from messages import export
from messages.generate import DEFINITION, GenerationError

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


@dataclass(frozen=True, slots=True, kw_only=True)
class DialectOptions:
    """What to install or print."""

    what: str = option(
        "WHAT",
        "install: for MAVProxy and pymavlink; wireshark: a plugin; xml: print the definition",
        one_of("target", "install", "wireshark", "xml"),
        required=True,
    )
    out: Path | None = option(
        "--out DIR", "write there (default a directory of the user's)", Path, old="--to"
    )
    path: bool = switch("--path", "with xml: print where the file is")


def main(argv: list[str]) -> int:
    """Install or print; returns the exit code."""
    what = "Install the private messages in other programs."
    options = read(DialectOptions, "pandion dialect", what, argv)
    if options.what == "xml":
        print(DEFINITION if options.path else DEFINITION.read_text(encoding="utf-8").rstrip())
        return 0
    install = {"install": _install, "wireshark": _wireshark}[options.what]
    try:
        print(install(options.out), end="")
    except (GenerationError, OSError) as error:
        print_error("pandion dialect", unwritable(error))
        return COULD_NOT_START
    return 0


def _install(wanted: Path | None) -> str:
    folder = (wanted or data_folder() / "pandion" / "message_definitions").absolute()
    export.write_definitions(folder)
    return _MAVPROXY.format(folder=folder)


def _wireshark(wanted: Path | None) -> str:
    folder = wanted or home() / ".local" / "lib" / "wireshark" / "plugins"
    path = folder.absolute() / "pandion.lua"
    export.write_wireshark_plugin(path)
    return _WIRESHARK.format(path=path)
