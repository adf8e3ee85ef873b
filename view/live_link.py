"""A peer of a running vehicle: listens, and asks for what a person at the page wants."""

from __future__ import annotations

import math
import select
import threading
import time
from collections.abc import Callable
from typing import Any, Final, TypeVar

from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import SafeSet, Vec3
from fsw.link.endpoints import open_endpoint
from messages import message_ids as ids
from messages.addresses import LinkAddress, address_text
from messages.frames import FrameWriter, Losses
from view.scene import Scene
from view.telemetry import Telemetry, command_name, result_name

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
_SHAPE_NUMBERS = 16
_NOT_TOUCHED = (0.0,) * 5  # what OBSTACLE_SHAPE says of contact
_BALL: Final = 1  # PANDION_SHAPE
_NAN: Final = math.nan
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
            self._hear()
            now_s = time.monotonic()
            if now_s - beat_s >= _BEAT_S:
                beat_s = now_s
                self._beat()
            if now_s - asked_s >= _ASK_S:
                asked_s = now_s
                self._command(_SET_INTERVAL, (ids.MPC_HORIZON, _PLAN_US))
                self._command(_REQUEST_MESSAGE, (ids.OBSTACLE_SHAPE,))
            if self._setpoint is not None and now_s - setpoint_s >= _SETPOINT_S:
                setpoint_s = now_s
                self._send_setpoint(self._setpoint)

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
        from fsw.autopilot.shapes import kind_of

        safe_set = self._whole_set()
        if safe_set is None:
            return f"no obstacle: {self.where} does not say which safe set it keeps"
        known = safe_set.zones
        if any(any(zone.velocity) for zone in known):
            return "no obstacle: zones move, and who announces them would take it away again"
        count = len(known) + 1
        for index, zone in enumerate(known):
            numbers = zone.shape.numbers
            self._shape(
                index, count, kind_of(zone.shape).number, numbers, zone.clearance,
                keep_in=zone.keep_in, velocity=zone.velocity, t_us=zone.t_us,
            )  # fmt: skip
        self._shape(len(known), count, _BALL, (*centre, radius), 0.1)
        return None

    def _whole_set(self) -> SafeSet | None:
        """The safe set as the vehicle keeps it now; None if it does not answer."""
        with self._heard:
            telemetry = self._telemetry
            before = telemetry.whole_sets
            for _ in range(_TRIES):
                self._command(_REQUEST_MESSAGE, (ids.OBSTACLE_SHAPE,))
                if self._heard.wait_for(lambda: telemetry.whole_sets > before, _ANSWER_S):
                    return telemetry.scene(time.monotonic()).safe_set
        return None

    def ask_for_parameters(self) -> None:
        """Ask for all of them."""
        self._send(ids.PARAM_REQUEST_LIST, 1, 1)

    def _answer(self, command: int) -> int | None:
        answers = [result for asked, result in self._telemetry.answers if asked == command]
        return answers[-1] if answers else None

    def _hear(self) -> None:
        while (received := self._endpoint.receive_waiting()) is not None:
            data, sender = received
            if sender != self._peer:
                continue
            with self._heard:
                now_s = time.monotonic()
                for frame, _ in self._endpoint.cut(data, self._losses):
                    self._telemetry.take(frame, now_s)
                self._heard.notify_all()

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

    def _shape(
        self,
        index: int,
        count: int,
        kind: int,
        numbers: tuple[float, ...],
        clearance: float,
        *,
        keep_in: bool = False,
        velocity: Vec3 = (0.0, 0.0, 0.0),
        t_us: int = 0,
    ) -> None:
        filled = (*numbers, *(0.0 for _ in range(_SHAPE_NUMBERS - len(numbers))))
        place = (1, 0, index, count, kind, int(keep_in), *_NOT_TOUCHED)
        self._send(ids.OBSTACLE_SHAPE, t_us, clearance, *velocity, *filled, *place)

    def _send(self, message_id: int, *values: Any) -> None:
        self._endpoint.send(self._writer.frame(message_id, *values), self._peer)
