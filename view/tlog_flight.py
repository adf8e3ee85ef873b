"""A flight from the telemetry log of a ground station."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from command_line.bounded_file import read_bounded
from command_line.output import listed
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.rotors import rotor_names
from fsw.autopilot.signals import Vec3
from messages.frames import Frame
from messages.message_ids import ATTITUDE, LOCAL_POSITION_NED, SYSTEM_ID
from messages.tlog_reader import TlogFrames
from view.flight import Curve, Trail
from view.flight_data import UlogError
from view.scene import Event, Scene, Worst
from view.telemetry import RESTARTED_S, Telemetry
from view.vehicle import tilt, tip_of

Array = NDArray[Any]

_SCENE_S: Final = 0.04  # between two scenes that are kept
_MAX_BYTES: Final = 128 * 1024 * 1024  # an hour of a vehicle's telemetry has 40 MB
_MAX_SCENES: Final = 360_000
_MAX_EVENTS: Final = 5_000
_OF_VEHICLES: Final = frozenset({ATTITUDE, LOCAL_POSITION_NED})  # messages of no other component
_NAMED: Final = 10  # of a kind, in a sentence
_PAUSE_S: Final = 2.0  # after which the last scene is shown no longer
_BETWEEN_S: Final = 1.0  # from one flight to the next, as it is shown


class _Recording:
    """The scenes of a log, and what happened; a flight that follows another one comes after it.

    A vehicle's clock begins anew with each start. A second later than the last scene of one flight,
    the next one begins.
    """

    def __init__(self, path: Path, frames: TlogFrames, airframe: Airframe) -> None:
        self.telemetry = Telemetry(airframe)
        self.scenes: list[Scene] = []
        self.events: deque[Event] = deque(maxlen=_MAX_EVENTS)
        self._path = path
        self._frames = frames
        self._shift = 0.0  # s, from the vehicle's clock to the one that is shown
        self._restarts = 0
        self._begins: list[str] = []  # when the first of them are shown
        for at, frame in frames:
            self._take(frame, at)

    def _take(self, frame: Frame, at: float) -> None:
        telemetry, before = self.telemetry, self.telemetry.t
        telemetry.take(frame, at)
        if telemetry.t < before - RESTARTED_S and self.scenes:
            begin = self.scenes[-1].t + _BETWEEN_S
            self._shift = begin - telemetry.t
            self._restarts += 1
            if len(self._begins) < _NAMED:
                self._begins.append(f"{begin:.0f} s")
        while telemetry.events:
            event = telemetry.events.popleft()
            self.events.append(event._replace(t=event.t + self._shift))
        last = self.scenes[-1].t if self.scenes else -math.inf
        if telemetry.t + self._shift >= last + _SCENE_S:
            scene = telemetry.scene(at)
            if scene.estimate is not None or self.scenes:
                self.scenes.append(replace(scene, t=scene.t + self._shift))
            if len(self.scenes) > _MAX_SCENES:
                longest = _MAX_SCENES * _SCENE_S / 3600.0
                raise UlogError(f"{self._path} is too long: at most {longest:.0f} h can be shown")

    def remarks(self) -> tuple[str, ...]:
        """What of the log is shown otherwise than it stands there, a sentence each."""
        told = []
        if self._restarts:
            more = self._restarts - len(self._begins)
            times = ", ".join(self._begins) + (f" and {more} more" if more else "")
            told.append(f"{self._restarts + 1} flights, one after another: new ones at {times}")
        if self._frames.skipped:
            told.append(f"{self._frames.skipped} bytes are no frames, and are skipped")
        if self._frames.unread:
            told.append(f"the last {self._frames.unread} bytes follow too much that is no frame")
        others = {system for system, _, message in self.telemetry.heard if message in _OF_VEHICLES}
        if others - {SYSTEM_ID}:
            names = listed([*map(str, sorted(others - {SYSTEM_ID}))], _NAMED)
            told.append(f"of several vehicles system {SYSTEM_ID} is shown, not {names}")
        return tuple(told)

    def missing(self) -> str:
        """Why nothing of the log can be shown."""
        systems = sorted({one.system for one in self.telemetry.heard.values()})
        if not systems:
            return "is no telemetry log with positions of a vehicle: it has no MAVLink frame"
        heard = listed([*map(str, systems)], _NAMED)
        return (
            "is no telemetry log with positions of a vehicle: LOCAL_POSITION_NED and ATTITUDE of "
            f"system {SYSTEM_ID} are needed; it has messages of system {heard}"
        )


class TlogFlight:
    """See :class:`view.flight.Flight`."""

    def __init__(self, path: Path, airframe: Airframe) -> None:
        """Read a log of such an ``airframe``, which the messages do not tell.

        Raises:
            UlogError: It is no telemetry log, or says nothing about where the vehicle was.
        """
        self.airframe = airframe
        try:
            log = read_bounded(path, _MAX_BYTES)
        except OSError as error:
            raise UlogError(f"cannot read {path}: {error.strerror}") from None
        recording = _Recording(path, TlogFrames(log), airframe)
        self._scenes = recording.scenes
        if not self._scenes:
            raise UlogError(f"{path} {recording.missing()}")
        self._times = [scene.t for scene in self._scenes]
        self.begin, self.end = self._times[0], self._times[-1]
        self.title = f"{path.parent.name}/{path.name}"
        telemetry = recording.telemetry
        self.unusable = recording.remarks()
        heard = sum(one.count for one in telemetry.heard.values())
        self.facts: tuple[tuple[str, str], ...] = (("file", str(path)), ("messages", f"{heard}"))
        if telemetry.left_out:
            self.facts += (("zones not shown", f"{telemetry.left_out} messages"),)
        self.events = tuple(
            one if math.isfinite(one.t) else one._replace(t=self.begin) for one in recording.events
        )
        self.worst = self._worst()

    def scene(self, t: float) -> Scene:
        """What was at ``t`` [s, the vehicle's clock]; nothing where the log pauses."""
        last = self._scenes[max(bisect_right(self._times, t + 1e-9) - 1, 0)]
        return last if t - last.t <= _PAUSE_S else Scene(t=t)

    def trail(self) -> Trail:
        """The end-effector's path."""
        known = [(one.estimate, one.minimum) for one in self._scenes if one.estimate]
        points = [tip_of(posture, self.airframe) for posture, _ in known]
        return Trail(np.array(points), np.array([minimum for _, minimum in known]))

    def reference(self) -> Array:
        """Where the end-effector should have been, (n, 3) [m, NED]."""
        nowhere = (math.nan,) * 3
        return np.array([nowhere if s.target is None else s.target for s in self._scenes])

    def region(self) -> tuple[Vec3, Vec3]:
        """Least and largest corner of where something happened [m, NED]."""
        points = self.trail().points
        north, east, up = (points.min(axis=0) - 1.0).tolist()
        south, west, down = (points.max(axis=0) + 1.0).tolist()
        return (north, east, up), (south, west, max(down, 0.0))

    def curves(self) -> tuple[Curve, ...]:
        """What is drawn over time."""
        return curves_of(self._scenes, self.airframe)

    def _worst(self) -> Worst | None:
        known = [one for one in self._scenes if math.isfinite(one.minimum)]
        if not known:
            return None
        least = min(known, key=lambda one: one.minimum)
        names = [one.name for one in least.margins if one.margin <= least.minimum + 1e-6]
        return Worst(least.t, least.minimum, (names or [""])[0], "the vehicle's own estimate")


def curves_of(scenes: list[Scene], airframe: Any) -> tuple[Curve, ...]:
    """Curves from scenes, for a vehicle with an ``airframe``'s limits."""
    t = np.array([one.t for one in scenes])
    nothing = (math.nan,) * airframe.rotors
    thrust = np.array([one.thrust or nothing for one in scenes]).reshape(-1, airframe.rotors)
    took = [1e3 * one.solver.total if one.solver else math.nan for one in scenes]
    lean = [math.degrees(tilt(one.estimate)) if one.estimate else math.nan for one in scenes]
    margins = np.array([one.minimum for one in scenes])
    limit = airframe.strongest_thrust
    return (
        Curve("margin [m]", t, ("least",), (margins,), (0.0,)),
        Curve("planning cycle [ms]", t, ("cycle",), (np.array(took),), (100.0,)),
        Curve("rotor thrust [N]", t, tuple(rotor_names(airframe)), tuple(thrust.T), (0.0, limit)),
        Curve("tilt [deg]", t, ("tilt",), (np.array(lean),), (math.degrees(airframe.tilt_max),)),
    )
