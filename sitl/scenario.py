"""What a simulated flight consists of, as frozen data; read from TOML by ``scenario_file``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from sitl.bounds import choices, inside

V3: TypeAlias = tuple[float, float, float]
V2: TypeAlias = tuple[float, float]

WORLD_M = 1000.0  # m: far beyond any flight here, close enough to refuse slips of the unit


@dataclass(frozen=True, slots=True)
class Start:
    """How the flight begins."""

    kind: Literal["airborne", "ground"] = field(metadata=choices("airborne", "ground"))
    # Joint angles; the default folds the elbow backwards with the end-effector exactly
    # 0.225 m below the base (cos = 3/4).
    arm_deg: V2 = field(
        default=(-41.40962210927086, 82.81924421854171), metadata=inside(-180.0, 180.0)
    )
    yaw_deg: float = field(default=0.0, metadata=inside(-180.0, 180.0))
    position_m: V2 = field(default=(0.0, 0.0), metadata=inside(-WORLD_M, WORLD_M))  # ground start


@dataclass(frozen=True, slots=True)
class Pilot:
    """What the scenario's pilot asks of the vehicle, by messages."""

    plan: Literal["none", "trajectory", "hop"] = field(
        metadata=choices("none", "trajectory", "hop")
    )
    start_delay_s: float = field(default=1.0, metadata=inside(0.0, 60.0))
    takeoff_height_m: float = field(default=1.5, metadata=inside(0.4, 50.0))


@dataclass(frozen=True, slots=True)
class Lissajous:
    """Sinusoids per axis, started and stopped smoothly."""

    centre_m: V3 = field(metadata=inside(-WORLD_M, WORLD_M))
    amplitude_m: V3 = field(metadata=inside(0.0, WORLD_M))
    period_s: V3 = field(metadata=inside(1.0, 3600.0))
    phase_deg: V3 = field(metadata=inside(-360.0, 360.0))
    ramp_s: float = field(metadata=inside(0.1, 600.0))
    duration_s: float = field(metadata=inside(1.0, 86400.0))
    # "walls" turns the arm's plane to the nearest wall; "start" keeps the yaw of the start.
    heading: Literal["start", "walls"] = field(default="start", metadata=choices("start", "walls"))
    kind: Literal["lissajous"] = field(default="lissajous", metadata=choices("lissajous"))


@dataclass(frozen=True, slots=True)
class Hold:
    """One point."""

    position_m: V3 = field(metadata=inside(-WORLD_M, WORLD_M))
    kind: Literal["hold"] = field(default="hold", metadata=choices("hold"))


Trajectory: TypeAlias = Lissajous | Hold


@dataclass(frozen=True, slots=True)
class Wall:
    """A plane; free space is where n·p > offset."""

    name: str
    normal: V3 = field(metadata=inside(-1.0, 1.0))  # unit, NED, into free space
    offset_m: float = field(metadata=inside(-WORLD_M, WORLD_M))
    clearance_m: float = field(metadata=inside(0.0, 10.0))  # s_min


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A point without a size of its own, such as the tip of a branch."""

    name: str
    position_m: V3 = field(metadata=inside(-WORLD_M, WORLD_M))
    clearance_m: float = field(metadata=inside(0.001, 10.0))  # d_s


@dataclass(frozen=True, slots=True)
class Workspace:
    """Sphere the base must stay in, riding above the end-effector's reference."""

    radius_m: float = field(metadata=inside(0.001, 10.0))
    d_iw_m: float = field(metadata=inside(0.0, 10.0))


@dataclass(frozen=True, slots=True)
class Uniform:
    """Acceleration drawn uniformly from ±amplitude per axis, anew every period."""

    amplitude_m_s2: float = field(metadata=inside(0.0, 50.0))
    period_s: float = field(default=0.1, metadata=inside(0.002, 3600.0))
    name: str = "uniform"
    kind: Literal["uniform"] = field(default="uniform", metadata=choices("uniform"))


@dataclass(frozen=True, slots=True)
class Wind:
    """Constant acceleration, NED."""

    acceleration_m_s2: V3 = field(metadata=inside(-50.0, 50.0))
    name: str = "wind"
    kind: Literal["wind"] = field(default="wind", metadata=choices("wind"))


@dataclass(frozen=True, slots=True)
class Impulses:
    """Pushes of fixed size and length in random directions after random pauses."""

    mean_interval_s: float = field(metadata=inside(0.01, 3600.0))
    magnitude_m_s2: float = field(metadata=inside(0.0, 200.0))
    duration_s: float = field(metadata=inside(0.002, 60.0))
    name: str = "impulses"
    kind: Literal["impulses"] = field(default="impulses", metadata=choices("impulses"))


@dataclass(frozen=True, slots=True)
class Torque:
    """Torque on the base drawn uniformly from ±amplitude per axis, anew every period."""

    amplitude_n_m: float = field(metadata=inside(0.0, 10.0))
    period_s: float = field(default=0.1, metadata=inside(0.002, 3600.0))
    name: str = "torque"
    kind: Literal["torque"] = field(default="torque", metadata=choices("torque"))


Disturbance: TypeAlias = Uniform | Wind | Impulses | Torque


@dataclass(frozen=True, slots=True)
class ImuErrors:
    """Standard deviations per sample and delay of the inertial unit."""

    gyro_rad_s: float = field(default=0.0, metadata=inside(0.0, 10.0))
    accel_m_s2: float = field(default=0.0, metadata=inside(0.0, 100.0))
    latency_ms: float = field(default=0.0, metadata=inside(0.0, 1000.0, step=2.0))


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """Standard deviations per sample and delay of position, velocity, attitude and rates."""

    position_m: float = field(default=0.0, metadata=inside(0.0, 10.0))
    velocity_m_s: float = field(default=0.0, metadata=inside(0.0, 10.0))
    attitude_rad: float = field(default=0.0, metadata=inside(0.0, 1.0))
    rate_rad_s: float = field(default=0.0, metadata=inside(0.0, 10.0))
    latency_ms: float = field(default=0.0, metadata=inside(0.0, 1000.0, step=2.0))


@dataclass(frozen=True, slots=True)
class EncoderErrors:
    """Standard deviations per sample and delay of the joint encoders."""

    angle_rad: float = field(default=0.0, metadata=inside(0.0, 1.0))
    rate_rad_s: float = field(default=0.0, metadata=inside(0.0, 10.0))
    torque_n_m: float = field(default=0.0, metadata=inside(0.0, 10.0))
    latency_ms: float = field(default=0.0, metadata=inside(0.0, 1000.0, step=2.0))


@dataclass(frozen=True, slots=True)
class Sensors:
    """All sensors; exact unless said otherwise."""

    imu: ImuErrors = ImuErrors()
    pose: PoseErrors = PoseErrors()
    encoders: EncoderErrors = EncoderErrors()


@dataclass(frozen=True, slots=True)
class VehicleScale:
    """How the real vehicle differs from what the controller believes."""

    mass: float = field(default=1.0, metadata=inside(0.2, 5.0))
    inertia: float = field(default=1.0, metadata=inside(0.2, 5.0))
    rotor_lag: float = field(default=1.0, metadata=inside(0.1, 10.0))
    joint_friction: float = field(default=1.0, metadata=inside(0.0, 100.0))


@dataclass(frozen=True, slots=True)
class Scenario:
    """One flight."""

    name: str
    duration_s: float = field(metadata=inside(0.1, 86400.0, or_endless=True))
    start: Start
    pilot: Pilot
    trajectory: Trajectory
    description: str = ""
    walls: tuple[Wall, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    workspace: Workspace | None = None
    disturbances: tuple[Disturbance, ...] = ()
    sensors: Sensors = Sensors()
    vehicle_scale: VehicleScale = VehicleScale()
