"""The tables in docs/reference/sensors.md: every key of every sensor, and the suites' numbers."""

from __future__ import annotations

import dataclasses
import re
import tomllib
import typing
from typing import Annotated, Any, Final

from sitl.scenario_file import SUITES
from sitl.sensors import keys

BEGIN: Final = "<!-- sensors: make pages -->\n"
END: Final = "<!-- end -->"
NAMES: Final = ("mocap", "vio", "rtk", "gnss")
TABLES: Final[dict[str, type[keys.Timing]]] = {
    "imu": keys.Imu,
    "motion_capture": keys.MotionCapture,
    "visual_odometry": keys.VisualOdometry,
    "gnss": keys.Gnss,
    "barometer": keys.Barometer,
    "magnetometer": keys.Magnetometer,
    "rangefinder": keys.Rangefinder,
    "encoders": keys.Encoders,
    "force_torque": keys.ForceTorque,
}

_POSE: Final = {
    "position_m": "noise of each axis",
    "attitude_deg": "noise about each axis",
    "attitude_resolution_deg": "of a small rotation",
}
MEANINGS: Final[dict[str, dict[str, str]]] = {
    "timing": {
        "rate_hz": "measurements; at most that of the steps, 500",
        "latency_ms": "mean, from measurement to arrival",
        "jitter_ms": "deviation of the latency; messages do not overtake each other",
        "stamp_error_ms": "the stamp says so much later than it was; the vehicle does not know",
        "dropout_share": "of the messages are lost, each for itself",
        "gap_ms": "length of a silence",
        "gap_every_s": "one silence in each such interval, at a random place in it",
        "outlier_share": "of the messages are outliers",
    },
    "imu": {
        "gyro_density_rad_s": "white noise per √Hz; a sample has √rate times as much",
        "accel_density_m_s2": "the same",
        "gyro_bias_rad_s": "deviation of the bias that wanders, a Gauss–Markov process; 0.617 of "
        "it is the bias instability",
        "gyro_bias_time_s": "its correlation time",
        "accel_bias_m_s2": "the same",
        "accel_bias_time_s": "the same",
        "gyro_turn_on_rad_s": "bias drawn once a flight",
        "accel_turn_on_m_s2": "the same",
        "gyro_scale_share": "scale error of each axis, drawn once a flight",
        "accel_scale_share": "the same",
        "misalignment_deg": "of each axis towards each other one, drawn once a flight",
        "gyro_limit_rad_s": "end of the range",
        "accel_limit_m_s2": "the same",
        "vibration_rad_s": "amplitude that one rotor causes in hover; grows with its thrust",
        "vibration_m_s2": "the same",
        "rotor_hz": "turns of a rotor in hover; with the root of its thrust",
    },
    "motion_capture": _POSE,
    "visual_odometry": {
        **_POSE,
        "drift_m": "random walk of the frame, per √s on each axis",
        "drift_deg": "random walk of the frame's yaw, per √s",
        "recognises_every_s": "mean time until the frame jumps back, with a new `reset_counter`",
        "recognised_m": "deviation of the frame after a jump",
        "recognised_deg": "the same, of its yaw",
    },
    "gnss": {
        "horizontal_m": "white noise, north and east",
        "vertical_m": "white noise, down",
        "wander_horizontal_m": "deviation of what changes slowly, a Gauss–Markov process",
        "wander_vertical_m": "the same",
        "wander_time_s": "its correlation time",
        "velocity_m_s": "noise of each axis",
        "position_resolution_deg": "of latitude and longitude; default 1e-7 as in HIL_GPS, 11 mm "
        "northwards",
        "height_resolution_m": "default 0.001 as in HIL_GPS",
        "velocity_resolution_m_s": "default 0.01 as in HIL_GPS",
        "rtk": "says that its fix is one with corrections (`fix_type` 6), or a plain one (3)",
    },
    "barometer": {
        "noise_pa": "white noise",
        "offset_pa": "pressure of the day against the standard, drawn once a flight",
        "drift_pa": "deviation of what changes slowly, a Gauss–Markov process",
        "drift_time_s": "its correlation time",
    },
    "magnetometer": {
        "field_gauss": "the Earth's field, NED",
        "noise_gauss": "white noise of each axis",
        "offset_gauss": "of each axis, drawn once a flight",
        "scale_share": "scale error of each axis, drawn once a flight",
    },
    "rangefinder": {
        "least_m": "nearer, nothing is sent",
        "most_m": "farther, nothing is sent",
        "noise_m": "white noise",
        "scale_share": "scale error, drawn once a flight",
        "outlier_m": "too short",
    },
    "encoders": {
        "noise_rad": "white noise of each joint",
        "offset_rad": "error of each zero, drawn once a flight",
        "outlier_rad": "of the first joint",
    },
    "force_torque": {
        "force_n": "white noise of each axis; default 0.05",
        "torque_n_m": "the same; default 0.002",
        "force_bias_n": "of each axis, drawn once a flight; default 0.2",
        "torque_bias_n_m": "the same; default 0.005",
        "force_resolution_n": "default 0.0125",
        "torque_resolution_n_m": "default 0.0005",
    },
}


def reference() -> str:
    """The tables in Markdown."""
    suites = {name: (SUITES / f"{name}.toml").read_text(encoding="utf-8") for name in NAMES}
    parts = ["### Every sensor\n", _table("timing", keys.Timing, {}, {})]
    parts.append("Below, these have a row where a suite gives a number, and no meaning again.\n")
    numbers = {name: tomllib.loads(text) for name, text in suites.items()}
    notes = {name: _comments(text) for name, text in suites.items()}
    for name, kind in TABLES.items():
        parts.append(f"### `[sensors.{name}]`\n")
        values = {suite: found[name] for suite, found in numbers.items() if name in found}
        said = {suite: found.get(name, {}) for suite, found in notes.items()}
        parts.append(_table(name, kind, values, said))
    parts.append("### Sources\n")
    cited: dict[str, list[str]] = {}
    for name, text in suites.items():
        for source in _sources(text):
            cited.setdefault(source, []).append(name)
    marks = [source.split()[0] for source in cited]
    for source, of in sorted(cited.items(), key=lambda row: int(row[0][1 : row[0].index("]")])):
        only = f" (`{'`, `'.join(of)}`)" if marks.count(source.split()[0]) > 1 else ""
        parts.append(f"- {source}{only}")
    return "\n".join(parts) + "\n"


def inserted(page: str) -> str:
    """The page with the tables as they should be.

    Raises:
        ValueError: The page has no place for them.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError("the page has no place for the sensors")
    return f"{before}{begin}{reference()}{end}{after}"


def _table(
    name: str,
    kind: type[keys.Timing],
    values: dict[str, dict[str, Any]],
    notes: dict[str, dict[str, str]],
) -> str:
    """Every key of one sensor: its own, and those of all sensors that a suite gives."""
    rows = [f"On board in `{'`, `'.join(values)}`.\n"] if values else []
    hints = typing.get_type_hints(kind, include_extras=True)
    common = {field.name for field in dataclasses.fields(keys.Timing)}
    for field in dataclasses.fields(kind):
        given = [found.get(field.name) for found in values.values()]
        if kind is not keys.Timing and field.name in common and not any(given):
            continue
        repeated = kind is not keys.Timing and field.name in common
        meaning = "" if repeated else _meaning(name, field.name)
        allowed = "" if repeated else _allowed(hints[field.name])
        value = _value(dict(zip(values, given, strict=True))) if values else ""
        source = _source([notes[suite].get(field.name, "") for suite in values])
        line = f"- `{field.name}`"
        line += f" ({allowed})" if allowed else ""
        line += f" = {value}" if value else ""
        line += f": {meaning}" if meaning else ""
        line += f" [{source}]" if source else ""
        rows.append(line)
    return "\n".join(rows) + "\n"


def _meaning(name: str, key: str) -> str:
    """What a key means; the head of the page says it of every resolution and outlier."""
    said = MEANINGS[name]
    return said.get(key, "") if re.search("resolution|outlier", key) else said[key]


def _value(given: dict[str, Any]) -> str:
    """What the suites give: one number where they agree, else suite by suite."""
    shown = {suite: _shown(value) for suite, value in given.items() if value is not None}
    if len(shown) == len(given) and len(set(shown.values())) == 1:
        return next(iter(shown.values()))
    return ", ".join(f"`{suite}` {value}" for suite, value in shown.items())


def _allowed(hint: Any) -> str:
    if typing.get_origin(hint) is not Annotated:
        return "true, false"
    plain, permitted = typing.get_args(hint)
    count = len(typing.get_args(plain))
    span = str(permitted).replace(" to ", "…")
    return f"{count} numbers, {span}" if count else span


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(f"{entry:g}" for entry in value) + "]"
    return f"{value:g}"


def _source(said: list[str]) -> str:
    # The head of the page says that a number without a source is our choice.
    sources = (re.sub(r"(, |: )?our choice(: )?", "", text) for text in said)
    return "; ".join(dict.fromkeys(text for text in sources if text))


def _comments(text: str) -> dict[str, dict[str, str]]:
    """What stands behind each key of a suite's file, sensor by sensor."""
    found: dict[str, dict[str, str]] = {}
    table = ""
    for line in text.splitlines():
        heading = re.match(r"\[(\w+)\]", line)
        if heading:
            table = heading.group(1)
            found[table] = {}
        noted = re.match(r"(\w+) = [^#]+# (.+)", line)
        if noted:
            found[table][noted.group(1)] = noted.group(2)
    return found


def _sources(text: str) -> list[str]:
    """The numbered sources at the head of a suite's file, one text each."""
    head = text.partition("\n\n")[0].replace("\n#     ", " ")
    return re.findall(r"^# (\[\d+\] .+)$", head, re.MULTILINE)
