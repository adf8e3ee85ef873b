"""Every tunable of the flight software, typed, and the presets that are flown."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import cast

from fsw.autopilot.control.cascade import Inner
from fsw.autopilot.control.gains import LoopGains
from fsw.autopilot.control.px4_loops import Px4Tuning, airframe_above_px4
from fsw.autopilot.control.safety_filter import FilterTuning
from fsw.autopilot.control.tube import closest_tracking
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.geometry.geodesy import DEFAULT_ORIGIN
from fsw.autopilot.model.airframe import AIRFRAME, Airframe, airframe_of
from fsw.autopilot.model.body import BODIES, Body, BodyName, body_of
from fsw.autopilot.model.multibody import place_of_tip, posture
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.parameters.control_choice import KNOWN
from fsw.autopilot.periods import TICK_US
from fsw.autopilot.signals import Origin
from fsw.autopilot.tuning import Tuning, tuned
from vehicles.description import Vehicle

CONTROLLERS = KNOWN["controller"]
INNERS: tuple[Inner, ...] = ("tracking", "pid", "px4")


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """How the vehicle climbs, descends and decides that it stands."""

    takeoff_climb: float = 1.0  # m, where the command names no height
    takeoff_climb_most: float = 50.0  # m
    takeoff_wait_us: int = 10_000_000  # a takeoff commanded before arming is forgotten after this
    climb_speed: float = 0.4  # m/s
    land_speed: float = 0.25  # m/s
    landed_height: float = 0.1  # m above standing; the origin's height is known no better
    airborne_height: float = 0.3  # m above standing; lower and not landed: unknown
    landed_speed: float = 0.05  # m/s
    landed_time_us: int = 500_000  # at rest this long
    idle_thrust: float = 0.8  # N a rotor while armed on the ground
    return_height: float = 2.0  # m above home, on the way back
    return_descent: float = 2.0  # m above home, where a return waits before it lands
    return_wait: float = 0.0  # s, there; negative: it stays
    setpoint_timeout_us: int = 500_000  # without a setpoint offboard ends
    setpoint_loss_action: int = 5  # what then: 3 return, 4 land, 5 hold, 6 terminate
    mission_speed: float = 0.3  # m/s, where the mission names none
    mission_turn_rate: float = 0.3  # rad/s
    mission_turn_acceleration: float = 0.05  # rad/s^2; the plan's limit is 0.1
    fence_clearance: float = 0.1  # m, kept from the walls of an uploaded fence
    station_timeout_us: int = 10_000_000  # without a ground station its loss is acted upon
    station_loss_action: int = 2  # how: 0 not at all, 1 hold, 2 return, 3 land, 5 terminate
    # Where it is not: 1 in a mission, 2 in hold, 4 offboard, 8 on a trajectory.
    station_loss_exceptions: int = 0
    radio_input: int = 1  # 1 or 4: no radio; kept for programs that set it as PX4 wants it
    radio_loss_exceptions: int = 0  # the same: modes as above in which no radio is missed
    failsafe_delay_us: int = 5_000_000  # in hold, before the vehicle returns or lands
    battery_low: float = 0.2  # share of the capacity
    battery_critical: float = 0.1
    battery_emergency: float = 0.05
    low_battery_action: int = 3  # 0 warn; 2 land when critical; 3 return then, land in emergency
    # What is left must do for the way home: this often the time of it, and this much beside.
    return_time_factor: float = 1.1
    return_time_margin: float = 30.0  # s
    flight_time_action: int = 3  # where it does not: 0 nothing, 1 warn, 3 return
    safe_set_owner: int = 0  # MAVLink system that owns the safe set; 0: the first to announce one
    clearance_sigmas: float = 3.0  # standard deviations of a point, kept from zones besides
    breach_action: int = 6  # of the safe set: 1 warn, 2 hold, 5 land, 6 retreat and hold
    fence_action: int = 6  # of an uploaded fence: the same, and 0 nothing, 3 return, 4 terminate
    owner_timeout_us: int = 10_000_000  # a silent owner may be replaced on the ground
    zone_timeout_us: int = 3_000_000  # a moving zone that is not announced for this long stands
    # Loss of sensors. Hidden markers, 0.2 s, are none; a drift by a tenth of a metre is.
    aiding_loss_us: int = 250_000  # without a position that the estimate could use
    position_low: float = 0.1  # m, standard deviation in dead reckoning that is acted upon
    position_low_action: int = 2  # how: 1 warn, 2 hold, 5 land
    position_lost: float = 0.5  # m, the same: descend
    # rad, standard deviation of roll and pitch that ends the flight: there is no way back from it,
    # and a pose that is hidden for 0.2 s while the IMU is frozen as well (0.37) comes back.
    attitude_loss: float = 0.7
    sensor_loss_us: int = 50_000  # without a use of the inertial unit, or of the encoders
    sensor_loss_action: int = 2  # what then: 1 warn, 2 hold, 5 land
    failure_injection: int = 0  # whether commands may let units of a simulated vehicle fail
    # Roll or pitch from which there is no way back, and for how long.
    roll_failure: float = math.radians(60.0)  # rad; 0: never
    pitch_failure: float = math.radians(60.0)  # rad
    roll_failure_us: int = 300_000
    pitch_failure_us: int = 300_000
    termination_breaker: int = 0  # 121212: an attitude failure does not stop the rotors
    planner_loss_us: int = 5_000_000  # without a new plan the vehicle descends
    watches_actuators: int = 1  # whether rotors and joints that fail are looked for
    failed_rotor_mode: int = 1  # 0: allocation goes on as if it were sound; 1: it is reweighted
    actuator_failure_action: int = 2  # 0 warn, 1 hold, 2 land, 3 return, 4 terminate
    flood_rate: float = 2000.0  # datagrams/s from the ground that are too many
    # Arming
    arm_battery: float = -1.0  # share of the capacity; negative: ``battery_critical``
    arm_tilt: float = math.radians(15.0)  # rad, at most
    arm_without_log: int = 2  # 0 and 1: may be armed, 2: not


@dataclass(frozen=True, slots=True)
class SetpointLimits:
    """How fast a generated setpoint moves."""

    cruise_speed: float = 1.0  # m/s, on the way to a place
    # Faster and harder, setpoints that change every half second drove the fast loop into the
    # rotors' limits, and the vehicle off its plan.
    speed: float = 1.5  # m/s, at most
    highest: float = 120.0  # m above the origin, of the base
    acceleration: float = 1.0  # m/s^2
    yaw_rate: float = 0.3  # rad/s
    yaw_acceleration: float = 0.06  # rad/s^2; the plan's limit is 0.1
    joint_speed: float = 0.6  # rad/s
    max_lead_distance: float = 0.3  # m, from the vehicle to the setpoint


@dataclass(frozen=True, slots=True)
class DisturbanceModel:
    """What the vehicle must expect; ``consistency.py`` asks whether it can cope."""

    disturbance: float = 0.8  # m/s^2 an axis, d_m of Table II
    disturbance_hold: float = 0.1  # s
    target_acceleration: float = 0.05  # m/s^2, of the end-effector reference
    tangential_speed: float = 0.1  # m/s, of the base against the sphere's centre
    hanging: float = 0.225  # m, end-effector below the base, d_iw of Table II
    zone_speed: float = 1.5  # m/s, of a zone that moves, as who walks; faster is not believed


@dataclass(frozen=True, slots=True)
class FlightConfig:
    """One configuration of the whole flight software."""

    controller: str = "blf"
    inner: Inner = "tracking"
    airframe: Airframe = AIRFRAME
    planner: PlannerConfig = field(default_factory=PlannerConfig)
    tuning: LoopGains = field(default_factory=LoopGains)
    px4: Px4Tuning = field(default_factory=Px4Tuning)  # of use above PX4 alone
    limits: FlightLimits = field(default_factory=FlightLimits)
    surroundings: DisturbanceModel = field(default_factory=DisturbanceModel)
    steering: SetpointLimits = field(default_factory=SetpointLimits)
    safety_filter: FilterTuning = field(default_factory=FilterTuning)
    estimator: EstimatorTuning = field(default_factory=EstimatorTuning)
    origin: Origin = DEFAULT_ORIGIN
    soft: bool = False  # fly an inconsistent configuration all the same, with a warning
    tick_period_us: int = TICK_US
    # 20 ms between question and answer: 20 times the planner's median, and a fixed number of
    # ticks, so that a slow machine flies exactly like a fast one. A plan that starts from the
    # nominal state loses nothing by waiting.
    plan_delay_ticks: int = 20_000 // TICK_US
    # Ticks that were missed are made up for, up to this many at once.
    catch_up_ticks: int = 50_000 // TICK_US
    log_profile: int = 0  # of flight.ulg: 0 what a replay needs, and the rest at 50 Hz; 1 all
    # Farther from the plan than this, plan from the measurement.
    upset_distance: float = 0.15  # m
    upset_yaw: float = 0.35  # rad
    # module:Name of what a study flies in place of ours; a vehicle flies its own.
    own_planner: str = ""
    own_controller: str = ""

    @property
    def follows_plan(self) -> bool:
        """Whether the inner loop follows the plan's state, or only its acceleration."""
        return self.inner != "pid"

    @property
    def is_above_px4(self) -> bool:
        """Whether the planner is above PX4, whose rotors they are."""
        return self.inner == "px4"

    @property
    def keeps_barriers(self) -> bool:
        """Whether it is promised; others are flown for comparison, to show what they do."""
        return self.controller == "blf" and not self.soft

    @property
    def body(self) -> Body:
        """What keeps clear of zones."""
        return body_of(self.planner.body, self.airframe)

    @property
    def tick(self) -> float:
        """Length of a tick [s]."""
        return self.tick_period_us * 1e-6

    @property
    def mpc_period_us(self) -> int:
        """Of the planner."""
        return self.planner.period_us

    @property
    def ticks_per_plan(self) -> int:
        """Ticks of a planning period."""
        return self.mpc_period_us // self.tick_period_us


def lowest_height(config: FlightConfig) -> float:
    """Least height [m] above the origin to which the base is led, but for a landing."""
    return config.airframe.leg_length + config.limits.airborne_height


# lambda of eq 25 [m/s]. The paper's two contradict its own sphere and tilt limits and fly only
# softly; ``consistency.py`` says why.
ROBUSTNESS_PRESETS = {"consistent": None, "paper-1": 1.0, "paper-5": 5.0}


def flight_config(
    controller: str = "blf",
    inner: Inner = "tracking",
    robustness: str = "consistent",
    *,
    solver: str = "clarabel",
    body: str = "full",
    soft: bool = False,
    vehicle: Vehicle | None = None,
) -> FlightConfig:
    """The configuration of a controller, an inner loop, a lambda, a solver and a body, by name.

    For a ``vehicle``; without one, the paper's.

    Raises:
        ValueError: for an unknown name, listing the known ones.
    """
    for what, name, known in (
        ("controller", controller, CONTROLLERS),
        ("inner loop", inner, INNERS),
        ("robustness", robustness, ROBUSTNESS_PRESETS),
        ("solver", solver, KNOWN["solver"]),
        ("body", body, BODIES),
    ):
        if name not in known:
            raise ValueError(f"unknown {what} '{name}'; known: {', '.join(known)}")
    planner = PlannerConfig(controller=controller, solver=solver, body=cast(BodyName, body))
    wanted = ROBUSTNESS_PRESETS[robustness]
    if wanted is not None:
        planner = tuned(planner, (("walls.lambda_", wanted), ("workspace.lambda_", wanted)))
    config = FlightConfig(controller=controller, inner=inner, planner=planner, soft=soft)
    return config if vehicle is None else of_vehicle(config, vehicle)


_ABOVE_PX4: Tuning = (
    # PX4's loops are slower than ours, so a plan keeps more from walls: with this lambda the tube
    # of the default ones fits, and with this alpha the tilt can brake.
    *(("planner.walls.alpha", 1.93), ("planner.walls.lambda_", 0.4)),
    *(("planner.workspace.alpha", 1.8), ("planner.workspace.lambda_", 0.4)),
    ("planner.lambda_min", 0.0),
    ("limits.watches_actuators", 0),  # which are PX4's to watch
    ("limits.clearance_sigmas", 0.0),
    ("tuning.compensate", False),  # PX4 knows nothing of what the arm's reaction does
    ("safety_filter.enabled", 0),  # it relies on quicker loops
)


def above_px4(config: FlightConfig, tuning: Tuning = ()) -> FlightConfig:
    """The configuration of the planner above PX4, which flies the vehicle.

    A ``tuning`` of the start says what is known of PX4's loops; plans are predicted with their lag.
    """
    config = tuned(replace(config, inner="px4"), (*_ABOVE_PX4, *tuning))
    return replace(config, airframe=airframe_above_px4(config.airframe, config.px4))


def of_vehicle(config: FlightConfig, vehicle: Vehicle) -> FlightConfig:
    """The configuration for another vehicle."""
    airframe = airframe_of(vehicle)
    b = airframe.bodies
    hanging = round(place_of_tip(posture(b, airframe.home_posture), b)[2], 6)
    surroundings = replace(config.surroundings, hanging=hanging)
    tracking = closest_tracking(
        airframe,
        replace(config.tuning.tracking, point_below_base=0.5 * hanging),
        hanging,
        surroundings.disturbance_hold,
        surroundings.disturbance,
        config.tick_period_us * 1e-6,
    )
    return replace(
        config,
        airframe=airframe,
        tuning=replace(config.tuning, tracking=tracking),
        surroundings=surroundings,
    )
