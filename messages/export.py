"""The dialect for other programs: its definitions in one folder, a plugin for Wireshark."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Final

from messages.generate import DEFINITION, generate, pymavlink_definitions

# Beside those that mavgen's plugin listens to (14550, 14580, 18570): where programs that use
# an SDK listen, and the simulator's.
WIRESHARK_PORTS: Final = (14540, 4560)

_INCLUDE = re.compile(r"<include>(.+?)</include>")


def definitions() -> tuple[Path, ...]:
    """The dialect's XML and, behind it, every definition that it includes."""
    found = [DEFINITION]
    for path in found:
        for name in _INCLUDE.findall(path.read_text(encoding="utf-8")):
            included = pymavlink_definitions() / name
            if included not in found:
                found.append(included)
    return tuple(found)


def write_definitions(folder: Path) -> None:
    """Copy the definitions to where pymavlink looks for them if MDEF names ``folder``.

    Raises:
        OSError: The folder cannot be written.
    """
    place = folder / "v1.0"  # for MAVLink 2 as well
    place.mkdir(parents=True, exist_ok=True)
    for path in definitions():
        shutil.copyfile(path, place / path.name)


def write_wireshark_plugin(path: Path) -> None:
    """Write the dissector, in Lua.

    Raises:
        OSError: The file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    generate(destination=path, language="WLua")
    with path.open("a", encoding="utf-8") as plugin:
        for port in WIRESHARK_PORTS:
            plugin.write(f'DissectorTable.get("udp.port"):add({port}, mavlink_proto)\n')
