"""All sensors of a suite: what arrives from them in each step."""

from __future__ import annotations

from sitl.earth import DEFAULT_ORIGIN, Place
from sitl.seeds import stream
from sitl.sensors.barometer import BarometerSensor
from sitl.sensors.channel import Channel, Sensor
from sitl.sensors.encoders import EncoderSensor
from sitl.sensors.exact import SensorReadings, Thrusts
from sitl.sensors.force_torque import ForceTorqueSensor
from sitl.sensors.gnss import GnssSensor
from sitl.sensors.imu import ImuSensor
from sitl.sensors.keys import MeasuredSensors, Timing
from sitl.sensors.magnetometer import MagnetometerSensor
from sitl.sensors.measurements import Measurement
from sitl.sensors.motion_capture import MotionCaptureSensor
from sitl.sensors.rangefinder import RangefinderSensor
from sitl.sensors.visual_odometry import VisualOdometrySensor
from vehicles.description import Vehicle


class SensorSuite:
    """Every sensor with its channel, in the order in which messages of one step are sent.

    Each sensor draws from a stream of its own, of the seed and its name: another sensor, or a
    disturbance, changes nothing of what it says.
    """

    def __init__(
        self,
        sensors: MeasuredSensors,
        seed: int,
        start_us: int,
        *,
        vehicle: Vehicle,
        hover_thrust: float,
        origin: Place = DEFAULT_ORIGIN,
    ) -> None:
        """Draw the sensors of a ``vehicle`` for a flight that begins at the stamp ``start_us``.

        A rotor gives ``hover_thrust`` [N] in hover; the local frame begins at ``origin``.
        """
        self._channels: list[Channel] = []

        def add(name: str, keys: Timing, sensor: Sensor) -> None:
            random = stream(seed, "sensor", name, "channel")
            self._channels.append(Channel(sensor, keys, random, start_us))

        one = sensors
        if one.motion_capture is not None:
            name, keys = "motion capture", one.motion_capture
            add(name, keys, MotionCaptureSensor(keys, stream(seed, "sensor", name)))
        if one.visual_odometry is not None:
            name, eyes = "visual odometry", one.visual_odometry
            add(name, eyes, VisualOdometrySensor(eyes, stream(seed, "sensor", name)))
        if one.gnss is not None:
            random = stream(seed, "sensor", "gnss")
            add("gnss", one.gnss, GnssSensor(one.gnss, random, origin.latitude))
        if one.barometer is not None:
            name, air = "barometer", one.barometer
            random = stream(seed, "sensor", name)
            add(name, air, BarometerSensor(air, random, origin.altitude))
        if one.magnetometer is not None:
            name, compass = "magnetometer", one.magnetometer
            add(name, compass, MagnetometerSensor(compass, stream(seed, "sensor", name)))
        if one.rangefinder is not None:
            name, ray = "rangefinder", one.rangefinder
            add(name, ray, RangefinderSensor(ray, stream(seed, "sensor", name)))
        if one.force_torque is not None:
            name, touch = "force torque", one.force_torque
            add(name, touch, ForceTorqueSensor(touch, stream(seed, "sensor", name)))
        name = "encoders"
        encoders = EncoderSensor(one.encoders, stream(seed, "sensor", name), len(vehicle.joints))
        add(name, one.encoders, encoders)
        spins = [1.0 if rotor.spin == "ccw" else -1.0 for rotor in vehicle.rotors]
        unit = ImuSensor(one.imu, stream(seed, "sensor", "imu"), hover_thrust, spins)
        add("imu", one.imu, unit)
        self._late = [channel for channel in self._channels if channel.late]
        self._last: tuple[SensorReadings, Thrusts] | None = None  # which they have not measured yet

    def step(self, exact: SensorReadings, thrust: Thrusts) -> list[Measurement]:
        """What arrives in the step of the exact readings; to be called once a step.

        The rotors give ``thrust`` [N].
        """
        self.catch_up()
        self._last = exact, thrust
        t_us = exact.t_us
        arrived: list[Measurement] = []
        for channel in self._channels:
            if t_us >= channel.next_us:
                if channel.late:
                    channel.arrive(t_us, arrived)
                else:
                    channel.step(exact, thrust, arrived)
        return arrived

    def catch_up(self) -> None:
        """Measure what can only arrive later; the next step does so where nobody has."""
        if self._last is not None:
            for channel in self._late:
                channel.measure(*self._last)
            self._last = None
