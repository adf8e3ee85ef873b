"""All sensors of a suite: what arrives from them in each step."""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
from typing import Final

import sitl.sensors
from sitl.earth import DEFAULT_ORIGIN, Place
from sitl.seeds import stream
from sitl.sensors.channel import Aboard, Channel, Measurement, SensorModel
from sitl.sensors.exact import SensorReadings, Thrusts
from sitl.sensors.keys import MeasuredSensors, Timing
from vehicles.description import Vehicle


def _found() -> dict[type[Timing], type[SensorModel]]:
    """The model of each module of this folder that has one, by its keys."""
    for module in pkgutil.iter_modules(sitl.sensors.__path__):
        importlib.import_module(f"sitl.sensors.{module.name}")
    return {model.kind: model for model in SensorModel.__subclasses__()}


MODELS: Final = _found()


class SensorSuite:
    """Every sensor with its channel, in the order in which messages of one step are sent.

    Each sensor draws from a stream of its own, of the seed and its name: another sensor, or a
    disturbance, changes nothing of what it says.
    """

    def __init__(
        self,
        sensors: MeasuredSensors,
        seed: int,
        start_us: int,
        *,
        vehicle: Vehicle,
        hover_thrust: float,
        origin: Place = DEFAULT_ORIGIN,
    ) -> None:
        """Draw the sensors of a ``vehicle`` for a flight that begins at the stamp ``start_us``.

        A rotor gives ``hover_thrust`` [N] in hover; the local frame begins at ``origin``.
        """
        where = Aboard(vehicle, hover_thrust, origin)
        self._channels: list[Channel] = []
        for field in dataclasses.fields(sensors):
            keys, name = getattr(sensors, field.name), field.name.replace("_", " ")
            if isinstance(keys, Timing):
                sensor = MODELS[type(keys)].aboard(keys, stream(seed, "sensor", name), where)
                random = stream(seed, "sensor", name, "channel")
                self._channels.append(Channel(sensor, keys, random, start_us))
        self._late = [channel for channel in self._channels if channel.late]
        self._last: tuple[SensorReadings, Thrusts] | None = None  # which they have not measured yet

    def step(self, exact: SensorReadings, thrust: Thrusts) -> list[Measurement]:
        """What arrives in the step of the exact readings; to be called once a step.

        The rotors give ``thrust`` [N].
        """
        self.catch_up()
        self._last = exact, thrust
        t_us = exact.t_us
        arrived: list[Measurement] = []
        for channel in self._channels:
            if t_us >= channel.next_us:
                if channel.late:
                    channel.arrive(t_us, arrived)
                else:
                    channel.step(exact, thrust, arrived)
        return arrived

    def catch_up(self) -> None:
        """Measure what can only arrive later; the next step does so where nobody has."""
        if self._last is not None:
            for channel in self._late:
                channel.measure(*self._last)
            self._last = None
