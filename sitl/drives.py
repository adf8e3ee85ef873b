"""Real rotors between the command and the plant: dead time and battery."""

from __future__ import annotations

from sitl.plant.battery import Battery, hover_power
from sitl.plant.esc import DeadTime
from sitl.plant.parameters import Vehicle
from sitl.plant.vector import V4
from sitl.scenario import ActuatorKeys

_MERIT = 0.5  # figure of merit 0.65, motor and controller 0.8


class Drives:
    """What drives the rotors of one flight."""

    def __init__(self, keys: ActuatorKeys, vehicle: Vehicle, first: V4, step_s: float) -> None:
        """Commands come every ``step_s`` [s]; before the first the rotors gave ``first`` [N]."""
        self._radius = vehicle.size.blade
        self._density = vehicle.air.density
        self._step_s = step_s
        exchanges = round(keys.dead_time_ms / (1000.0 * step_s))
        self._dead_time = DeadTime(exchanges, first) if exchanges else None
        self.battery = (
            Battery(keys.battery_a_h, keys.battery_ohm) if keys.battery_a_h > 0.0 else None
        )

    def rotors(self, command: V4, thrust: V4) -> V4:
        """What of a ``command`` [N] takes effect now [N]; the rotors give ``thrust`` [N]."""
        if self._dead_time is not None:
            command = self._dead_time.through(command)
        battery = self.battery
        if battery is not None:
            power = hover_power(thrust, self._radius, self._density, _MERIT)
            battery.draw(power, self._step_s)
            share = battery.thrust_share()
            a, b, c, d = command
            command = (share * a, share * b, share * c, share * d)
        return command
