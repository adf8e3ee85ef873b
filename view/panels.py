"""What the page says beside the picture, as HTML. Texts come from outside and are escaped."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence
from typing import Final

from command_line.printable import printable
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.rotors import rotor_names
from fsw.autopilot.periods import PLANNING_US
from view import colours
from view.colours import Rgb, css, millimetres
from view.scene import Event, Margin, Scene, Timing, Worst
from view.telemetry import first_line
from view.vehicle import tilt

PLANNING_LIMIT: Final = 1e-6 * PLANNING_US  # s, a planning cycle must be over by then
_INKS: Final = {"fault": colours.RED, "warning": colours.ORANGE, "text": colours.GREY}
_BOX: Final = "font:12px/1.45 ui-sans-serif,system-ui,sans-serif;padding:0 0.9em 0.3em"
_NUMBER: Final = "font-variant-numeric:tabular-nums;white-space:nowrap;text-align:right"


def now_html(now: Scene, airframe: Airframe, begin: float) -> str:
    """Mode, margins, inputs and the rest of one instant; times count from ``begin`` [s]."""
    return (
        f'<div data-pandion="now" style="{_BOX}">'
        f"{_headline(now, begin)}{_margins(now)}{_tool(now)}{_inputs(now, airframe)}{_planner(now)}"
        f"{_timing(now.timing)}</div>"
    )


def worst_html(worst: Worst | None, begin: float) -> str:
    """The number that a flight is judged by; its time counts from ``begin`` [s]."""
    if worst is None:
        return f'<div style="{_BOX}">no margins in this log</div>'
    colour = css(colours.of_margin(worst.margin))
    return (
        f'<div style="{_BOX}">minimum margin <b data-pandion="worst" '
        f'data-metres="{worst.margin!r}" style="color:{colour};font-size:1.25em">'
        f"{millimetres(worst.margin)}</b> "
        f"{escape(worst.name)} at {worst.t - begin:.2f} s "
        f'<span style="opacity:.65">({escape(worst.source)})</span></div>'
    )


def facts_html(facts: Sequence[tuple[str, str]]) -> str:
    """What is known about a flight."""
    rows = [_row(escape(name), escape(value)) for name, value in facts]
    return f'<div style="{_BOX}">{_table(rows)}</div>'


def events_html(events: Sequence[Event], t: float, begin: float, most: int = 60) -> str:
    """The events about ``t`` [s], the last one before it marked; times count from ``begin`` [s]."""
    last = sum(one.t <= t + 1e-9 for one in events) - 1
    first = max(min(last - most // 2, len(events) - most), 0)
    rows = []
    for k, one in enumerate(events[first : first + most], start=first):
        mark = "background:rgba(9,105,218,.13);" if k == last else ""
        pale = "opacity:.5;" if k > last else ""
        colour = css(_INKS.get(one.kind, colours.BLUE))
        rows.append(
            f'<tr style="vertical-align:top;{mark}{pale}">'
            f'<td style="{_NUMBER};padding-right:.6em">{one.t - begin:.2f}</td>'
            f'<td style="color:{colour};padding-right:.5em">'
            f"{escape(one.kind)}</td>"
            f'<td style="overflow-wrap:anywhere">{escape(one.text)}</td></tr>'
        )
    empty = "" if rows else "none yet"
    return f'<div data-pandion="events" style="{_BOX}">{empty}{_table(rows)}</div>'


def messages_html(rows: Iterable[tuple[str, str, float, str]]) -> str:
    """Messages: sender, name, rate [Hz] and the newest fields."""
    lines = [
        f'<tr style="vertical-align:top"><td style="padding-right:.5em">{escape(sender)}</td>'
        f'<td style="padding-right:.5em"><b>{escape(name)}</b></td>'
        f'<td style="{_NUMBER};padding-right:.5em">{rate:.1f} Hz</td></tr>'
        + (
            f'<tr><td></td><td colspan="2" style="overflow-wrap:anywhere;opacity:.75">'
            f"{escape(fields)}</td></tr>"
            if fields
            else ""
        )
        for sender, name, rate, fields in rows
    ]
    empty = "" if lines else "nothing that matches"
    return f'<div data-pandion="messages" style="{_BOX}">{empty}{_table(lines)}</div>'


def parameters_html(rows: Iterable[tuple[str, str]]) -> str:
    """Parameters: name and value."""
    lines = [_row(escape(name), escape(value)) for name, value in rows]
    empty = "" if lines else "nothing that matches"
    return f'<div data-pandion="parameters" style="{_BOX}">{empty}{_table(lines)}</div>'


def undrawn(error: Exception) -> str:
    """Why a frame was not drawn."""
    return f"not drawn: {first_line(error)}"


def refusal_html(sentence: str, *, good: bool = False) -> str:
    """How the vehicle answered."""
    colour = css(colours.GREEN if good else colours.RED)
    return (
        f'<div data-pandion="answer" style="{_BOX};color:{colour};font-weight:600">'
        f"{escape(sentence)}</div>"
    )


def _headline(now: Scene, begin: float) -> str:
    badges = [_badge(now.mode or "no mode", colours.BLUE)]
    if now.armed is not None:
        armed = ("armed", colours.ORANGE) if now.armed else ("disarmed", colours.GREY)
        badges.append(_badge(*armed))
    if now.landed:
        badges.append(_badge("landed", colours.GREY))
    badges += [_badge(name, colours.RED) for name in now.failures.split(", ") if name]
    if now.link_age > 2.0:
        badges.append(_badge(f"silent for {now.link_age:.0f} s", colours.RED))
    rest = [f'<span data-pandion="time">{now.t - begin:.2f} s</span>']
    if now.battery is not None:
        rest.append(f"battery {100 * now.battery.remaining:.0f} %, {now.battery.voltage:.1f} V")
    if now.velocity is not None:
        rest.append(f"{math.hypot(*now.velocity):.2f} m/s")
    if now.truth is not None and now.estimate is not None:
        off = math.dist(now.truth.p, now.estimate.p)
        rest.append(f"estimate off by {1e3 * off:.1f} mm")
    if now.sigma is not None:
        rest.append(f"σ {1e3 * max(now.sigma):.1f} mm")
    return (
        f'<div style="margin:.2em 0 .5em">{" ".join(badges)}'
        '<div style="margin-top:.35em;font-variant-numeric:tabular-nums">'
        f"{' · '.join(rest)}</div></div>"
    )


def _margins(now: Scene) -> str:
    if not now.margins:
        return _section("Margins", '<div style="opacity:.65">no zone is known</div>')
    safety = now.safety
    counts = (
        f"breaches {safety.breaches} · off plan {safety.departures} · filter {safety.interventions}"
    )
    if math.isfinite(now.added) and now.added > 0.0:
        counts += f" · kept beyond clearances {millimetres(now.added)}"
    rows = [
        _margin_row(one, now.minimum) for one in sorted(now.margins, key=lambda m: m.margin)[:9]
    ]
    left = len(now.margins) - len(rows)
    more = f'<div style="opacity:.65">and {left} that are larger</div>' if left else ""
    least = (
        f'<b data-pandion="margin" style="color:{css(colours.of_margin(now.minimum))}">'
        f"{millimetres(now.minimum)}</b>"
    )
    note = f'<div style="opacity:.75">{counts}</div>'
    return _section(f"Margins, least {least}", _table(rows) + more + note)


def _margin_row(one: Margin, least: float) -> str:
    weight = "font-weight:600" if one.margin <= least else ""
    acting = "barrier acts" if one.barrier <= 0.0 else f"h {one.barrier:.2f} m/s"
    bar = _bar(one.margin / 0.5, colours.of_margin(one.margin))
    return _row(
        f'<span style="{weight}">{escape(one.name)}</span>', millimetres(one.margin), bar, acting
    )


def _tool(now: Scene) -> str:
    """The force on the tool, and what is in the gripper."""
    rows, one, held = [], now.tool, now.held
    if one is not None:
        share = one.pressed / one.most if one.most > 0.0 else math.nan
        colour = colours.BLUE if share < 0.8 else colours.ORANGE if share < 1.0 else colours.RED
        value = f'<b data-pandion="force" data-newtons="{one.pressed!r}">{one.pressed:.1f} N</b>'
        name = "in contact" if one.contact else "free"
        rows.append(_row(name, value, _bar(share, colour), f"of {one.most:.4g}"))
        rows.append(_row("asked for", f"{one.asked:.1f} N"))
    if held is not None:
        mass = f'<b data-pandion="payload" data-kg="{held.mass!r}">{1e3 * held.mass:.0f} g</b>'
        rows.append(_row("gripper", mass, "", "closed" if held.closed else "open"))
    return _section("Tool", _table(rows)) if rows else ""


def _inputs(now: Scene, airframe: Airframe) -> str:
    rows = []
    tops = airframe.rotor_thrust_max
    for name, thrust, top in zip(rotor_names(airframe), now.thrust or (), tops, strict=False):
        rows.append(_limited(name, thrust, top, "N"))
    for k, torque in enumerate(now.torque or (), start=1):
        rows.append(_limited(f"joint {k} torque", torque, airframe.joint_torque_max[k - 1], "N m"))
    if now.estimate is not None:
        deg = math.degrees
        for one in airframe.angle_limits:
            angle = sum(a * q for a, q in zip(one.row, now.estimate.q_arm, strict=True))
            limit = one.high if angle >= 0.0 else -one.low
            rows.append(_limited(one.name, deg(angle), deg(limit), "°"))
        rows.append(_limited("tilt", deg(tilt(now.estimate)), deg(airframe.tilt_max), "°"))
    return _section("Inputs and limits", _table(rows)) if rows else ""


def _planner(now: Scene) -> str:
    one = now.solver
    if one is None:
        return ""
    good = one.status in ("solved", "almost solved", "unknown")
    status = (
        f'<b style="color:{css(colours.GREEN if good else colours.RED)}">{escape(one.status)}</b>'
    )
    rows = [
        _row("status", status, "", f"{one.iterations} iterations, slack {_known(one.slack)} m/s")
    ]
    if math.isfinite(one.total):
        share = one.total / PLANNING_LIMIT
        colour = colours.GREEN if share < 0.5 else colours.ORANGE if share < 1.0 else colours.RED
        rows.append(_row("cycle", f"{1e3 * one.total:.2f} ms", _bar(share, colour), "of 100 ms"))
        rows.append(_row("in the solver", f"{1e3 * one.solve:.2f} ms"))
    else:
        rows.append(_row("cycle", "–", "", "not timed in lockstep"))
    rows.append(_row("missed deadlines", str(one.missed), "", f"{one.fallbacks} plans refused"))
    return _section("Planner", _table(rows))


def _timing(groups: Sequence[Timing]) -> str:
    rows = []
    for one in groups:
        share = one.execution_p99 / one.period if one.period > 0.0 else math.nan
        used = f"{1e6 * one.execution_p99:.0f} µs" if math.isfinite(share) else "–"
        bar = _bar(share, colours.GREEN if share < 0.5 else colours.ORANGE)
        rate = f"{1.0 / one.period:.0f} Hz, " if one.period > 0.0 else ""
        rows.append(_row(one.name, used, bar, f"{rate}late {one.late}, skipped {one.skipped}"))
    return _section("Loops, 99th percentile", _table(rows)) if rows else ""


def escape(text: str) -> str:
    """A text as HTML that shows it; what is no UTF-8, as in a file's name, could not be sent."""
    return html.escape(printable(text))


def _known(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "–"


def _limited(name: str, value: float, most: float, unit: str) -> str:
    share = abs(value) / most if most > 0.0 else math.nan
    colour = colours.BLUE if share < 0.8 else colours.ORANGE if share < 0.99 else colours.RED
    return _row(name, f"{value:.2f} {unit}", _bar(share, colour), f"of {most:.4g}")


def _bar(share: float, colour: Rgb) -> str:
    width = 100.0 * min(max(share, 0.0), 1.0) if math.isfinite(share) else 0.0
    return (
        '<div style="width:84px;height:7px;border-radius:3px;background:rgba(127,127,127,.22)">'
        f'<div style="width:{width:.0f}%;height:7px;border-radius:3px;background:{css(colour)}">'
        "</div></div>"
    )


def _row(name: str, value: str, bar: str = "", note: str = "") -> str:
    pad = "padding-right:.7em"
    return (
        f'<tr><td style="{pad}">{name}</td><td style="{_NUMBER};{pad}">{value}</td>'
        f'<td style="{pad}">{bar}</td><td style="opacity:.65;white-space:nowrap">{note}</td></tr>'
    )


def _table(rows: Sequence[str]) -> str:
    return f'<table style="border-collapse:collapse;width:100%">{"".join(rows)}</table>'


def _section(title: str, body: str) -> str:
    return f'<div style="margin:.55em 0 .1em;font-weight:600">{title}</div>{body}'


def _badge(text: str, colour: Rgb) -> str:
    return (
        f'<span style="background:{css(colour)};color:#fff;border-radius:4px;padding:.1em .5em;'
        f'font-weight:600">{escape(text)}</span>'
    )
