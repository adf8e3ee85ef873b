"""Backlash of a joint's gear: the drive has to cross a gap before it moves the link."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Backlash:
    """One gear whose motor side is light and slow beside the link.

    The motor crosses the gap at a speed that is proportional to its torque, and gives torque to the
    link only where the teeth touch on the side it turns to. The encoder is on the motor's side.

    Source: M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash - a survey,
    Automatica 38 (2002) 1633, dead-zone model, with a motor of no inertia.
    """

    gap: float  # rad, from one tooth to the other
    speed: float  # rad/s, of the free motor at full torque
    torque_max: float  # N·m
    position: float = 0.0  # rad, of the motor against the link, within ± half of the gap

    def step(self, torque: float, rate: float, seconds: float) -> float:
        """Torque on the link [N·m] for a commanded ``torque`` [N·m], after ``seconds`` [s].

        The link turns at a ``rate`` [rad/s].
        """
        half = 0.5 * self.gap
        touches = self.position >= half if torque > 0.0 else self.position <= -half
        moved = (self.speed * torque / self.torque_max - rate) * seconds
        # Teeth that touch and push stay where they are: the motor turns with the link.
        if not touches or torque * moved < 0.0:
            self.position = min(max(self.position + moved, -half), half)
        return torque if touches else 0.0
