"""Backlash of a joint's gear: the drive has to cross a gap before it moves the link."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Backlash:
    """One gear between a motor and a link.

    Within the gap the motor is free: its torque accelerates its own inertia alone, and none of it
    reaches the link. Where the teeth meet, the motor takes the link's speed and gives its torque to
    the link for as long as it pushes. Its inertia is not added to the link's then. The encoder is
    on the motor's side.

    Source: M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash - a survey,
    Automatica 38 (2002) 1633, dead-zone model with a stiff, inelastic shaft.
    """

    gap: float  # rad, from one tooth to the other
    inertia: float  # kg·m², of the motor, as seen behind the gear
    position: float = 0.0  # rad, of the motor against the link, within ± half of the gap
    speed: float = 0.0  # rad/s, of the motor

    def step(self, torque: float, rate: float, seconds: float) -> float:
        """Torque on the link [N·m] for a commanded ``torque`` [N·m], over ``seconds`` [s].

        The link turns at a ``rate`` [rad/s]. In the step in which the teeth meet, the link gets the
        torque of the rest of it.
        """
        half = 0.5 * self.gap
        if abs(self.position) >= half and torque * self.position > 0.0:
            self.speed = rate
            return torque
        acceleration = torque / self.inertia
        relative = self.speed - rate
        moved = (relative + 0.5 * acceleration * seconds) * seconds
        ahead = self.position + moved
        self.speed += acceleration * seconds
        if abs(ahead) < half:
            self.position = ahead
            return 0.0
        # They meet: on the side where the motor pushes, or where the link takes it along.
        end = half if ahead > 0.0 else -half
        share = (end - self.position) / moved if moved != 0.0 else 0.0
        self.position, self.speed = end, rate
        return torque * (1.0 - share) if torque * end > 0.0 else 0.0
