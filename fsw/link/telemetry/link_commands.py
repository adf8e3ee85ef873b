"""Commands to the link itself: how often messages are sent, "send me this one now", its services.

They are answered here and do not reach the tick, because each link keeps its own rates.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from fsw.autopilot.signals import (
    CommandRequest,
    CommandResult,
    FlightSnapshot,
    Severity,
    StatusText,
)
from fsw.link.services.service import LinkService
from fsw.link.telemetry.stream_rates import OFF, UNKNOWN, StreamRates
from fsw.link.telemetry.streams import messages_now
from fsw.link.wire import decode
from fsw.link.wire.encode_standard import command_ack
from fsw.link.wire.outgoing import Outgoing, ServiceOutput, TelemetryContext
from messages import message_ids
from messages.frames import Frame

_GET_MESSAGE_INTERVAL: Final = 510  # MAV_CMD
_SET_MESSAGE_INTERVAL: Final = 511
_REQUEST_MESSAGE: Final = 512
# MAV_CMD: the message it asks for, and whether its param1 must be 1.
_REQUESTS: Final = {
    410: (message_ids.HOME_POSITION, False),  # GET_HOME_POSITION
    519: (message_ids.PROTOCOL_VERSION, True),  # REQUEST_PROTOCOL_VERSION
    520: (message_ids.AUTOPILOT_VERSION, True),  # REQUEST_AUTOPILOT_CAPABILITIES
}
_DECODERS: Final = {
    message_ids.COMMAND_LONG: decode.command_long,
    message_ids.COMMAND_INT: decode.command_int,
}

_Outcome = tuple[int, str, Sequence[Outgoing]]  # MAV_RESULT, reason, what follows the ACK


class LinkCommands:
    """Serves one link."""

    def __init__(
        self, rates: StreamRates, context: TelemetryContext, services: Sequence[LinkService] = ()
    ) -> None:
        """Carry out what changes the rates, and let ``services`` carry out what is theirs."""
        self._rates = rates
        self._context = context
        self._commanded = {command: service for service in services for command in service.commands}

    def handle(
        self, frame: Frame, t_us: int, snapshot: FlightSnapshot | None, asker: object = None
    ) -> Sequence[ServiceOutput] | None:
        """Carry out a command to the link: what to send, with a text where it was refused.

        None if the frame is something else. The snapshot is the newest, None before the first tick;
        ``asker`` is the peer, whose wish for a rate is kept beside those of others.
        """
        decoder = _DECODERS.get(frame.message_id)
        if decoder is None or not decode.for_this_vehicle(frame):
            return None
        request = decoder(frame)
        outcome = self._carry_out(request, t_us, snapshot, asker)
        if outcome is None:
            return None
        result, reason, messages = outcome
        reply = Outgoing(message_ids.COMMAND_ACK, command_ack(request.answer(result)))
        texts = [StatusText(Severity.INFO, reason, prompt=True)] if reason else []
        return (reply, *messages, *texts)

    def _carry_out(
        self, request: CommandRequest, t_us: int, snapshot: FlightSnapshot | None, asker: object
    ) -> _Outcome | None:
        message_id, second = _whole(request.params[0]), request.params[1]
        if request.command == _GET_MESSAGE_INTERVAL:
            if message_id is None:
                return CommandResult.DENIED, "message interval: param1 is not a message id", ()
            values = (self._rates.interval_us(message_id), message_id & 0xFFFF)
            return CommandResult.ACCEPTED, "", (Outgoing(message_ids.MESSAGE_INTERVAL, values),)
        if request.command == _SET_MESSAGE_INTERVAL:
            return self._set_interval(message_id, _whole(second), t_us, asker)
        if request.command == _REQUEST_MESSAGE:
            if message_id is None:
                return CommandResult.DENIED, "request message: param1 is not a message id", ()
            return self._now(message_id, second, snapshot)
        service = self._commanded.get(request.command)
        if service is not None:
            armed = snapshot is not None and snapshot.armed
            return *service.carry_out(request, t_us, armed), ()
        if request.command in _REQUESTS:  # the older commands, each of which asks for one message
            wanted, param1_is_1 = _REQUESTS[request.command]
            if param1_is_1 and request.params[0] != 1.0:
                return (
                    CommandResult.DENIED,
                    f"command {request.command}: param1 must be 1 to request it",
                    (),
                )
            return self._now(wanted, math.nan, snapshot)
        return None

    def _set_interval(
        self, message_id: int | None, interval: int | None, t_us: int, asker: object
    ) -> _Outcome:
        if message_id is None or interval is None:
            return (
                CommandResult.DENIED,
                "message interval: param1 is a message id, param2 a time in us",
                (),
            )
        if self._rates.interval_us(message_id) == UNKNOWN:
            return CommandResult.FAILED, "", ()
        refusal = self._rates.set_interval(message_id, interval, t_us, asker)
        if refusal:
            return CommandResult.DENIED, refusal, ()
        in_force = self._rates.interval_us(message_id)
        if in_force != OFF and (interval == OFF or 0 < in_force < interval):
            why = "it is vital, or others on this link listen and have not asked for less"
            return (
                CommandResult.ACCEPTED,
                f"message {message_id} comes every {in_force} us: {why}",
                (),
            )
        return CommandResult.ACCEPTED, "", ()

    def _now(self, message_id: int, which: float, snapshot: FlightSnapshot | None) -> _Outcome:
        if snapshot is None:
            return (
                CommandResult.TEMPORARILY_REJECTED,
                "the flight software has not run a tick yet",
                (),
            )
        messages = messages_now(message_id, which, snapshot, self._context)
        if messages is None:
            # No text: ground stations probe for cameras, gimbals and much else at every start.
            return CommandResult.DENIED, "", ()
        if not messages:
            return CommandResult.TEMPORARILY_REJECTED, f"message {message_id}: no data yet", ()
        return CommandResult.ACCEPTED, "", messages


def _whole(number: float) -> int | None:
    """A parameter as an integer of 32 bits; None for NaN, infinity and what is out of range."""
    return round(number) if abs(number) < 2**31 else None
