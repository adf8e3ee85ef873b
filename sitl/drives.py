"""Real rotors between the command and the plant: dead time and battery."""

from __future__ import annotations

from sitl.faults.actuators import Thrusts, scaled
from sitl.plant.battery import Battery, hover_power
from sitl.plant.esc import DeadTime
from sitl.scenario import ActuatorKeys
from vehicles.description import Vehicle

_MERIT = 0.5  # figure of merit 0.65, motor and controller 0.8


class Drives:
    """What drives the rotors of one flight."""

    def __init__(
        self,
        keys: ActuatorKeys,
        vehicle: Vehicle,
        density: float,
        first: Thrusts,
        step_s: float,
    ) -> None:
        """Commands come every ``step_s`` [s]; before the first the rotors gave ``first`` (r,) [N].

        The air has a ``density`` [kg/m³].
        """
        self._radii = tuple(rotor.radius for rotor in vehicle.rotors)
        self._density = density
        self._step_s = step_s
        exchanges = round(keys.dead_time_ms / (1000.0 * step_s))
        self._dead_time = DeadTime(exchanges, first) if exchanges else None
        self.battery: Battery | None = None
        if keys.battery_a_h > 0.0:
            self.battery = Battery(keys.battery_a_h, keys.battery_ohm, vehicle.battery.full)

    def rotors(self, command: Thrusts, thrust: Thrusts) -> Thrusts:
        """What of a ``command`` (r,) [N] takes effect now; the rotors give ``thrust`` (r,) [N]."""
        if self._dead_time is not None:
            command = self._dead_time.through(command)
        battery = self.battery
        if battery is not None:
            power = hover_power(thrust, self._radii, self._density, _MERIT)
            battery.draw(power, self._step_s)
            command = scaled(battery.thrust_share(), command)
        return command
