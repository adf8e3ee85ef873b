"""Own references of the end-effector, as the trajectory of a scenario.

A reference is a callable of the time [s] that returns north, east and down [m], and yaw [rad] if it
has four numbers; or a table (n, 4) or (n, 5) with rows of time [s], these and yaw [rad]; or the
path of a CSV file in the format of scenario files; or a trajectory of ``sitl.scenario``. Velocity
and acceleration are those of a spline through it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from sitl.scenario import Points, Trajectory
from sitl.scenario_file import read_points
from sitl.scenario_validation import MAX_POINTS, check_trajectory
from sitl.trajectory import reference as reference_of
from studies.flight.own_parts import OwnPartError, numbers

Array: TypeAlias = NDArray[np.float64]
AnyReference: TypeAlias = Callable[[float], Any] | Array | Path | str | Trajectory

_KINDS: Final[tuple[type[Trajectory], ...]] = get_args(Trajectory)
_APART_S: Final = 0.05  # samples of a callable; the vehicle is sent one each 0.1 s
_OFF_M: Final = 0.001  # by which the spline may miss a callable between two samples


def trajectory(given: AnyReference, duration_s: float) -> Trajectory:
    """The trajectory that a reference is over ``duration_s`` [s].

    Raises:
        OwnPartError: A callable raises, jumps, or returns what is no place.
        ScenarioError: A table that is none.
    """
    if isinstance(given, _KINDS):
        return given
    if isinstance(given, str | Path):
        columns, _ = read_points(Path(given))
        places = tuple((x, y, z) for x, y, z in columns["position_m"])
        yaws = tuple(columns.get("yaw_deg", ()))
        found = Points(tuple(columns["time_s"]), places, yaws)
        check_trajectory(found)
        return found
    if callable(given):
        return _sampled(given, duration_s)
    table = np.asarray(given, dtype=np.float64)
    width = table.shape[1] if table.ndim == 2 and table.shape[1] in (4, 5) else 4
    return _points(numbers("reference", table, (-1, width)), ends="rest")


def _points(table: Array, ends: Any) -> Points:
    """A table (n, 4) or (n, 5): time [s], place [m, NED], yaw [rad]."""
    yaw = np.degrees(np.unwrap(table[:, 4])).tolist() if table.shape[1] == 5 else ()
    places = tuple((x, y, z) for x, y, z in table[:, 1:4].tolist())
    found = Points(tuple(table[:, 0].tolist()), places, tuple(yaw), ends)
    check_trajectory(found)
    return found


def _sampled(given: Callable[[float], Any], duration_s: float) -> Points:
    if not (math.isfinite(duration_s) and duration_s / _APART_S < MAX_POINTS):
        most = _APART_S * MAX_POINTS
        raise OwnPartError(f"reference: give duration_s, at most {most:g} s, for a callable")
    count = math.ceil(duration_s / _APART_S) + 1
    width = len(np.ravel(_called(given, 0.0)))
    times = [_APART_S * k for k in range(count)]
    table = np.array([(t, *_place(given, t, width)) for t in times])
    found = _points(table, ends="free")
    spline = reference_of(found)
    for t in times[:-1]:
        middle = t + 0.5 * _APART_S
        off = math.dist(spline.place(middle), _place(given, middle, width)[:3])
        if not off <= _OFF_M:
            raise OwnPartError(
                f"reference at {middle:.3f} s: jumps or bends by {1e3 * off:.1f} mm within "
                f"{_APART_S:g} s; a vehicle cannot follow it"
            )
    return found


def _called(given: Callable[[float], Any], t: float) -> Any:
    try:
        return given(t)
    except Exception as error:  # whatever a user's callable raises
        raise OwnPartError(f"reference at {t:.3f} s: {type(error).__name__}: {error}") from error


def _place(given: Callable[[float], Any], t: float, width: int) -> list[float]:
    what = f"reference at {t:.3f} s"
    found: list[float] = numbers(what, _called(given, t), (4 if width == 4 else 3,)).tolist()
    if not max(abs(x) for x in found[:3]) <= 1000.0:
        raise OwnPartError(f"{what}: {found[:3]}, must be within ±1000 m")
    return found
