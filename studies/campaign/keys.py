"""What a campaign may vary, by the keys of its file: where a value goes, and which are allowed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Annotated, Any, Final, get_args, get_origin, get_type_hints

from command_line.ranges import Range
from command_line.toml_tables import nearest
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.autopilot.tuning import tuned
from sitl.scenario import Scenario, Wind
from sitl.sensors.keys import MeasuredSensors, Timing

LATENCY, PUSH, AIR, DIRECTION = "latency_ms", "wind_m_s2", "wind_m_s", "wind_direction_deg"
PARAMETERS: Final = "parameters"
FAULT: Final = "fault"
_STEP_MS: Final = 2.0  # of the simulator
_OWN: Final[dict[str, tuple[Range, str]]] = {
    LATENCY: (Range(0.0, 1000.0, step=_STEP_MS), "every sensor so much later"),
    PUSH: (Range(0.0, 50.0), "a constant horizontal acceleration"),
    AIR: (Range(0.0, 30.0), "a constant horizontal wind"),
    DIRECTION: (Range(-360.0, 360.0), "where either goes, from north over east"),
}


class CampaignError(ValueError):
    """A campaign that cannot be flown, in one sentence with what to do."""


@dataclass(frozen=True, slots=True)
class Flown:
    """What flies: everything that a value can change."""

    scenario: Scenario
    config: FlightConfig


def range_of(key: str, flown: Flown) -> Range:
    """Which values a key may have where this flies.

    Raises:
        CampaignError: There is no such key.
    """
    first, _, rest = key.partition(".")
    if key in _OWN:
        if key == AIR:
            _check_drag(flown.scenario)
        return _OWN[key][0]
    if first == PARAMETERS:
        if rest not in BY_NAME:
            raise CampaignError(f'unknown parameter "{rest}"{nearest(rest, BY_NAME)}')
        parameter = BY_NAME[rest]
        return Range(parameter.least, parameter.most)
    if first == FAULT:
        if not flown.scenario.faults:
            return Range(-math.inf, math.inf)  # a case without it
        return _range_at(flown.scenario.faults[-1], rest.split("."), key)
    return _range_at(flown.scenario, key.split("."), key)


def applied(flown: Flown, values: Iterable[tuple[str, float]]) -> Flown:
    """What flies, changed; every key must be known."""
    found = dict(values)
    scenario, config = flown.scenario, flown.config
    direction = found.pop(DIRECTION, 0.0)
    numbers: list[tuple[str, float]] = []
    for key, value in found.items():
        first, _, rest = key.partition(".")
        if first == PARAMETERS:
            parameter = BY_NAME[rest]
            numbers.append((parameter.path, parameter.scale * value))
        elif first == FAULT:
            if scenario.faults:
                last = with_number(scenario.faults[-1], rest.split("."), value)
                scenario = replace(scenario, faults=(*scenario.faults[:-1], last))
        elif key in _CHANGES:
            scenario = _CHANGES[key](scenario, value, direction)
        else:
            scenario = with_number(scenario, key.split("."), value)
    return Flown(scenario, tuned(config, tuple(numbers)))


def rounded(key: str, value: float, allowed: Range) -> float:
    """The nearest ``value`` [of the key] that a key can have: in steps, or in single precision."""
    first, _, rest = key.partition(".")
    if first == PARAMETERS:
        return BY_NAME[rest].kept(value)  # as a vehicle keeps it
    if allowed.step is None:
        return value
    return min(max(round(value / allowed.step) * allowed.step, allowed.low), allowed.high)


def later(scenario: Scenario, latency_ms: float) -> Scenario:
    """Every sensor ``latency_ms`` [ms] later; a suite's own latencies come on top."""
    sensors = scenario.sensors
    changed: dict[str, Any] = {}
    for field in fields(sensors):
        sensor = getattr(sensors, field.name)
        if isinstance(sensor, Timing) or (
            sensor is not None and not isinstance(sensors, MeasuredSensors)
        ):
            late = sensor.latency_ms + latency_ms
            changed[field.name] = replace(sensor, latency_ms=late)
    return replace(scenario, sensors=replace(sensors, **changed))


def _pushed(scenario: Scenario, push: float, direction_deg: float) -> Scenario:
    north, east = _horizontal(push, direction_deg)
    wind = Wind((north, east, 0.0), name="campaign")
    return replace(scenario, disturbances=(*scenario.disturbances, wind))


def _windy(scenario: Scenario, wind_m_s: float, direction_deg: float) -> Scenario:
    north, east = _horizontal(wind_m_s, direction_deg)
    return replace(scenario, air=replace(scenario.air, wind_m_s=(north, east, 0.0)))


_CHANGES: Final[dict[str, Callable[[Scenario, float, float], Scenario]]] = {
    LATENCY: lambda scenario, latency_ms, _: later(scenario, latency_ms),
    PUSH: _pushed,
    AIR: _windy,
}


def _horizontal(size: float, direction_deg: float) -> tuple[float, float]:
    angle = math.radians(direction_deg)
    return size * math.cos(angle), size * math.sin(angle)


def _check_drag(scenario: Scenario) -> None:
    air = scenario.air
    if not (any(air.rotor_drag_1_s) or air.body_drag_m2):
        raise CampaignError(
            f'{AIR}: the air of scenario "{scenario.name}" moves nothing, because it has neither '
            f"rotor_drag_1_s nor body_drag_m2; set one of them there, or vary {PUSH}"
        )


def _range_at(value: Any, path: list[str], key: str) -> Range:
    """The range of a number somewhere in frozen dataclasses and tuples of them."""
    allowed: Range | None = None
    for name in path:
        if isinstance(value, tuple):
            if name not in map(str, range(len(value))):
                known = ", ".join(str(i) for i in range(len(value))) or "none"
                raise CampaignError(f'unknown key "{key}": "{name}" is not a place ({known})')
            value = value[int(name)]
        elif is_dataclass(value):
            hints = get_type_hints(type(value), include_extras=True)
            if name not in hints:
                near = nearest(name, hints)
                known = "" if near else f" (known here: {', '.join(hints)})"
                raise CampaignError(f'unknown key "{key}"{near}{known}')
            hint, value = hints[name], getattr(value, name)
            allowed = get_args(hint)[1] if get_origin(hint) is Annotated else None
        else:
            raise CampaignError(f'unknown key "{key}": there is nothing below a number')
    if allowed is None or not isinstance(value, float | int) or isinstance(value, bool):
        raise CampaignError(f'key "{key}" is not a number that can vary')
    return allowed


def with_number(value: Any, path: list[str], number: float) -> Any:
    """A tree of frozen dataclasses and tuples with another ``number`` [the key's] at a path."""
    if not path:
        return number
    name, *rest = path
    if isinstance(value, tuple):
        place = int(name)
        return (*value[:place], with_number(value[place], rest, number), *value[place + 1 :])
    return replace(value, **{name: with_number(getattr(value, name), rest, number)})
