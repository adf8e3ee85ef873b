"""Numbers of the paper's vehicle as its file has them, which the flight software needs no more."""

from __future__ import annotations

import math

from vehicles.vehicle_file import load_vehicle

PAPER = load_vehicle("paper")
ROTOR_ARM = math.hypot(*PAPER.rotors[0].position)  # m, L
YAW_PER_THRUST = PAPER.rotors[0].torque_per_thrust  # m, b
