"""One class per kind of disturbance; each is sampled in increasing order of steps.

A sample is held over its step, and until the step that ``held_until`` names, before which none has
to be taken: a torque [N·m, B] if ``torque`` is set, else an acceleration [m/s², W].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sitl.disturbances.sequence import Played, Steered
from sitl.scenario import V3, Disturbance, Sequence, Torque, Uniform, Wind
from sitl.seeds import stream

STILL: V3 = (0.0, 0.0, 0.0)


@dataclass
class Resampled:
    """Uniform within ±amplitude on each axis, drawn anew every ``every`` steps."""

    amplitude: float  # m/s², or N·m
    every: int
    torque: bool
    random: np.random.Generator
    _held: V3 = STILL

    def sample(self, step: int) -> V3:
        """The value held over step ``step``."""
        if step % self.every == 0:
            x, y, z = self.random.uniform(-self.amplitude, self.amplitude, 3)
            self._held = (float(x), float(y), float(z))
        return self._held

    def held_until(self, step: int) -> float:
        """The step at which it may have another value than at ``step``, the last one sampled."""
        return (step // self.every + 1) * self.every


@dataclass
class Constant:
    """A constant disturbance."""

    acceleration: V3  # m/s²
    torque = False

    def sample(self, step: int) -> V3:
        """The value held over step ``step``."""
        return self.acceleration

    def held_until(self, step: int) -> float:
        """See :meth:`Resampled.held_until`."""
        return math.inf


class RandomImpulses:
    """Pushes after exponentially distributed pauses, directions uniform on the sphere."""

    torque = False

    def __init__(
        self, magnitude: float, pause_steps: float, length: int, random: np.random.Generator
    ) -> None:
        self._magnitude = magnitude
        self._pause_steps = pause_steps
        self._length = length
        self._random = random
        self._held = STILL
        self._from = self._pause()
        self._until = 0

    def _pause(self) -> int:
        return max(1, round(self._random.exponential(self._pause_steps)))

    def sample(self, step: int) -> V3:
        """The value held over step ``step``."""
        if step == self._from:
            direction = self._random.standard_normal(3)
            x, y, z = self._magnitude * direction / np.linalg.norm(direction)
            self._held = (float(x), float(y), float(z))
            self._until = step + self._length
            self._from = self._until + self._pause()
        return self._held if step < self._until else STILL

    def held_until(self, step: int) -> float:
        """See :meth:`Resampled.held_until`."""
        return self._until if step < self._until else self._from


Push = Resampled | Constant | RandomImpulses | Played | Steered


def push(item: Disturbance, seed: int, step_s: float) -> Push:
    """The running form of one scenario item."""
    if isinstance(item, Wind):
        return Constant(item.acceleration_m_s2)
    if isinstance(item, Sequence):
        first, every = round(item.starts_s / step_s), max(1, round(item.period_s / step_s))
        return Played(item.acceleration_m_s2, first, every)
    random = stream(seed, "disturbance", item.kind, item.name)
    if isinstance(item, Uniform):
        return Resampled(item.amplitude_m_s2, round(item.period_s / step_s), False, random)
    if isinstance(item, Torque):
        return Resampled(item.amplitude_n_m, round(item.period_s / step_s), True, random)
    return RandomImpulses(
        item.magnitude_m_s2,
        item.mean_interval_s / step_s,
        max(1, round(item.duration_s / step_s)),
        random,
    )
