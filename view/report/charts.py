"""What the report draws: each function makes one figure of one or several flights."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import cycle
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.model.rotors import rotor_names
from sitl.body import spoken
from view.flight_data import Table
from view.report.chart import (
    COLOURS,
    ESTIMATE,
    LIMIT,
    REFERENCE,
    TRUTH,
    Chart,
    Row,
    Trace,
    line,
    mark,
    over_time,
    rounded,
    spread,
    upright_limit,
)
from view.report.reported import Reported
from view.scene import EventKind
from view.vehicle import airframe_of, tilts

Array = NDArray[Any]

_MM: Final = 1e3
_DEG: Final = 180.0 / math.pi
_SHOWN_MM: Final = 400.0  # of the margins at first; all of it can be zoomed out to
_DETAIL_S: Final = 0.5  # before and behind the worst moment
# What axes show, the first kinds first where there is much of it.
_MARKED: Final = (EventKind.FAULT, EventKind.MODE, EventKind.WARNING, EventKind.COMMAND)
_MAX_MARKS: Final = 60
_MAX_ZONES: Final = 8  # whose margins are drawn: the nearest
_DEADLINE_MS: Final = 20.0  # a plan that comes later is not flown
_PERIOD_MS: Final = 100.0
_INNER: Final = 0  # PANDION_RATE_GROUP
_STAGES: Final = (("p50_us", "median", "circle"), ("p99_us", "p99", "diamond"),
                  ("max_us", "maximum", "line-ns-open"))  # fmt: skip


def charts(flights: Sequence[Reported]) -> list[Chart]:
    """Every figure that these flights have the numbers for."""
    from view.report.paths import paths

    (one,) = flights if len(flights) == 1 else (None,)  # of several `limits` compares the inputs
    made = (
        paths(flights), margins(flights), parts(flights), tracking(flights), force(flights),
        *((inputs(one), plan_inputs(one), motion(one)) if one is not None else ()),
        limits(flights), solver(flights), stages(flights), loop_timing(flights),
        estimates(flights) if one is None else estimator(one), worst_second(flights),
    )  # fmt: skip
    return [chart for chart in made if chart is not None and chart.data]


def event_marks(flight: Reported) -> list[tuple[float, str]]:
    """Time since the start [s] and number in the table of the events that axes show."""
    found = [(k, event) for k, event in enumerate(flight.events, 1) if event.kind in _MARKED]
    shown = sorted(found, key=lambda pair: _MARKED.index(pair[1].kind))[:_MAX_MARKS]
    marks: dict[float, str] = {}
    for k, event in sorted(shown, key=lambda pair: pair[0]):
        t = round(event.t - flight.data.begin, 3)
        if t > 0.0:
            marks[t] = f"{marks[t]},{k}" if t in marks else str(k)
    return list(marks.items())


def margins(flights: Sequence[Reported]) -> Chart:
    """Margins over time, by the truth and by the vehicle's own estimate."""
    traces, lowest, least = [], 0.0, 0.0
    for flight, colour in _coloured(flights):
        traces += _margin_lines(flight, colour, alone=len(flights) == 1)
        worst = flight.worst
        if worst is not None:
            lowest, least = min(lowest, _MM * worst.margin), max(least, _MM * worst.margin)
            said = f"{worst.key}: {_MM * worst.margin:.1f} mm"
            shade = LIMIT if len(flights) == 1 else colour
            traces.append(mark(_named(flight, flights, "minimum"), worst.t, _MM * worst.margin,
                               shade, said))  # fmt: skip
    tops = [max((v for v in one["y"] if v is not None), default=0.0) for one in traces]
    top = min(max(_SHOWN_MM, 2.0 * least), 1.2 * max(tops, default=_SHOWN_MM))
    note = (
        "Distance beyond the required clearance, minimum of each zone, by the true state. The "
        "circle is the minimum in the result, which the simulator checks every millisecond; the "
        "lines are the samples in the log."
    )
    if any(len(flight.margins.of_zones()) > _MAX_ZONES for flight in flights if flight.margins):
        note += f" Of more zones the {_MAX_ZONES} nearest are drawn."
    own = [flight.label for flight in flights if flight.margins is None]
    if own:
        whose = "" if len(own) == len(flights) else f" of {', '.join(own)}"
        note += (
            f" The lines{whose} are the vehicle's own estimate: the scenario is none of this "
            "build's, or the log has no true state."
        )
    span = (min(-20.0, 1.2 * lowest), max(top, 50.0))
    return over_time(
        "margins", "Margins", note, [Row("margin [mm]", traces, (0.0,), span)], _marks(flights)
    )


def _margin_lines(flight: Reported, colour: str, *, alone: bool) -> list[Trace]:
    lines = []
    truth, own = flight.margins, flight.table("barrier_margin")
    if truth is not None:
        t = flight.since(truth.t)
        if alone:
            nearest = sorted(truth.of_zones().items(), key=lambda pair: float(pair[1].min()))
            for k, (zone, values) in enumerate(nearest[:_MAX_ZONES]):
                lines.append(line(zone, t, _MM * _finite(values), COLOURS[k % len(COLOURS)]))
        elif truth.keys:
            lines.append(line(flight.label, t, _MM * _finite(truth.least), colour))
    if own is not None and (alone or truth is None):
        look = {"dash": "dot"} if truth is not None else {}
        shade = ESTIMATE if alone else colour
        name = "minimum, by the vehicle's estimate" if alone else flight.label
        lines.append(line(name, flight.since(own.t), _MM * own["minimum"], shade, line=look))
    return lines


def parts(flights: Sequence[Reported]) -> Chart:
    """The least margin of every zone and part, as in the result."""
    traces = []
    height = 0
    for flight, colour in _coloured(flights):
        found = flight.result.get("margins_m", {})
        keys = sorted(found, key=lambda key: -found[key])[-24:]
        height = max(height, len(keys) * len(flights))
        if keys:
            traces.append(_bars(flight, colour, keys, [_MM * found[key] for key in keys]))
    layout = _of_bars(height, "minimum margin [mm]")
    note = "Minimum over the flight of each zone and part of the vehicle, as in result.json."
    return Chart("parts", "Minimum margin of each part", note, traces, layout)


def tracking(flights: Sequence[Reported]) -> Chart:
    """Distance of the end-effector from its reference."""
    traces, means = [], []
    own_only: list[str] = []
    for flight, colour in _coloured(flights):
        truth, own = flight.table("sim_tracking"), flight.table("end_effector")
        if truth is not None:
            t, error = flight.since(truth.t), truth["p_WE"] - truth["target"]
        elif own is not None:
            t, error = flight.since(own.t), own["p"].astype("f8") - own["p_ref"]
        else:
            continue
        size = _MM * np.linalg.norm(error, axis=1)
        if truth is None:
            own_only.append(flight.label)
        traces.append(line("distance" if len(flights) == 1 else flight.label, t, size, colour))
        if len(flights) == 1:
            for axis, shade in zip(range(3), COLOURS[1:], strict=False):
                name = ("north", "east", "down")[axis]
                traces.append(line(name, t, _MM * error[:, axis], shade, width=0.8))
        rms = flight.result.get("tracking_error_rms_m")
        if rms is not None:
            means.append(f"{_MM * rms:.1f} mm RMS" + f" ({flight.label})" * (len(flights) > 1))
    return over_time(
        "tracking",
        "Tracking",
        f"Distance of the end-effector from its reference, 10 Hz, {_whose(own_only, flights)}. "
        + ("The whole flight: " + ", ".join(means) + "." if means else ""),
        [Row("error [mm]", traces)],
        _marks(flights),
    )


def _whose(own_only: Sequence[str], flights: Sequence[Reported]) -> str:
    """Whose state is drawn, of flights of which some have no true one."""
    if not own_only:
        return "true state"
    estimated = "the vehicle's own estimate"
    if len(own_only) == len(flights):
        return estimated
    return f"true state; of {', '.join(own_only)} {estimated}"


def force(flights: Sequence[Reported]) -> Chart | None:
    """The normal force on the tool: true, observed, asked for and allowed."""
    traces, bounds = [], set[float]()
    for flight, colour in _coloured(flights):
        truth, own = flight.table("sim_contact"), flight.table("tool_contact")
        if own is None or not len(own.t):
            continue
        alone, t = len(flights) == 1, flight.since(own.t)
        bounds.update(float(most) for most in np.unique(own["most"]))
        if alone:
            traces.append(line("observed", t, own["pressed"], ESTIMATE, width=0.8))
            traces.append(line("asked for", t, own["asked"], REFERENCE))
        if truth is not None:
            shade = TRUTH if alone else colour
            name = "true" if alone else flight.label
            traces.append(line(name, flight.since(truth.t), truth["normal"], shade))
    if not traces:
        return None
    return over_time(
        "force",
        "Force on the tool",
        "Normal force on a surface that the tool may touch; observed without a force sensor while "
        "one is near. Dashed: the most that is allowed.",
        [Row("force [N]", traces, tuple(sorted(bounds)))],
        _marks(flights),
    )


def inputs(flight: Reported) -> Chart | None:
    """Thrusts and torques as sent, with their limits."""
    sent = flight.table("actuator_command")
    if sent is None:
        return None
    t = flight.since(sent.t)
    airframe = airframe_of(flight.data.information)
    joints = airframe.bodies.joints
    most, torque = airframe.strongest_thrust, max(airframe.joint_torque_max[:joints])
    rotors = [(name, COLOURS[k % len(COLOURS)]) for k, name in enumerate(rotor_names(airframe))]
    thrusts = spread("rotors", t, sent["rotor_thrust"], rotors)
    torques = [
        line(f"joint {k + 1}", t, sent["joint_torque"][:, k], _of_joint(k), width=0.8)
        for k in range(joints)
    ]
    return over_time(
        "inputs",
        "Inputs against their limits",
        "Commanded 500 times a second. The band holds every rotor's thrust, the lines are means; "
        "a click on a name shows that rotor as commanded. Dashed: limits.",
        [
            Row("thrust [N]", thrusts, (0.0, most), (-0.5, 1.08 * most)),
            Row("torque [N m]", torques, (-torque, torque)),
        ],
        event_marks(flight),
    )


def plan_inputs(flight: Reported) -> Chart | None:
    """The planner's u with its box."""
    table, arm = flight.table("plan_input"), flight.table("arm_joint_setpoint")
    if table is None or arm is None:
        return None
    t, most = flight.since(table.t), flight.number("planner.limits.vertical")
    joint = flight.number("planner.limits.joint_acc")
    flat = 9.81 * math.tan(flight.number("planner.limits.tilt"))
    shown = [line(f"a {name}", t, table["a"][:, k], COLOURS[k], width=0.9)
             for k, name in enumerate(("north", "east", "down"))]  # fmt: skip
    joints = [line(f"joint {k + 1} acc.", flight.since(arm.t), arm["qdd"][:, k], _of_joint(k),
                   width=0.9) for k in range(arm["qdd"].shape[1])]  # fmt: skip
    return over_time(
        "plan_inputs",
        "The planner's inputs",
        f"u of the plan in force. Limits: ±{most:g} m/s² vertically and ±{joint:g} rad/s² at the "
        f"joints; horizontally the tilt allows {flat:.2f} m/s².",
        [
            Row("acceleration [m/s²]", shown, (-most, most), _about_zero(table["a"], most)),
            Row("joints [rad/s²]", joints, (-joint, joint), _about_zero(arm["qdd"], joint)),
        ],
        event_marks(flight),
    )


def motion(flight: Reported) -> Chart | None:
    """Tilt, joints and their rates with their limits, by the best that the log has."""
    truth = flight.table("sim_ground_truth")
    state, attitude = flight.table("arm_joint_state"), flight.table("vehicle_attitude")
    if truth is not None:
        t, q = flight.since(truth.t), truth["q_WB"]
        t_arm, angles, rates = t, truth["q_arm"], truth["qd_arm"]
    elif state is not None and attitude is not None:
        t, q = flight.since(attitude.t), attitude["q"]
        t_arm, angles, rates = flight.since(state.t), state["q"], state["qd"]
    else:
        return None
    airframe = airframe_of(flight.data.information)
    limits = airframe.angle_limits
    ends = [_DEG * end for one in limits for end in (one.low, one.high) if math.isfinite(end)]
    fastest = max(airframe.joint_rate_max[: angles.shape[1]])
    tilt_max = _DEG * airframe.tilt_max
    said = ", ".join(
        f"{one.name} {_DEG * one.low:.0f} to {_DEG * one.high:.0f} deg" for one in limits
    )
    return over_time(
        "motion",
        "Tilt and joints against their limits",
        f"By the {'true' if truth is not None else 'estimated'} state. Dashed: tilt {tilt_max:.0f} "
        f"deg, {said}, ±{fastest:g} rad/s.",
        [
            Row("tilt [deg]", [line("tilt", t, tilts(q), COLOURS[0])], (tilt_max,),
                (0.0, 1.08 * tilt_max)),
            Row("angles [deg]", [
                line(one.name, t_arm, _DEG * (angles @ one.row), _of_joint(k))
                for k, one in enumerate(limits)
            ], tuple(ends)),
            Row("rates [rad/s]", [
                line(f"joint {k + 1} rate", t_arm, rates[:, k], _of_joint(k), width=0.9)
                for k in range(rates.shape[1])
            ], (-fastest, fastest)),
        ],
        event_marks(flight),
    )  # fmt: skip


def _about_zero(values: Array, most: float) -> tuple[float, float]:
    """The span [their unit] that shows ``values`` well, up to a limit of ``most`` [same]."""
    reach = min(1.05 * most, max(1.4 * float(np.nanmax(np.abs(values), initial=0.0)), 0.1 * most))
    return -reach, reach


def limits(flights: Sequence[Reported]) -> Chart:
    """How much of each limit was used."""
    traces = []
    for flight, colour in _coloured(flights):
        uses = flight.result.get("limits", {})
        if uses:
            names = [name.replace("_", " ") for name in uses]
            shares = [
                100.0 * use["largest"] / use["most"] if use["most"] else None
                for use in uses.values()
            ]
            said = [
                f"{use['largest']:.3g} of {use['most']:.3g} {use['unit']}, {use['at_s']:.2f} s"
                for use in uses.values()
            ]
            traces.append(_bars(flight, colour, names, shares) | {"hovertext": said})
    bars = sum(len(trace["y"]) for trace in traces)
    layout = _of_bars(bars, "largest use [%]") | {"shapes": [upright_limit(100)]}
    layout["yaxis"] = {"automargin": True, "autorange": "reversed"}
    note = "Largest value over the whole flight, true state, 1 kHz, as in result.json."
    return Chart("limits", "Use of each limit", note, traces, layout)


def _bars(
    flight: Reported, colour: str, names: Sequence[str], lengths: Sequence[float | None]
) -> Trace:
    return {
        "type": "bar", "orientation": "h", "name": flight.label, "y": names, "x": lengths,
        "marker": {"color": colour},
    }  # fmt: skip


def _of_bars(count: int, title: str) -> dict[str, Any]:
    """The layout of so many bars."""
    return {
        "height": 18 * count + 110,
        "xaxis": {"title": {"text": title}, "rangemode": "tozero"},
        "yaxis": {"automargin": True},
        "bargap": 0.25,
    }


def solver(flights: Sequence[Reported]) -> Chart:
    """Distribution of the planning cycle's time, and of the optimiser's iterations."""
    traces: list[Trace] = []
    measured = []
    for flight, colour in _coloured(flights):
        status = flight.table("mpc_status")
        if status is None:
            continue
        took = 1e-3 * status["total_us"][np.isfinite(status["total_us"])]
        if len(took):
            measured.append(flight.label)
            traces.append(_cdf(flight.label, took, colour))
        else:
            traces += _quantiles(flight, colour)
        traces.append({
            **_cdf(flight.label, status["solver_iterations"][1:], colour),
            "xaxis": "x2", "showlegend": False,
        })  # fmt: skip
    layout = {
        "height": 330,
        "xaxis": {"title": {"text": "cycle [ms]"}, "type": "log", "domain": [0.0, 0.6],
                  "range": [-1, 2.2]},
        "xaxis2": {"title": {"text": "iterations"}, "domain": [0.66, 1.0]},
        "yaxis": {"title": {"text": "share of cycles"}, "range": [0, 1.02]},
        "shapes": [upright_limit(at) for at in (_DEADLINE_MS, _PERIOD_MS)],
    }  # fmt: skip
    note = (
        "Of the complete planning cycle and of the optimiser. "
        f"Dashed: {_DEADLINE_MS:g} ms, when the plan takes effect, and the period of "
        f"{_PERIOD_MS:g} ms. "
    )
    if len(measured) < len(flights):
        note += (
            "A log in lockstep holds no wall time: median, 99 % and maximum are those that the "
            "flight software counted."
        )
    return Chart("solver", "Time to solve", note, traces, layout)


def _cdf(name: str, values: Array, colour: str) -> Trace:
    """Share of values at or below each."""
    ordered = np.sort(np.asarray(values, "f8"))
    places = np.unique(np.linspace(0, len(ordered) - 1, min(len(ordered), 500)).astype(int))
    return {
        "type": "scatter", "mode": "lines", "name": name, "x": rounded(ordered[places]),
        "y": rounded((places + 1) / len(ordered)), "line": {"color": colour, "shape": "hv"},
    }  # fmt: skip


def _quantiles(flight: Reported, colour: str) -> list[Trace]:
    mpc = flight.data.beside.get("fsw", {}).get("mpc", {})
    if mpc.get("p50_us") is None:
        return []
    return [{
        "type": "scatter", "mode": "markers+lines", "name": flight.label,
        "x": [1e-3 * mpc[key] for key in ("p50_us", "p99_us", "max_us")], "y": [0.5, 0.99, 1.0],
        "line": {"color": colour, "dash": "dot"}, "marker": {"color": colour, "size": 8},
    }]  # fmt: skip


def stages(flights: Sequence[Reported]) -> Chart:
    """What a tick is spent on."""
    traces = []
    for flight, colour in _coloured(flights):
        found = flight.data.beside.get("fsw", {}).get("stages", {})
        for key, what, symbol in _STAGES:
            if not found:
                continue
            traces.append({
                "type": "scatter", "mode": "markers",
                "name": f"{flight.label}, {what}" if len(flights) > 1 else what,
                "y": list(found), "x": [part[key] for part in found.values()],
                "marker": {"color": colour, "symbol": symbol, "size": 10,
                           "line": {"width": 1, "color": colour}},
            })  # fmt: skip
    layout = {
        "height": 330,
        "xaxis": {"title": {"text": "time [µs]"}, "type": "log"},
        "yaxis": {"automargin": True, "autorange": "reversed"},
    }
    note = "Each part of a 500 Hz tick and of what follows it, on the machine of the flight."
    return Chart("stages", "Timing of the tick", note, traces, layout)


def loop_timing(flights: Sequence[Reported]) -> Chart | None:
    """Execution and lateness of the fast tick, of each second; in real time only."""
    rows: tuple[list[Trace], list[Trace]] = ([], [])
    for flight, colour in _coloured(flights):
        table = flight.table("loop_timing")
        if table is None or str(flight.data.information.get("pacing")) != "realtime":
            continue
        inner = (table["group"] == _INNER) & (table["ticks"] > 1)
        t = flight.since(table.t)[inner]
        for row, what in zip(rows, ("execution", "lateness"), strict=True):
            for part, dash in (("p50", "solid"), ("p99", "dash"), ("max", "dot")):
                row.append(line(
                    _named(flight, flights, f"{what} {part}"), t, table[f"{what}_{part}_us"][inner],
                    colour, line={"dash": dash},
                ))  # fmt: skip
    if not rows[0]:
        return None
    return over_time(
        "loop_timing",
        "The 500 Hz loop in real time",
        "Of each second: time of a tick, and how late it was released. Dashed: the period.",
        [Row("tick [µs]", rows[0], (2000.0,)), Row("late [µs]", rows[1])],
        _marks(flights),
    )


def estimator(flight: Reported) -> Chart | None:
    """The estimate's error, with the accuracy that the vehicle believes in."""
    found = _errors(flight)
    if found is None:
        return None
    t, error = found
    rows = []
    status = flight.table("estimator_status")
    for k, name in enumerate(("north", "east", "down")):
        traces = [line(name, t, _MM * error[:, k], COLOURS[k])]
        if status is not None:
            # The horizontal accuracy is of both axes together.
            sigma = status["pos_vert_accuracy" if k == 2 else "pos_horiz_accuracy"].astype("f8")
            sigma = sigma if k == 2 else sigma / math.sqrt(2.0)
            t_own, look = flight.since(status.t), {"dash": "dot"}
            for s, named in ((3.0, k == 0), (-3.0, False)):
                traces.append(line("3 σ", t_own, s * _MM * sigma, ESTIMATE, line=look,
                                   showlegend=named))  # fmt: skip
        seen = np.nanmax(np.abs(error[len(error) // 20 :, k]), initial=0.0)
        reach = _MM * 1.3 * max(seen, 3.0 * float(np.median(sigma)) if status is not None else 0.0)
        rows.append(Row(f"{name} [mm]", traces, (), (-reach, reach) if reach > 0.0 else None))
    if status is not None:
        shown = [
            line(name, flight.since(status.t), status[f"{field}_test_ratio"], COLOURS[k], width=0.9)
            for k, (field, name) in enumerate(_RATIOS)
            if np.isfinite(status[f"{field}_test_ratio"]).any()
        ]
        rows.append(Row("innovation / limit", shown, (1.0,), _robust(shown)))
    exact = "" if status is not None else " The sensors of this flight are exact."
    return over_time(
        "estimator",
        "Estimator",
        f"Estimated minus true position of the body, with three standard deviations.{exact} Rare "
        "innovations far beyond their limit are outside the axis at first: a double click shows "
        "all.",
        rows,
        event_marks(flight),
    )


def _robust(shown: Sequence[Trace]) -> tuple[float, float]:
    """The span that holds nearly all of what is shown, and the limit 1; the rest can be zoomed."""
    values = [y for one in shown for y in one["y"] if y is not None]
    return 0.0, max(1.2, 1.3 * float(np.quantile(values, 0.99)) if values else 0.0)


_RATIOS: Final = (("pos", "position"), ("hgt", "height"), ("vel", "velocity"), ("hdg", "heading"),
                  ("hagl", "range"))  # fmt: skip


def estimates(flights: Sequence[Reported]) -> Chart:
    """The estimate's error of several flights."""
    traces = []
    for flight, colour in _coloured(flights):
        found = _errors(flight)
        if found is not None:
            t, error = found
            size = _MM * np.linalg.norm(error, axis=1)
            traces.append(line(flight.label, t, size, colour))
    note = "Distance between the estimated and the true position of the body."
    return over_time("estimator", "Estimator", note, [Row("error [mm]", traces)])


def _errors(flight: Reported) -> tuple[Array, Array] | None:
    """Times since the start [s] (n,) and estimated minus true position (n, 3) [m]."""
    own, truth = flight.table("vehicle_local_position"), flight.table("sim_ground_truth")
    if own is None or truth is None:
        return None
    _, mine, its = np.intersect1d(own.t, truth.t, return_indices=True)
    estimated = np.stack([own[name][mine] for name in ("x", "y", "z")], axis=1).astype("f8")
    return flight.since(own.t)[mine], estimated - truth["p_WB"][its]


def worst_second(flights: Sequence[Reported]) -> Chart | None:
    """What happened about the smallest margin, as finely as the log has it."""
    rows: tuple[list[Trace], ...] = ([], [], [], [])
    said = []
    for flight, colour in _coloured(flights):
        worst = flight.worst
        if worst is None:
            continue
        alone = len(flights) == 1
        zero = 0.0 if alone else worst.t
        said.append(f"{_named(flight, flights, worst_sentence(flight))}")
        _worst_margins(flight, rows[0], zero, None if alone else colour)
        rows[0].append(mark(_named(flight, flights, "minimum"), worst.t - zero,
                            _MM * worst.margin, LIMIT if alone else colour, worst.key))  # fmt: skip
        for row, (name, t, y) in zip(rows[1:], _about(flight), strict=True):
            inside = np.abs(t - worst.t) <= _DETAIL_S
            if y.ndim == 1:
                y = y[:, None]
            for j in range(y.shape[1]):
                shown = _rotor(flight, j) if y.shape[1] > 1 else name
                shade = COLOURS[j] if alone else colour
                row.append(line(_named(flight, flights, shown), t[inside] - zero, y[inside, j],
                                shade, width=1.0, showlegend=alone or j == 0))  # fmt: skip
    if not said:
        return None
    (single,) = flights if len(flights) == 1 else (None,)
    worst = single.worst if single is not None else None
    middle = worst.t if worst is not None else 0.0
    units = ("margin [mm]", "thrust [N]", "error [mm]", "tilt [deg]")
    made = over_time(
        "worst_second",
        "The worst second",
        " ".join(said),
        [Row(unit, row, (0.0,) if k == 0 else ()) for k, (unit, row) in
         enumerate(zip(units, rows, strict=True)) if row],
        _marks(flights),
        (middle - _DETAIL_S, middle + _DETAIL_S),
    )  # fmt: skip
    if single is None:
        made.layout["xaxis"]["title"]["text"] = "time from the smallest margin [s]"
    return made


def worst_sentence(flight: Reported) -> str:
    """The smallest margin in words."""
    worst = flight.worst
    if worst is None:
        return "No margin was recorded."
    if not worst.key:
        return (
            f"By the vehicle's own estimate the smallest margin was {_MM * worst.margin:.1f} mm, "
            f"at {worst.t:.2f} s."
        )
    zone, _, part = worst.key.partition("/")
    surface = flight.result.get("surfaces_m", {}).get(worst.key)
    behind = "" if surface is None else f" ({_MM * surface:.1f} mm from its surface)"
    more = "more" if worst.margin >= 0.0 else "less"
    return (
        f"At {worst.t:.3f} s {spoken(part)} kept {_MM * abs(worst.margin):.1f} mm "
        f"{more} than the clearance from {zone}{behind}: the smallest margin of the flight."
    )


def _worst_margins(flight: Reported, row: list[Trace], zero: float, colour: str | None) -> None:
    """The parts nearest to anything in that second."""
    worst, truth = flight.worst, flight.margins
    if worst is None or truth is None:
        return
    t = flight.since(truth.t)
    inside = np.abs(t - worst.t) <= _DETAIL_S
    if not inside.any():  # the log was cut before
        return
    nearest = np.argsort(truth.values[inside].min(axis=0))[: 1 if colour else 4]
    for k, key in enumerate(nearest.tolist()):
        name = f"{flight.label} {truth.keys[key]}" if colour else truth.keys[key]
        values = _MM * _finite(truth.values[inside, key])
        row.append(line(name, t[inside] - zero, values, colour or COLOURS[k]))


def _about(flight: Reported) -> list[tuple[str, Array, Array]]:
    """Name, times since the start [s] and values of what is shown beside the margins."""
    sent, tracked = flight.table("actuator_command"), flight.table("sim_tracking")
    none: tuple[str, Array, Array] = ("", np.empty(0), np.empty(0))
    truth: Table | None = flight.table("sim_ground_truth") or flight.table("vehicle_attitude")
    found = [none, none, none]
    if sent is not None:
        found[0] = ("rotor", flight.since(sent.t), sent["rotor_thrust"])
    if tracked is not None:
        size = _MM * np.linalg.norm(tracked["p_WE"] - tracked["target"], axis=1)
        found[1] = ("tracking error", flight.since(tracked.t), size)
    if truth is not None:
        q = truth["q_WB"] if "q_WB" in truth.columns else truth["q"]
        found[2] = ("tilt", flight.since(truth.t), tilts(q))
    return found


def _finite(values: Array) -> Array:
    return np.where(np.isfinite(values), values, np.nan)


def _named(flight: Reported, flights: Sequence[Reported], name: str) -> str:
    return name if len(flights) == 1 else f"{flight.label}: {name}"


def _marks(flights: Sequence[Reported]) -> list[tuple[float, str]]:
    """Events of a single flight; those of several would not be told apart."""
    return event_marks(flights[0]) if len(flights) == 1 else []


def _coloured(flights: Sequence[Reported]) -> Iterator[tuple[Reported, str]]:
    """Each flight with its colour."""
    return zip(flights, cycle(COLOURS), strict=False)


def _of_joint(k: int) -> str:
    """The colour of a joint, behind those of rotors."""
    return COLOURS[(k + 4) % len(COLOURS)]


def _rotor(flight: Reported, k: int) -> str:
    return rotor_names(airframe_of(flight.data.information))[k]
