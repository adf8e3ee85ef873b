"""What a simulated flight consists of, as frozen data; read from TOML by ``scenario_file``.

A key is declared once: its name carries the unit, its annotation the type and the allowed range.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Final, Literal, TypeAlias

from command_line.ranges import Range as Range
from sitl.faults.keys import Fault
from sitl.ranges import NORMAL as NORMAL
from sitl.ranges import V2 as V2
from sitl.ranges import V3 as V3
from sitl.ranges import WORLD_M as WORLD_M
from sitl.sensors.keys import MeasuredSensors
from vehicles.description import Vehicle

PAPER: Final = "paper"  # the vehicle of a scenario that names none


@dataclass(frozen=True, slots=True)
class Start:
    """How the flight begins."""

    kind: Literal["airborne", "ground"]
    # Joint angles; none: the vehicle's home posture.
    arm_deg: tuple[Annotated[float, Range(-720.0, 720.0)], ...] = ()
    yaw_deg: Annotated[float, Range(-180.0, 180.0)] = 0.0
    position_m: Annotated[V2, Range(-WORLD_M, WORLD_M)] = (0.0, 0.0)  # ground start


@dataclass(frozen=True, slots=True)
class Pilot:
    """What the scenario's pilot asks of the vehicle, by messages."""

    plan: Literal["none", "trajectory", "hop"]
    start_delay_s: Annotated[float, Range(0.0, 60.0)] = 1.0
    takeoff_height_m: Annotated[float, Range(0.4, 50.0)] = 1.5
    # When it tells the gripper to close, and to open, since the simulation's start.
    grab_s: Annotated[float, Range(0.0, 86400.0, or_inf=True)] = math.inf
    release_s: Annotated[float, Range(0.0, 86400.0, or_inf=True)] = math.inf


@dataclass(frozen=True, slots=True)
class Lissajous:
    """Sinusoids per axis, started and stopped smoothly."""

    centre_m: Annotated[V3, Range(-WORLD_M, WORLD_M)]
    amplitude_m: Annotated[V3, Range(0.0, WORLD_M)]
    period_s: Annotated[V3, Range(1.0, 3600.0)]
    phase_deg: Annotated[V3, Range(-360.0, 360.0)]
    ramp_s: Annotated[float, Range(0.1, 600.0)]
    duration_s: Annotated[float, Range(1.0, 86400.0)]
    # "walls" turns the arm's plane to the nearest wall; "start" keeps the yaw of the start.
    heading: Literal["start", "walls"] = "start"
    kind: Literal["lissajous"] = "lissajous"


@dataclass(frozen=True, slots=True)
class Hold:
    """One position."""

    position_m: Annotated[V3, Range(-WORLD_M, WORLD_M)]
    kind: Literal["hold"] = "hold"


@dataclass(frozen=True, slots=True)
class Points:
    """Places at times, with a spline through them; held before the first and after the last."""

    time_s: tuple[Annotated[float, Range(0.0, 86400.0)], ...]  # since the trajectory's start
    position_m: tuple[Annotated[V3, Range(-WORLD_M, WORLD_M)], ...]
    yaw_deg: tuple[Annotated[float, Range(-36000.0, 36000.0)], ...] = ()  # none: that of the start
    ends: Literal["rest", "free"] = "rest"  # "free": the spline's own speed at both ends
    kind: Literal["points"] = "points"


@dataclass(frozen=True, slots=True)
class Circle:
    """A level circle, started and stopped smoothly."""

    centre_m: Annotated[V3, Range(-WORLD_M, WORLD_M)]
    radius_m: Annotated[float, Range(0.0, WORLD_M)]
    period_s: Annotated[float, Range(1.0, 3600.0)]
    ramp_s: Annotated[float, Range(0.1, 600.0)]
    duration_s: Annotated[float, Range(1.0, 86400.0)]
    start_deg: Annotated[float, Range(-360.0, 360.0)] = 0.0  # from north, seen from the centre
    clockwise: bool = True  # seen from above
    heading: Literal["start", "walls"] = "start"
    kind: Literal["circle"] = "circle"


@dataclass(frozen=True, slots=True)
class Polynomial:
    """Polynomials of the time, c0 + c1 t + c2 t^2 + …, held after their end."""

    north: tuple[Annotated[float, Range(-WORLD_M, WORLD_M)], ...]  # c0 [m], c1 [m/s], …
    east: tuple[Annotated[float, Range(-WORLD_M, WORLD_M)], ...]
    down: tuple[Annotated[float, Range(-WORLD_M, WORLD_M)], ...]
    duration_s: Annotated[float, Range(1.0, 86400.0)]
    heading: Literal["start", "walls"] = "start"
    kind: Literal["polynomial"] = "polynomial"


@dataclass(frozen=True, slots=True)
class Push:
    """Presses on a surface in one place after the other, and stands back between them.

    To each place it goes from a stand-off in front of it, presses, slides if asked to, and retreats
    the same way. It begins at the first stand-off and ends at the last.
    """

    normal: Annotated[V3, NORMAL]  # unit, NED, out of the surface
    # Of the end-effector where its tip just touches: its radius in front of the surface.
    position_m: tuple[Annotated[V3, Range(-WORLD_M, WORLD_M)], ...]
    force_n: tuple[Annotated[float, Range(0.1, 200.0)], ...]  # along the normal, in each place
    hold_s: tuple[Annotated[float, Range(0.0, 3600.0)], ...]  # with that force
    slide_m: tuple[Annotated[V3, Range(-10.0, 10.0)], ...] = ()  # along the surface meanwhile
    away_m: Annotated[float, Range(0.01, 10.0)] = 0.15  # of the stand-off
    approach_s: Annotated[float, Range(0.1, 600.0)] = 3.0  # from the stand-off, and back to it
    ramp_s: Annotated[float, Range(0.1, 60.0)] = 1.0  # from no force to all of it, and back
    move_s: Annotated[float, Range(0.1, 600.0)] = 5.0  # from one stand-off to the next
    kind: Literal["push"] = "push"


Trajectory: TypeAlias = Lissajous | Hold | Points | Circle | Polynomial | Push


@dataclass(frozen=True, slots=True)
class ScenarioWall:
    """A plane; free space is where n·p > offset."""

    name: str
    normal: Annotated[V3, NORMAL]  # unit, NED, into free space
    offset_m: Annotated[float, Range(-WORLD_M, WORLD_M)]
    clearance_m: Annotated[float, Range(0.0, 10.0)]  # s_min


@dataclass(frozen=True, slots=True)
class Obstacle:
    """An obstacle without a size of its own, such as the tip of a branch."""

    name: str
    position_m: Annotated[V3, Range(-WORLD_M, WORLD_M)]
    clearance_m: Annotated[float, Range(0.001, 10.0)]  # d_s


@dataclass(frozen=True, slots=True)
class Workspace:
    """Sphere the base must stay in, riding above the end-effector's reference."""

    radius_m: Annotated[float, Range(0.001, 10.0)]
    d_iw_m: Annotated[float, Range(0.0, 10.0)]


@dataclass(frozen=True, slots=True)
class WayPoint:
    """Where a zone is at a time, as seen from where it begins."""

    time_s: Annotated[float, Range(0.0, 86400.0)]  # since the start of the simulation
    moved_m: Annotated[V3, Range(-WORLD_M, WORLD_M)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """What the tool meets that touches a zone; the law is in ``sitl.plant.contact``."""

    stiffness_n_m: Annotated[float, Range(10.0, 100000.0)]
    # Least and greatest, as the vehicle is told; the true one may lie outside.
    stiffness_range_n_m: Annotated[V2, Range(10.0, 100000.0)]
    force_max_n: Annotated[float, Range(0.1, 200.0)]  # that the normal force is not to exceed
    dissipation_s_m: Annotated[float, Range(0.0, 100.0)] = 4.0
    friction: Annotated[float, Range(0.0, 2.0)] = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioZone:
    """What all zones have; what a shape adds is in its file in ``sitl/shapes``."""

    name: str
    clearance_m: Annotated[float, Range(0.0, 10.0)]
    keep_in: bool = False  # to stay inside of
    velocity_m_s: Annotated[V3, Range(-20.0, 20.0)] = (0.0, 0.0, 0.0)
    starts_s: Annotated[float, Range(0.0, 86400.0)] = 0.0  # to move with that velocity
    way_points: tuple[WayPoint, ...] = ()  # in place of a velocity: straight from one to the next
    touch: Touch | None = None  # the tool may touch it; every other part keeps clear

    def numbers(self, moved: V3) -> tuple[float, ...]:
        """The numbers of PANDION_SHAPE for a zone that has ``moved`` [m, NED]."""
        raise NotImplementedError

    def problem(self) -> str | None:
        """Key, value and what is allowed, where its numbers contradict each other."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """A rigid body that the tool takes up and lets go of, by time or by the gripper."""

    mass_kg: Annotated[float, Range(0.001, 0.5)]
    # Principal, about its centre and the axes of the last link as the vehicle's file has them.
    inertia_kg_m2: Annotated[V3, Range(0.0, 0.1)] = (0.0, 0.0, 0.0)
    offset_m: Annotated[V3, Range(-1.0, 1.0)] = (0.0, 0.0, 0.0)  # from the end-effector, likewise
    attach_at_s: Annotated[float, Range(0.0, 86400.0)] = 0.0  # since the simulation's start
    release_at_s: Annotated[float, Range(0.0, 86400.0, or_inf=True)] = math.inf
    gripper: bool = False  # in place of both times: when it is told to close, and to open
    # Where it lies: taken up only by an end-effector within reach of it. None: wherever that is.
    position_m: Annotated[V3, Range(-WORLD_M, WORLD_M)] | None = None
    reach_m: Annotated[float, Range(0.001, 1.0)] = 0.03


Body: TypeAlias = Literal["points", "full"]


@dataclass(frozen=True, slots=True)
class Uniform:
    """Acceleration drawn uniformly from ±amplitude per axis, anew every period."""

    amplitude_m_s2: Annotated[float, Range(0.0, 50.0)]
    period_s: Annotated[float, Range(0.002, 3600.0)] = 0.1
    name: str = "uniform"
    kind: Literal["uniform"] = "uniform"


@dataclass(frozen=True, slots=True)
class Wind:
    """Constant acceleration, NED."""

    acceleration_m_s2: Annotated[V3, Range(-50.0, 50.0)]
    name: str = "wind"
    kind: Literal["wind"] = "wind"


@dataclass(frozen=True, slots=True)
class Impulses:
    """Pushes of fixed size and length in random directions after random pauses."""

    mean_interval_s: Annotated[float, Range(0.01, 3600.0)]
    magnitude_m_s2: Annotated[float, Range(0.0, 200.0)]
    duration_s: Annotated[float, Range(0.002, 60.0)]
    name: str = "impulses"
    kind: Literal["impulses"] = "impulses"


@dataclass(frozen=True, slots=True)
class Torque:
    """Torque on the base drawn uniformly from ±amplitude per axis, anew every period."""

    amplitude_n_m: Annotated[float, Range(0.0, 10.0)]
    period_s: Annotated[float, Range(0.002, 3600.0)] = 0.1
    name: str = "torque"
    kind: Literal["torque"] = "torque"


@dataclass(frozen=True, slots=True)
class Sequence:
    """Accelerations written down one after the other, NED; nothing before and after them."""

    acceleration_m_s2: tuple[Annotated[V3, Range(-50.0, 50.0)], ...]
    period_s: Annotated[float, Range(0.002, 3600.0, step=0.002)] = 0.1  # for which each holds
    starts_s: Annotated[float, Range(0.0, 86400.0, step=0.002)] = 0.0  # since the simulation's
    name: str = "sequence"
    kind: Literal["sequence"] = "sequence"


Disturbance: TypeAlias = Uniform | Wind | Impulses | Torque | Sequence


@dataclass(frozen=True, slots=True)
class ImuErrors:
    """Standard deviations per sample and delay of the inertial unit."""

    gyro_rad_s: Annotated[float, Range(0.0, 10.0)] = 0.0
    accel_m_s2: Annotated[float, Range(0.0, 100.0)] = 0.0
    latency_ms: Annotated[float, Range(0.0, 1000.0, step=2.0)] = 0.0


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """Standard deviations per sample and delay of position, velocity, attitude and rates."""

    position_m: Annotated[float, Range(0.0, 10.0)] = 0.0
    velocity_m_s: Annotated[float, Range(0.0, 10.0)] = 0.0
    attitude_rad: Annotated[float, Range(0.0, 1.0)] = 0.0
    rate_rad_s: Annotated[float, Range(0.0, 10.0)] = 0.0
    latency_ms: Annotated[float, Range(0.0, 1000.0, step=2.0)] = 0.0


@dataclass(frozen=True, slots=True)
class EncoderErrors:
    """Standard deviations per sample and delay of the joint encoders."""

    angle_rad: Annotated[float, Range(0.0, 1.0)] = 0.0
    rate_rad_s: Annotated[float, Range(0.0, 10.0)] = 0.0
    torque_n_m: Annotated[float, Range(0.0, 10.0)] = 0.0
    latency_ms: Annotated[float, Range(0.0, 1000.0, step=2.0)] = 0.0


@dataclass(frozen=True, slots=True)
class Sensors:
    """The suite ``perfect``: the true state at every step, without errors by default."""

    imu: ImuErrors = ImuErrors()
    pose: PoseErrors = PoseErrors()
    encoders: EncoderErrors = EncoderErrors()


@dataclass(frozen=True, slots=True)
class VehicleScale:
    """How the real vehicle differs from what the controller believes."""

    mass: Annotated[float, Range(0.2, 5.0)] = 1.0
    inertia: Annotated[float, Range(0.2, 5.0)] = 1.0
    rotor_lag: Annotated[float, Range(0.1, 10.0)] = 1.0
    joint_friction: Annotated[float, Range(0.0, 100.0)] = 1.0


@dataclass(frozen=True, slots=True)
class AirKeys:
    """Real air; still, and felt by nothing but the rotors, by default."""

    wind_m_s: Annotated[V3, Range(-30.0, 30.0)] = (0.0, 0.0, 0.0)  # NED, where the air goes
    turbulence_m_s: Annotated[float, Range(0.0, 40.0)] = 0.0  # wind at 20 ft of MIL-F-8785C
    turbulence_height_m: Annotated[float, Range(3.048, 304.8)] = 3.048
    rotor_drag_1_s: Annotated[V3, Range(0.0, 5.0)] = (0.0, 0.0, 0.0)  # per mass, body axes
    body_drag_m2: Annotated[float, Range(0.0, 1.0)] = 0.0  # drag coefficient times area
    ground_effect: bool = False
    ceiling_effect: bool = False
    wall_suction: Annotated[float, Range(0.0, 0.5)] = 0.0  # of the thrust, where blades touch


@dataclass(frozen=True, slots=True)
class ActuatorKeys:
    """Real actuators; ideal by default, but for what the vehicle always has."""

    quadratic_thrust: bool = False  # the rotor's speed lags, and thrust is its square
    dead_time_ms: Annotated[float, Range(0.0, 100.0, step=2.0)] = 0.0  # of the motor controllers
    battery_a_h: Annotated[float, Range(0.0, 100.0)] = 0.0  # 0: a source that never sags
    battery_ohm: Annotated[float, Range(0.0, 1.0)] = 0.02
    # Of each joint's motor, as the joint feels it: times the square of the gear's ratio.
    motor_inertia_kg_m2: Annotated[float, Range(0.0, 0.1)] = 0.0
    backlash_deg: Annotated[float, Range(0.0, 5.0)] = 0.0  # of each joint's gear


@dataclass(frozen=True, slots=True)
class Scenario:
    """One flight."""

    name: str
    duration_s: Annotated[float, Range(0.1, 86400.0, or_inf=True)]
    start: Start
    pilot: Pilot
    trajectory: Trajectory
    description: str = ""
    vehicle: str = PAPER  # one that comes with Pandion, or the path of a vehicle file
    # What of the vehicle keeps clear and is judged: the paper's three points, or all of it.
    body: Body = "full"
    walls: tuple[ScenarioWall, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    workspace: Workspace | None = None
    zones: tuple[ScenarioZone, ...] = ()
    payload: Payload | None = None
    disturbances: tuple[Disturbance, ...] = ()
    sensors: Sensors | MeasuredSensors = Sensors()
    vehicle_scale: VehicleScale = VehicleScale()
    air: AirKeys = AirKeys()
    actuators: ActuatorKeys = ActuatorKeys()
    faults: tuple[Fault, ...] = ()

    def __post_init__(self) -> None:
        """Name a vehicle's file from the root: found from any directory, wherever this goes."""
        if is_vehicle_file(self.vehicle):
            object.__setattr__(self, "vehicle", str(Path(self.vehicle).absolute()))


def is_vehicle_file(vehicle: str) -> bool:
    """Whether a vehicle is named by its file, and not one of those that come with Pandion."""
    return vehicle.endswith(".toml")


@lru_cache(maxsize=16)
def _vehicle(name_or_path: str, _written_ns: int) -> Vehicle:
    # Loads numpy, for which whoever only reads a scenario need not wait.
    from vehicles.vehicle_file import load_vehicle

    return load_vehicle(name_or_path)


def vehicle_of(scenario: Scenario) -> Vehicle:
    """The vehicle that a scenario is flown with, as its file describes it.

    Raises:
        VehicleError: There is no such file, or it describes none.
    """
    path = Path(scenario.vehicle)
    return _vehicle(scenario.vehicle, path.stat().st_mtime_ns if path.is_file() else 0)


def identity(scenario: Scenario) -> tuple[Scenario, Vehicle]:
    """What a flight depends on: the vehicle as it is described, not where its file lies."""
    return replace(scenario, vehicle=""), vehicle_of(scenario)


def start_angles(scenario: Scenario) -> tuple[float, ...]:
    """Joint angles [rad] with which a flight begins in the air."""
    given = scenario.start.arm_deg
    return tuple(map(math.radians, given)) if given else vehicle_of(scenario).home_posture
