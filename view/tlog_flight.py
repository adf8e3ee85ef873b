"""A flight from the telemetry log of a ground station."""

from __future__ import annotations

import math
from bisect import bisect_right
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from command_line.bounded_file import read_bounded
from fsw.model.airframe import AIRFRAME
from fsw.signals import Vec3
from messages.tlog_reader import tlog_frames
from view.flight import Curve, Trail
from view.flight_data import UlogError
from view.scene import Scene, Worst
from view.telemetry import Telemetry
from view.vehicle import places, tilt

Array = NDArray[Any]

_SCENE_S: Final = 0.04  # between two scenes that are kept
_MOST_BYTES: Final = 128 * 1024 * 1024  # an hour of a vehicle's telemetry has 40 MB
_MOST_SCENES: Final = 360_000


class TlogFlight:
    """See :class:`view.flight.Flight`."""

    def __init__(self, path: Path) -> None:
        """Read a log.

        Raises:
            UlogError: It is no telemetry log, or says nothing about where the vehicle was.
        """
        self.airframe = AIRFRAME
        telemetry = Telemetry()
        self._scenes: list[Scene] = []
        try:
            log = read_bounded(path, _MOST_BYTES)
        except OSError as error:
            raise UlogError(f"cannot read {path}: {error.strerror}") from None
        for at, frame in tlog_frames(log):
            telemetry.take(frame, at)
            last = self._scenes[-1].t if self._scenes else -math.inf
            if telemetry.t >= last + _SCENE_S:
                scene = telemetry.scene(at)
                if scene.estimate is not None:
                    self._scenes.append(scene)
                if len(self._scenes) > _MOST_SCENES:
                    longest = _MOST_SCENES * _SCENE_S / 3600.0
                    raise UlogError(f"{path} is too long: at most {longest:.0f} h can be shown")
        if not self._scenes:
            raise UlogError(f"{path} is no telemetry log with positions of a vehicle")
        self._times = [scene.t for scene in self._scenes]
        self.begin, self.end = self._times[0], self._times[-1]
        self.title = f"{path.parent.name}/{path.name}"
        heard = sum(one.count for one in telemetry.heard.values())
        self.unusable: tuple[str, ...] = ()
        self.facts: tuple[tuple[str, str], ...] = (("file", str(path)), ("messages", f"{heard}"))
        if telemetry.left_out:
            self.facts += (("zones not shown", f"{telemetry.left_out} messages"),)
        self.events = tuple(
            one if math.isfinite(one.t) else one._replace(t=self.begin) for one in telemetry.events
        )
        self.worst = self._worst()

    def scene(self, t: float) -> Scene:
        """What was at ``t`` [s, the vehicle's clock]."""
        return self._scenes[max(bisect_right(self._times, t + 1e-9) - 1, 0)]

    def trail(self) -> Trail:
        """The end-effector's path."""
        points = [places(one.estimate, self.airframe).tip for one in self._scenes if one.estimate]
        return Trail(np.array(points), np.array([one.minimum for one in self._scenes]))

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
    nothing = (math.nan,) * 4
    thrust = np.array([one.thrust or nothing for one in scenes]).reshape(-1, 4)
    took = [1e3 * one.solver.total if one.solver else math.nan for one in scenes]
    lean = [math.degrees(tilt(one.estimate)) if one.estimate else math.nan for one in scenes]
    margins = np.array([one.minimum for one in scenes])
    limit = airframe.rotor_thrust_max
    return (
        Curve("margin [m]", t, ("least",), (margins,), (0.0,)),
        Curve("planning cycle [ms]", t, ("cycle",), (np.array(took),), (100.0,)),
        Curve(
            "rotor thrust [N]", t, ("rear", "left", "front", "right"), tuple(thrust.T), (0.0, limit)
        ),
        Curve("tilt [deg]", t, ("tilt",), (np.array(lean),), (math.degrees(airframe.tilt_max),)),
    )
