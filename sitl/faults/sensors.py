"""Faults between the sensors and what is sent of them."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from sitl.faults.keys import Fault
from sitl.faults.signal import SignalFault
from sitl.sensors.channel import Measurement
from sitl.sensors.exact import SensorReadings
from sitl.sensors.suite import MODELS

_TYPES: Final = {unit: model.says for kind, model in MODELS.items() for unit in kind.units}


class FrameFault:
    """A fault of the exact states, of which there is one sample every step, whatever happens.

    A unit that is silent says that it has no number; one that is late or slow repeats the last.
    """

    def __init__(self, fault: Fault, random: np.random.Generator) -> None:
        self._signal: SignalFault[SensorReadings] = SignalFault(fault, random)
        self._held: SensorReadings | None = None

    def spoil(self, exact: SensorReadings) -> SensorReadings:
        """The sample that is sent of an ``exact`` one; to be called once a step."""
        signal, t_us = self._signal, exact.t_us
        if self._held is None:
            self._held = exact
        said = signal.read(t_us, exact)
        for late in signal.due(t_us):
            said = late
        if said is None:
            if signal.fault.kind in ("off", "intermittent"):
                return signal.silenced(exact)
            return signal.merged(exact, self._held)
        self._held = said
        return signal.merged(exact, said)


class SuiteFault:
    """A fault of one sensor of a suite: its messages are changed, held back or lost.

    Gyro and accelerometer are one chip with one message: what is lost or late is so of both.
    """

    def __init__(self, fault: Fault, random: np.random.Generator) -> None:
        self._signal: SignalFault[Any] = SignalFault(fault, random)
        self._type = _TYPES[fault.unit]

    def spoil(self, t_us: int, arrived: tuple[Measurement, ...]) -> tuple[Measurement, ...]:
        """What arrives in the step of ``t_us`` [us] in place of ``arrived``; once a step."""
        signal = self._signal
        said: list[Measurement] = []
        for one in arrived:
            kept = signal.read(t_us, one) if isinstance(one, self._type) else one
            if kept is not None:
                said.append(kept)
        return (*signal.due(t_us), *said)
