"""Commands as a ground station sends them, as the link reads and the flight software takes them."""

from __future__ import annotations

import math
from functools import partial

from fsw.autopilot.flight.commands.handlers import Decision, decide
from fsw.autopilot.flight.modes import MODES
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.geometry.geodesy import DEFAULT_ORIGIN, to_local
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import Command, CommandRequest, Origin
from fsw.link.wire.decode_commands import command as read_command

NAN = math.nan
CONFIG = flight_config(body="points")
FLIGHT_MODES = {mode: kind(CONFIG) for mode, kind in MODES.items()}


def command(
    number: int, *params: float, frame: int | None = None, origin: Origin = DEFAULT_ORIGIN
) -> Command:
    """A command whose unused parameters are NaN, as MAVLink demands."""
    p = (*params, *[NAN] * (7 - len(params)))
    values = (p[0], p[1], p[2], p[3], p[4], p[5], p[6])
    request = CommandRequest(number, values, 255, 190, frame=frame)
    return read_command(request, partial(to_local, origin))


def ask(context: Situation, number: int, *params: float) -> Decision:
    """What the vehicle decides on a COMMAND_LONG."""
    return decide(command(number, *params), context, FLIGHT_MODES)
