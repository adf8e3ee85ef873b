"""A flight from its ULog."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.model.body import BODIES, BodyName, body_of
from fsw.autopilot.model.rotors import rotor_names
from fsw.autopilot.signals import (
    MissionUpdate,
    Plan,
    SafeSet,
    SafeSetAnnouncement,
    SolverStatus,
    Vec3,
    Vec4,
)
from view.flight import Curve, Trail
from view.flight_data import FlightData, Table, UlogError, read_flight
from view.flight_events import events
from view.scene import (
    Held,
    Horizon,
    Margin,
    Posture,
    Safety,
    Scene,
    Solver,
    Timing,
    Tool,
    Worst,
    vec3,
)
from view.vehicle import airframe_of, horizon, tilts

Array = NDArray[Any]

GROUPS: Final = ("inner", "mpc", "telemetry", "housekeeping")  # PANDION_RATE_GROUP
_FACTS: Final = (
    "scenario", "seed", "controller", "inner", "solver", "body", "pacing", "ver_sw",
)  # fmt: skip
_CURVE_POINTS: Final = 1500
_NO_TABLE: Final = Table("", np.empty(0), {})


class LogFlight:
    """See :class:`view.flight.Flight`."""

    def __init__(self, path: Path) -> None:
        """Read a log.

        Raises:
            UlogError: It is no log of this vehicle, or damaged.
        """
        self.data = data = read_flight(path)
        if "vehicle_attitude" not in data.tables or "vehicle_local_position" not in data.tables:
            raise UlogError(f"{data.path} says nothing about where the vehicle was")
        self.airframe = airframe_of(data.information)
        self.begin, self.end = data.begin, data.end
        self.unusable = data.unusable
        info = data.information
        self.title = f"{info.get('scenario', data.path.stem)}, seed {info.get('seed', '?')}"
        self.facts = tuple((name, str(info[name])) for name in _FACTS if name in info)
        self._names = self._margin_names()
        self._plans: list[tuple[float, Plan]] = [
            (t, plan) for t, plan in self._decoded("plan") if isinstance(plan, Plan)
        ]
        self._plan_times = [t for t, _ in self._plans]
        self._sets = self._safe_sets()
        self._set_times = [t for t, _ in self._sets]
        self.events = events(data)
        self.worst = _worst(data, self._name)
        self._horizon: tuple[int, Horizon | None] = (-1, None)

    def scene(self, t: float) -> Scene:
        """What was at ``t`` [s, sensor time]."""
        estimate = self._posture(
            t, ("vehicle_local_position", None), ("vehicle_attitude", "q"), ("arm_joint_state", "q")
        )
        truth = "sim_ground_truth"
        at = self._row("vehicle_local_position", t)
        status, plan = self._row("vehicle_status", t), self._plan(t)
        told = self._row("actuator_command", t)
        joints = self._row("arm_joint_state", t)
        reference = self._row("end_effector", t, lasts=0.3)
        margins, minimum, added, safety = self._margins(t)
        return Scene(
            t=t,
            estimate=estimate,
            truth=self._posture(t, (truth, "p_WB"), (truth, "q_WB"), (truth, "q_arm")),
            velocity=None if at is None else vec3((at["vx"], at["vy"], at["vz"])),
            thrust=None if told is None else _numbers(told["rotor_thrust"]),
            torque=None if told is None else _numbers(told["joint_torque"]),
            joint_rates=None if joints is None else _numbers(joints["qd"]),
            target=None if reference is None else _finite(reference["p_ref"]),
            horizon=plan,
            safe_set=self.safe_set(t),
            margins=margins,
            minimum=minimum,
            added=added,
            sigma=self._sigma(t),
            mode="" if status is None else _text(status["mode"]),
            armed=status is not None and int(status["arming_state"]) == 2,
            landed=(landed := self._row("vehicle_land_detected", t)) is not None
            and bool(landed["landed"]),
            failures="" if status is None else _text(status["failures"]),
            solver=self._solver(t),
            timing=self._timing(t),
            safety=safety,
            tool=self._tool(t),
            held=self._held(t),
        )

    def safe_set(self, t: float) -> SafeSet | None:
        """The safe set in force at ``t`` [s, sensor time]."""
        place = bisect_right(self._set_times, t + 1e-9) - 1
        return self._sets[place][1] if place >= 0 else None

    def trail(self) -> Trail:
        """The end-effector's path, once a planning cycle."""
        table = self._table("end_effector")
        if not len(table):
            return Trail(np.empty((0, 3)), np.empty(0))
        margins = self._table("barrier_margin")
        known = np.full(len(table), np.nan)
        if len(margins):
            least = np.where(margins["count"] > 0, margins["minimum"], np.nan)
            known = least[np.clip(np.searchsorted(margins.t, table.t), 0, len(margins) - 1)]
        return Trail(table["p"].astype(np.float64), known)

    def reference(self) -> Array:
        """Where the end-effector should have been, (n, 3) [m, NED]."""
        table = self._table("end_effector")
        return table["p_ref"].astype(np.float64) if len(table) else np.empty((0, 3))

    def region(self) -> tuple[Vec3, Vec3]:
        """Least and largest corner of where something happened [m, NED]."""
        place = self._table("vehicle_local_position")
        points = np.stack([place[axis] for axis in "xyz"], axis=1)
        points = np.concatenate((points, self.trail().points))
        points = points[np.isfinite(points).all(axis=1)]
        low, high = points.min(axis=0) - 0.8, points.max(axis=0) + 0.8
        return vec3(low), vec3((*high[:2], max(high[2], 0.0)))

    def curves(self) -> tuple[Curve, ...]:
        """What is drawn over time."""
        drawn: tuple[tuple[str, Callable[[Table], Curve | None]], ...] = (
            ("barrier_margin", self._margin_curve),
            ("end_effector", _tracking_curve),
            ("mpc_status", _solver_curve),
            ("actuator_command", self._thrust_curve),
            ("arm_joint_state", self._joint_curve),
            ("vehicle_attitude", self._tilt_curve),
            ("sim_ground_truth", self._error_curve),
        )
        tables = ((self._table(topic), draw) for topic, draw in drawn)
        curves = (draw(table) for table, draw in tables if len(table))
        return tuple(curve for curve in curves if curve is not None)

    def _margin_curve(self, table: Table) -> Curve | None:
        if not (table["count"] > 0).any():
            return None
        count = int(table["count"].max())
        rows = [np.where(table["count"] > 0, table["minimum"], np.nan)]
        names = ["least"]
        if count <= 6:
            rows += [table["margin"][:, k] for k in range(count)]
            names += [self._name(k) for k in range(count)]
        return _curve("margin [m]", table.t, names, rows, (0.0,))

    def _thrust_curve(self, table: Table) -> Curve:
        rows, limits = list(table["rotor_thrust"].T), (0.0, self.airframe.strongest_thrust)
        return _curve("rotor thrust [N]", table.t, rotor_names(self.airframe), rows, limits)

    def _joint_curve(self, table: Table) -> Curve:
        limits = self.airframe.angle_limits
        lines = [math.degrees(limit) for one in limits for limit in (one.low, one.high)]
        rows = [np.degrees(table["q"] @ one.row) for one in limits]
        shown = tuple(line for line in lines if math.isfinite(line))
        return _curve("arm [deg]", table.t, [one.name for one in limits], rows, shown)

    def _tilt_curve(self, table: Table) -> Curve:
        most = math.degrees(self.airframe.tilt_max)
        return _curve("tilt [deg]", table.t, ["tilt"], [tilts(table["q"])], (most,))

    def _error_curve(self, truth: Table) -> Curve:
        place = self._table("vehicle_local_position")
        at = np.clip(np.searchsorted(truth.t, place.t), 0, len(truth) - 1)
        said = np.stack([place[axis] for axis in "xyz"], axis=1)
        off = np.linalg.norm(said - truth["p_WB"][at], axis=1)
        off = np.where(np.abs(truth.t[at] - place.t) < 0.05, off, np.nan)
        return _curve("estimate off the truth [m]", place.t, ["error"], [off])

    def _table(self, name: str) -> Table:
        return self.data.tables.get(name, _NO_TABLE)

    def _row(self, name: str, t: float, lasts: float = math.inf) -> dict[str, Any] | None:
        """The newest record of a topic, unless it is older than ``lasts``."""
        table = self._table(name)
        place = int(np.searchsorted(table.t, t + 1e-9, side="right")) - 1
        if place < 0 or t - table.t[place] > lasts:
            return None
        return table.row(place)

    def _nearest(self, name: str, t: float) -> dict[str, Any] | None:
        """The record of a topic that is nearest in time: margins are logged ten times a second."""
        table = self._table(name)
        if not len(table) or t + 1e-9 < table.t[0]:
            return None
        after = min(int(np.searchsorted(table.t, t)), len(table) - 1)
        nearer = after > 0 and t - table.t[after - 1] < table.t[after] - t
        return table.row(after - 1 if nearer else after)

    def _posture(
        self, t: float, p: tuple[str, str | None], q: tuple[str, str], arm: tuple[str, str]
    ) -> Posture | None:
        place, attitude = self._row(p[0], t, lasts=1.0), self._row(q[0], t, lasts=1.0)
        joints = self._row(arm[0], t, lasts=1.0)
        if place is None or attitude is None:
            return None
        point = place[p[1]] if p[1] else np.array((place["x"], place["y"], place["z"]))
        where = _finite(point)
        if where is None:
            return None
        rest = (0.0,) * self.airframe.bodies.joints
        q_arm = rest if joints is None else _numbers(joints[arm[1]])
        return Posture(where, _four(attitude[q[1]]), q_arm)

    def _plan(self, t: float) -> Horizon | None:
        place = bisect_right(self._plan_times, t + 1e-9) - 1
        if place != self._horizon[0]:
            plan = self._plans[place][1] if place >= 0 else None
            shown = None
            if plan is not None:
                shown = horizon(plan.start, plan.inputs, 1e-6 * plan.period_us, self.airframe)
            self._horizon = (place, shown)
        fresh = place >= 0 and t - self._plan_times[place] < 0.5
        return self._horizon[1] if fresh else None

    def _margins(self, t: float) -> tuple[tuple[Margin, ...], float, float, Safety]:
        row = self._nearest("barrier_margin", t)
        if row is None:
            return (), math.nan, math.nan, Safety()
        count = int(row["count"])
        margins = tuple(
            Margin(self._name(k), float(row["margin"][k]), float(row["barrier"][k]))
            for k in range(min(count, len(row["margin"])))
        )
        added = row.get("added", np.array([np.nan]))
        most = float(np.nanmax(added)) if np.isfinite(added).any() else math.nan
        safety = Safety(*(int(row.get(name, 0)) for name in Safety._fields))
        return margins, float(row["minimum"]) if count else math.nan, most, safety

    def _sigma(self, t: float) -> Vec3 | None:
        row = self._row("estimator_status", t, lasts=1.0)
        if row is None:
            return None
        level, down = float(row["pos_horiz_accuracy"]), float(row["pos_vert_accuracy"])
        return (level / math.sqrt(2.0), level / math.sqrt(2.0), down)

    def _solver(self, t: float) -> Solver | None:
        row = self._row("mpc_status", t)
        if row is None:
            return None
        return Solver(
            status=status_name(int(row["status"])),
            total=1e-6 * float(row["total_us"]),
            solve=1e-6 * float(row["solve_us"]),
            iterations=int(row["solver_iterations"]),
            slack=float(row["slack_max"]),
            missed=int(row["missed_deadlines"]),
            fallbacks=int(row["fallbacks"]),
        )

    def _tool(self, t: float) -> Tool | None:
        row = self._row("tool_contact", t, lasts=0.1)
        if row is None:
            return None
        force = _finite(row["force"])
        if force is None:
            return None
        pressed, asked, most = (float(row[name]) for name in ("pressed", "asked", "most"))
        return Tool(force, pressed, asked, most, bool(row["contact"]))

    def _held(self, t: float) -> Held | None:
        row = self._row("payload", t)
        return None if row is None else Held(bool(row["closed"]), float(row["mass"]))

    def _timing(self, t: float) -> tuple[Timing, ...]:
        table = self._table("loop_timing")
        end = int(np.searchsorted(table.t, t + 1e-9, side="right"))
        found: dict[int, Timing] = {}
        for k in range(max(end - 2 * len(GROUPS), 0), end):
            row = table.row(k)
            group = int(row["group"])
            if group < len(GROUPS):
                found[group] = Timing(
                    name=GROUPS[group],
                    period=1e-6 * float(row["period_us"]),
                    execution_p99=1e-6 * float(row["execution_p99_us"]),
                    late=int(row["late_ticks"]),
                    skipped=int(row["skipped_ticks"]),
                )
        return tuple(found[group] for group in sorted(found))

    def _decoded(self, name: str) -> list[tuple[float, Any]]:
        try:
            return self.data.decoded(name)
        except UlogError:
            return []  # of another build: what it says in records of its own is still shown

    def _safe_sets(self) -> list[tuple[float, SafeSet]]:
        """Safe sets and fences that were taken, together, with the times from which on."""
        refused = {
            round(one.t, 3)
            for one in self.data.texts
            if " refused" in one.text and ("safe set" in one.text or "fence" in one.text)
        }
        changes: list[tuple[float, SafeSet, bool]] = []
        for t, announced in self._decoded("announced"):
            changes += [
                (t, one.safe_set, False)
                for one in announced
                if isinstance(one, SafeSetAnnouncement)
            ]
        for t, mission in self._decoded("mission"):
            if isinstance(mission, MissionUpdate) and mission.fence is not None:
                changes.append((t, mission.fence, True))
        now, fence, sets = SafeSet(), SafeSet(), list[tuple[float, SafeSet]]()
        for t, safe_set, is_fence in sorted(changes, key=lambda one: one[0]):
            if round(t, 3) in refused:
                continue
            now, fence = (now, safe_set) if is_fence else (safe_set, fence)
            both = SafeSet(now.zones + fence.zones)
            if not sets or sets[-1][1] != both:
                sets.append((t, both))
        return sets

    def _margin_names(self) -> tuple[str, ...]:
        """As the simulator names zones and parts, zone by zone; empty: it is not beside the log."""
        judged = self.data.beside.get("result", {}).get("margins_m")
        return tuple(judged) if isinstance(judged, dict) else ()

    @cached_property
    def _parts(self) -> tuple[str, ...]:
        body = self.data.information.get("body", "points")
        known: list[BodyName] = [name for name in BODIES if name == body]
        return tuple(p.name for p in body_of((*known, "points")[0], self.airframe).parts)

    def _name(self, k: int) -> str:
        """Of a margin's place in the record."""
        table = self._table("barrier_margin")
        count = int(table["count"].max()) if len(table) else 0
        names, zones = self._names, self._zone_names
        if len(names) == count and k < len(names):
            return names[k]
        if zones and count == len(zones):
            return zones[k] if k < len(zones) else f"zone {k + 1}"
        part = self._parts[k % len(self._parts)]
        zone = k // len(self._parts)
        return f"{zones[zone] if zone < len(zones) else f'zone {zone + 1}'}/{part}"

    @cached_property
    def _zone_names(self) -> tuple[str, ...]:
        found = tuple(dict.fromkeys(name.partition("/")[0] for name in self._names))
        if found:
            return found
        zones = max((s.zones for _, s in self._sets), key=len, default=())
        return tuple(f"{zone.shape.kind} {k}" for k, zone in enumerate(zones, start=1))


def _tracking_curve(table: Table) -> Curve:
    off = np.linalg.norm(table["p"] - table["p_ref"], axis=1)
    return _curve("end-effector off its reference [m]", table.t, ["error"], [off])


def _solver_curve(table: Table) -> Curve:
    took = 1e-3 * table["total_us"]
    if not np.isfinite(took).any():
        cost = table["cost"]
        return _curve("cost of the plan (no times in lockstep)", table.t, ["cost"], [cost])
    solve = 1e-3 * table["solve_us"]
    return _curve("planning cycle [ms]", table.t, ["cycle", "solver"], [took, solve], (100.0,))


def _worst(data: FlightData, name_of: Any) -> Worst | None:
    """The simulator's judgement where it is beside the log, else the vehicle's own estimate."""
    judged, timed = data.beside.get("result", {}), data.beside.get("sitl", {})
    least, at = judged.get("min_margin_m"), timed.get("min_margin_time_s")
    if isinstance(least, float) and isinstance(at, float) and timed.get("min_margin_m") == least:
        name = str(timed.get("min_margin_key", ""))
        return Worst(data.begin + at, least, name, "truth, as in result.json")
    table = data.tables.get("barrier_margin", _NO_TABLE)
    if not len(table) or not (table["count"] > 0).any():
        return None
    known = np.where(table["count"] > 0, table["minimum"], np.inf)
    place = int(np.argmin(known))
    name = name_of(int(table["argmin"][place]))
    return Worst(float(table.t[place]), float(known[place]), name, "the vehicle's own estimate")


def _curve(
    title: str, t: Array, names: list[str], rows: list[Array], limits: tuple[float, ...] = ()
) -> Curve:
    """A curve of at most so many points: of each stretch the least and the largest value."""
    if len(t) <= _CURVE_POINTS:
        return Curve(title, t, tuple(names), tuple(np.asarray(r, float) for r in rows), limits)
    stretches = _CURVE_POINTS // 2
    length = -(-len(t) // stretches)
    ends = np.arange(0, len(t), length)
    thin = []
    for row in rows:
        row = np.asarray(row, float)
        least, most = np.fmin.reduceat(row, ends), np.fmax.reduceat(row, ends)
        thin.append(np.stack((least, most), axis=1).ravel())
    return Curve(title, np.repeat(t[ends], 2), tuple(names), tuple(thin), limits)


def status_name(number: int) -> str:
    """Of a PANDION_SOLVER_STATUS."""
    known = number in list(SolverStatus)
    return SolverStatus(number).name.lower().replace("_", " ") if known else f"status {number}"


def _text(value: bytes) -> str:
    return value.rstrip(b"\0").decode("utf-8", "replace")


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(map(float, values))


def _four(values: Array) -> Vec4:
    a, b, c, d = (float(value) for value in values)
    return a, b, c, d


def _finite(values: Array) -> Vec3 | None:
    return vec3(values) if np.isfinite(values).all() else None
