"""Faults of motors, joints and battery, between the command and the plant."""

from __future__ import annotations

from collections import deque
from typing import TypeAlias

import numpy as np

from sitl.faults.keys import Fault
from sitl.faults.signal import Windows
from sitl.plant.battery import open_circuit

Thrusts: TypeAlias = tuple[float, ...]  # (r,) N

_WRONG = 0.3  # share of the command that a wrong motor gives too little


class MotorFault:
    """Motors that give something else than what is commanded."""

    def __init__(
        self, fault: Fault, random: np.random.Generator, full: tuple[float, ...], step_us: int
    ) -> None:
        """Commands come every ``step_us`` [us]; garbage goes up to ``full`` (r,) [N]."""
        self._fault = fault
        self._random = random
        self._full = full
        self._step_us = step_us
        self._windows = Windows(fault.share, random)
        self._line: deque[Thrusts] = deque(maxlen=1 + round(1000.0 * fault.delay_ms / step_us))
        self._kept: Thrusts = ()

    def through(self, command: Thrusts, t_us: int) -> Thrusts:
        """What takes effect at ``t_us`` [us] of a ``command`` (r,) [N]; called once a step."""
        spoilt = self._spoilt(command, t_us)
        return tuple(
            wrong if self._fault.hits(k) else right
            for k, (wrong, right) in enumerate(zip(spoilt, command, strict=True))
        )

    def _spoilt(self, command: Thrusts, t_us: int) -> Thrusts:
        fault = self._fault
        if fault.kind == "off":
            return scaled(0.0, command)
        if fault.kind == "weak":
            return scaled(fault.share, command)
        if fault.kind == "wrong":
            return scaled(max(1.0 - _WRONG * fault.size, 0.0), command)
        if fault.kind == "intermittent":
            return scaled(0.0, command) if self._windows.silent(t_us) else command
        if fault.kind == "garbage":
            return tuple(self._random.uniform(0.0, self._full).tolist())
        if fault.kind == "delayed":
            self._line.append(command)
            return self._line[0]
        kept = self._kept = self._kept or command
        if fault.kind == "slow":
            share = self._step_us / (1000.0 * fault.delay_ms + self._step_us)
            self._kept = tuple(
                old + share * (new - old) for old, new in zip(kept, command, strict=True)
            )
        return self._kept


def battery_charge(fault: Fault) -> float:
    """Charge [1] of a battery that fails."""
    return 0.0 if fault.kind == "off" else fault.share


def thrust_share(charge: float) -> float:
    """Thrust at the same command over that of a full battery [1], at a ``charge`` [1]."""
    return open_circuit(charge, 1.0) ** 2


def scaled(share: float, command: Thrusts) -> Thrusts:
    """A ``share`` [1] of a ``command`` (r,) [N]."""
    return tuple([share * one for one in command])
