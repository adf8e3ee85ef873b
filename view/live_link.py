"""A peer of a running vehicle: listens, and asks for what a person at the page wants."""

from __future__ import annotations

import select
import threading
import time
from collections.abc import Callable
from typing import Any, Final, TypeVar

from fsw.autopilot.flight.commands.bounds import zone_problem
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.signals import Vec3, Zone
from fsw.link.endpoints import open_endpoint
from fsw.link.wire import decode
from fsw.link.wire.zone_transfer import shape_values
from messages import message_ids as ids
from messages.addresses import LinkAddress, address_text
from messages.frames import FrameWriter, Losses
from view.flight_events import command_name, result_name
from view.scene import Scene
from view.telemetry import HORIZON_JOINTS, Telemetry, first_line

Answer = TypeVar("Answer")

SYSTEM, COMPONENT = 253, 190  # of no other station in use; MAV_COMP_ID_MISSIONPLANNER
_LOOKS, _COMMANDS = 18, 6  # MAV_TYPE: an onboard controller, a ground station
_NO_AUTOPILOT, _ACTIVE, _VERSION = 8, 4, 3
_BEAT_S: Final = 1.0
_SETPOINT_S: Final = 0.05
_ANSWER_S: Final = 0.7
_REASON_S: Final = 0.15  # the text with the reason follows the answer
_TRIES: Final = 3
_ACCEPTED, _IN_PROGRESS = 0, 5
_POSITION_ONLY: Final = 0x0DF8  # type mask: position, no heading
_LOCAL_NED: Final = 1
_CLEARANCE: Final = 0.1  # m, of a ball
_HEAR_S: Final = 0.01  # at a time
_PLAN_US: Final = 200_000.0  # between two plans
_SET_INTERVAL, _REQUEST_MESSAGE = 511, 512
_ASK_S: Final = 2.0  # between two requests of what is not sent by itself

ARM, TAKE_OFF, LAND, RETURN, HOLD, SET_MODE = 400, 22, 21, 20, 17, 176  # MAV_CMD
TRAJECTORY: Final = (1.0, 4.0, 11.0)
OFFBOARD: Final = (1.0, 6.0, 0.0)


class VehicleLink(threading.Thread):
    """Speaks to one vehicle until it is closed. A vehicle that is not there yet may come."""

    def __init__(self, vehicle: LinkAddress, airframe: Airframe, *, commands: bool) -> None:
        """Open a link of its own towards ``vehicle``; without ``commands`` it only looks.

        One that only looks is no ground station to the vehicle: it must not hide that the link to
        the one that commands is lost. The vehicle is such an ``airframe``: telemetry does not say.
        """
        super().__init__(daemon=True)
        self.commands = commands
        self.watched = False  # whether a person sees the page
        self.where = address_text(vehicle)
        self.airframe = airframe
        self._telemetry = Telemetry(airframe)
        self._writer = FrameWriter(SYSTEM, COMPONENT)
        self._heard = threading.Condition()
        self._setpoint: Vec3 | None = None
        self._ended = False
        self._endpoint, self._peer = open_endpoint(vehicle, lambda: time.monotonic_ns() // 1000)
        self._losses = Losses()

    def close(self) -> None:
        """Hang up."""
        self._ended = True
        self.join()
        self._endpoint.close()

    def scene(self) -> Scene:
        """What is known now."""
        return self.read(lambda telemetry: telemetry.scene(time.monotonic()))

    def read(self, how: Callable[[Telemetry], Answer]) -> Answer:
        """Look at the telemetry while nothing new is taken in."""
        with self._heard:
            return how(self._telemetry)

    def run(self) -> None:
        """See :class:`VehicleLink`."""
        beat_s = setpoint_s = asked_s = -1e9
        while not self._ended:
            select.select((self._endpoint,), (), (), 0.02)
            try:
                self._hear()
                now_s = time.monotonic()
                if now_s - beat_s >= _BEAT_S:
                    beat_s = now_s
                    self._beat()
                if now_s - asked_s >= _ASK_S:
                    asked_s = now_s
                    self._ask_for_more()
                if self._setpoint is not None and now_s - setpoint_s >= _SETPOINT_S:
                    setpoint_s = now_s
                    self._send_setpoint(self._setpoint)
            except Exception as error:  # what was asked for may fit no message
                with self._heard:
                    self._telemetry.tell("link", f"not sent: {first_line(error)}")

    def ask(self, command: int, params: tuple[float, ...] = ()) -> tuple[bool, str]:
        """Send a command until it is answered: whether it was accepted, and a sentence.

        ``params`` are its parameters [the command's units]; what is left out is NaN or 0.
        """
        name = command_name(command)
        with self._heard:
            telemetry = self._telemetry
            telemetry.answers.clear()
            telemetry.refusals.clear()
            for confirmation in range(_TRIES):
                self._command(command, params, confirmation)
                self._heard.wait_for(lambda: self._answer(command) is not None, _ANSWER_S)
                result = self._answer(command)
                if result is None:
                    continue
                if result in (_ACCEPTED, _IN_PROGRESS):
                    return True, f"{name}: {result_name(result)}"
                self._heard.wait_for(lambda: bool(telemetry.refusals), _REASON_S)
                reason = "; ".join(telemetry.refusals) or "no reason was given"
                return False, f"{name} {result_name(result)}: {reason}"
        return False, f"{name}: no answer from {self.where}"

    def aim(self, target: Vec3 | None) -> None:
        """Send ``target`` [m, NED] of the end-effector as setpoint from now on; None: no more."""
        self._setpoint = target

    def announce(self, centre: Vec3, radius: float) -> str | None:
        """Announce the safe set and a ball about ``centre`` [m, NED] of ``radius`` [m].

        The vehicle is asked for the set first, because what is announced replaces it. Returns why
        nothing was announced, None if it was.
        """
        new = Zone(ball(centre, radius), _CLEARANCE)
        problem = zone_problem(new)
        known = self._announced() if problem is None else problem
        if isinstance(known, str):
            return f"no obstacle: {known}"
        for values in shape_values((*known, new), ids.SYSTEM_ID):
            self._send(ids.OBSTACLE_SHAPE, *values)
        return None

    def _announced(self) -> tuple[Zone, ...] | str:
        """The zones that were announced to the vehicle, as it says now; else why not."""
        with self._heard:
            telemetry, asked_s = self._telemetry, time.monotonic()
            before, telemetry.set_problem = telemetry.whole_sets, ""

            def answered() -> bool:
                return telemetry.whole_sets > before or bool(telemetry.set_problem)

            for _ in range(_TRIES):
                self._command(_REQUEST_MESSAGE, (ids.MISSION_CURRENT,))
                self._command(_REQUEST_MESSAGE, (ids.OBSTACLE_SHAPE,))
                if self._heard.wait_for(answered, _ANSWER_S):
                    try:
                        return telemetry.announced(asked_s)
                    except decode.RefusedError as error:
                        return str(error)
        return f"{self.where} does not say which safe set it keeps"

    def ask_for_parameters(self) -> None:
        """Ask for all of them."""
        self._send(ids.PARAM_REQUEST_LIST, 1, 1)

    def _answer(self, command: int) -> int | None:
        answers = [result for asked, result in self._telemetry.answers if asked == command]
        return answers[-1] if answers else None

    def _hear(self) -> None:
        """Take what has come, for a moment: a stream may never pause."""
        until_s = time.monotonic() + _HEAR_S
        while not self._ended and (received := self._endpoint.receive_waiting()) is not None:
            data, sender = received
            now_s = time.monotonic()
            if sender == self._peer:
                with self._heard:
                    for frame, _ in self._endpoint.cut(data, self._losses):
                        self._telemetry.take(frame, now_s)
                    self._heard.notify_all()
            if now_s >= until_s:
                return

    def _ask_for_more(self) -> None:
        """Ask for what is not sent by itself."""
        self._command(_SET_INTERVAL, (ids.MPC_HORIZON, _PLAN_US))
        if self.airframe.bodies.joints > HORIZON_JOINTS:
            self._command(_SET_INTERVAL, (ids.MPC_HORIZON_ARM, _PLAN_US))
        self._command(_REQUEST_MESSAGE, (ids.OBSTACLE_SHAPE,))

    def _beat(self) -> None:
        kind = _COMMANDS if self.commands and self.watched else _LOOKS
        self._send(ids.HEARTBEAT, 0, kind, _NO_AUTOPILOT, 0, _ACTIVE, _VERSION)

    def _command(self, command: int, params: tuple[float, ...], confirmation: int = 0) -> None:
        filled = (*params, *(0.0 for _ in range(7 - len(params))))
        self._send(ids.COMMAND_LONG, *filled, command, 1, 1, confirmation)

    def _send_setpoint(self, p: Vec3) -> None:
        still = (0.0,) * 6
        mask = _POSITION_ONLY
        self._send(ids.END_EFFECTOR_TARGET, 0, *p, *still, 0.0, 0.0, mask, 1, 0, _LOCAL_NED, 0.0)

    def _send(self, message_id: int, *values: Any) -> None:
        self._endpoint.send(self._writer.frame(message_id, *values), self._peer)
