"""A flight as the report takes it: its log, its margins, its events."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from command_line.bounded_json import JsonError, json_numbers
from view.flight_data import FlightData, Table, UlogError, read_flight
from view.flight_events import events
from view.scene import Event
from view.true_margins import TrueMargins, scenario_of, true_margins

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Worst:
    """The smallest margin of a flight."""

    t: float  # s since the start
    margin: float  # m
    key: str  # zone/part; empty where only the vehicle's estimate knows it


@dataclass(frozen=True, slots=True)
class Reported:
    """One flight."""

    label: str  # short, another one for each flight of a page
    data: FlightData
    margins: TrueMargins | None  # None without the scenario or without truth
    events: tuple[Event, ...]
    numbers: Mapping[str, float]  # of the configuration, exactly, by dotted name

    @property
    def result(self) -> dict[str, Any]:
        """``result.json``; empty where there is none."""
        found: dict[str, Any] = self.data.beside.get("result", {})
        return found

    @property
    def worst(self) -> Worst | None:
        """By the simulator's result, else by the logged truth, else by the vehicle's estimate."""
        sitl = self.data.beside.get("sitl", {})
        if sitl.get("min_margin_m") is not None:
            return Worst(sitl["min_margin_time_s"], sitl["min_margin_m"], sitl["min_margin_key"])
        if self.margins is not None and np.isfinite(self.margins.least).any():
            k = int(self.margins.least.argmin())
            key = self.margins.keys[int(self.margins.values[k].argmin())]
            return Worst(self.since(self.margins.t)[k], float(self.margins.least[k]), key)
        estimated = self.table("barrier_margin")
        if estimated is None or not np.isfinite(estimated["minimum"]).any():
            return None
        k = int(np.nanargmin(estimated["minimum"]))
        return Worst(float(self.since(estimated.t)[k]), float(estimated["minimum"][k]), "")

    def table(self, name: str) -> Table | None:
        """Records of a topic; None where there are none."""
        return self.data.tables.get(name)

    def since(self, t: Array) -> Array:
        """Sensor times ``t`` (n,) [s] as times since the start [s]."""
        return t - self.data.begin

    def number(self, name: str) -> float:
        """A limit or setting [its own unit] by its dotted name; NaN where the log has none."""
        return float(self.numbers.get(name, np.nan))


def reported(path: Path, label: str) -> Reported:
    """Read a flight, by its directory or its log.

    Raises:
        UlogError: The log cannot be read, or a result beside it cannot be used.
    """
    data = read_flight(path)
    for sentence in data.unusable:
        raise UlogError(f"{sentence}; the log alone can be reported without this file")
    try:
        numbers = json_numbers(str(data.information.get("numbers", "{}")))
    except JsonError as problem:
        raise UlogError(f"{data.path} is damaged: its information numbers {problem}") from None
    scenario = scenario_of(data)
    return Reported(
        label=label,
        data=data,
        margins=None if scenario is None else true_margins(data, scenario),
        events=events(data),
        numbers=numbers,
    )
