"""Battery: charge, inner resistance, and what its voltage does to the rotors."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

# Open-circuit voltage of a lithium-polymer cell by state of charge, V.
_CURVE = ((0.0, 3.30), (0.05, 3.50), (0.2, 3.70), (0.5, 3.83), (0.8, 4.02), (1.0, 4.20))


def open_circuit(charge: float, full: float) -> float:
    """Voltage without load [V] at a state of ``charge`` [1], of cells that have ``full`` [V] at 1.

    Source: L. Chen, G. Rincón-Mora, Accurate Electrical Battery Model, IEEE Trans. Energy
    Conversion 21 (2006) 504, figure 5, read off at six places.
    """
    for (low, v_low), (high, v_high) in itertools.pairwise(_CURVE):
        if charge <= high:
            share = max(charge - low, 0.0) / (high - low)
            return full / _CURVE[-1][1] * (v_low + share * (v_high - v_low))
    return full


def hover_power(
    thrusts: tuple[float, ...], radii: tuple[float, ...], density: float, merit: float
) -> float:
    r"""Power [W] of rotors that give ``thrusts`` (r,) [N], with ``radii`` (r,) [m], in air.

    .. math:: P = \frac{1}{\mathrm{FM}} \sum_i \frac{T_i^{3/2}}{\sqrt{2 ρ π R_i^2}}

    ``density`` [kg/m³] is the air's; ``merit`` [1] covers figure of merit, motor and controller.

    Source: J. G. Leishman, Principles of Helicopter Aerodynamics, section 2.3.
    """
    air = math.sqrt(2.0 * density * math.pi)
    total = math.fsum(
        max(thrust, 0.0) * math.sqrt(max(thrust, 0.0)) / radius
        for thrust, radius in zip(thrusts, radii, strict=True)
    )
    return total / (air * merit)


@dataclass
class Battery:
    """Cells in series behind a resistance; full, and without load, at first."""

    capacity: float  # A·h
    resistance: float  # Ω, of all cells and leads
    full: float  # V, without load
    charge: float = 1.0  # share of the capacity that is left
    voltage: float = field(init=False)  # V, under load
    at_most: float = 1.0  # charge, while it fails

    def __post_init__(self) -> None:
        self.voltage = self.full

    def draw(self, power: float, seconds: float) -> None:
        """Give a ``power`` [W] for ``seconds`` [s]; the voltage is that under this load.

        With the current i the power is (U₀ − R i) i; beyond its maximum the voltage is half of U₀.
        """
        source = open_circuit(min(self.charge, self.at_most), self.full)
        root = math.sqrt(max(source * source - 4.0 * self.resistance * power, 0.0))
        self.voltage = 0.5 * (source + root)
        current = power / self.voltage
        self.charge = max(self.charge - current * seconds / (3600.0 * self.capacity), 0.0)

    def thrust_share(self) -> float:
        """Thrust at the same command over that of a full battery without load [1].

        The speed of a motor at a fixed duty cycle goes with the voltage, thrust with its square.
        """
        return (self.voltage / self.full) ** 2
