"""Both processes of a flight that is measured, with the words that every measurement gives them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pandion.display import Display
from pandion.processor import ANYWHERE, Places
from pandion.supervisor import Flown, ProcessFailed, Supervisor


def fly(
    display: Display,
    out: Path,
    sitl: list[str],
    fsw: list[str],
    places: Places = ANYWHERE,
    runner: str | None = None,
) -> Flown:
    """Fly with what is particular to the command lines of ``sitl`` and ``fsw``, into ``out``.

    Raises:
        ProcessFailed: There was no flight.
    """
    both = ["--wait=600", f"--out={out}"]  # s; the other may have to compile first
    return Supervisor(display, out, places, runner).run(
        [*sitl, "--listen=udp:127.0.0.1:0", *both],
        lambda port: [f"--sim=udp:127.0.0.1:{port}", *fsw, *both],
    )


def figures(flown: Flown) -> dict[str, Any]:
    """What the flight software measured of itself.

    Raises:
        ProcessFailed: It ended before it could say so.
    """
    if flown.fsw is None:
        raise ProcessFailed(flown.failure or "the flight left no figures")
    return flown.fsw
