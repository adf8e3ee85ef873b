"""Faults of motors, joints and battery, between the command and the plant."""

from __future__ import annotations

from collections import deque

import numpy as np

from sitl.faults.keys import Fault
from sitl.faults.signal import Windows
from sitl.plant.battery import FULL_V, open_circuit
from sitl.plant.vector import V4

_WRONG = 0.3  # share of the command that a wrong motor gives too little


class MotorFault:
    """Motors that give something else than what is commanded."""

    def __init__(
        self, fault: Fault, random: np.random.Generator, thrust_max: float, step_us: int
    ) -> None:
        """Commands come every ``step_us`` [us]; garbage goes up to ``thrust_max`` [N]."""
        self._fault = fault
        self._random = random
        self._thrust_max = thrust_max
        self._step_us = step_us
        self._windows = Windows(fault.share, random)
        self._line: deque[V4] = deque(maxlen=1 + round(1000.0 * fault.delay_ms / step_us))
        self._kept: V4 | None = None

    def through(self, command: V4, t_us: int) -> V4:
        """What takes effect at ``t_us`` [us] of a ``command`` [N]; to be called once a step."""
        a, b, c, d = self._spoilt(command, t_us)
        hit = [self._fault.hits(k) for k in range(4)]
        return (
            a if hit[0] else command[0],
            b if hit[1] else command[1],
            c if hit[2] else command[2],
            d if hit[3] else command[3],
        )

    def _spoilt(self, command: V4, t_us: int) -> V4:
        fault = self._fault
        if fault.kind == "off":
            return (0.0, 0.0, 0.0, 0.0)
        if fault.kind == "weak":
            return _scaled(fault.share, command)
        if fault.kind == "wrong":
            return _scaled(max(1.0 - _WRONG * fault.size, 0.0), command)
        if fault.kind == "intermittent":
            return (0.0, 0.0, 0.0, 0.0) if self._windows.silent(t_us) else command
        if fault.kind == "garbage":
            w, x, y, z = self._random.uniform(0.0, self._thrust_max, 4).tolist()
            return (w, x, y, z)
        if fault.kind == "delayed":
            self._line.append(command)
            return self._line[0]
        kept = self._kept = self._kept or command
        if fault.kind == "slow":
            share = self._step_us / (1000.0 * fault.delay_ms + self._step_us)
            w, x, y, z = (old + share * (new - old) for old, new in zip(kept, command, strict=True))
            self._kept = (w, x, y, z)
        return self._kept


def battery_charge(fault: Fault) -> float:
    """Charge [1] of a battery that fails."""
    return 0.0 if fault.kind == "off" else fault.share


def thrust_share(charge: float) -> float:
    """Thrust at the same command over that of a full battery [1], at a ``charge`` [1]."""
    return (open_circuit(charge) / FULL_V) ** 2


def _scaled(share: float, command: V4) -> V4:
    a, b, c, d = command
    return (share * a, share * b, share * c, share * d)
