"""Snapshots and outputs of a tick with a distinct number in every field."""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.ports import GroupTiming, LoopHealth, VehicleFacts
from fsw.autopilot.signals import (
    ActuatorCommand,
    BatteryState,
    ConstraintKind,
    ConstraintReport,
    ContactReport,
    EndEffectorTarget,
    EstimatorReport,
    FlightSnapshot,
    Home,
    MissionProgress,
    MissionState,
    Mode,
    OffboardReport,
    Orbit,
    PayloadReport,
    Plan,
    PlanInput,
    PlannerCounters,
    PlanTimings,
    PredictionState,
    SafetyCounters,
    SatelliteFix,
    SensorReport,
    SolverStatus,
    StateEstimate,
    TestRatios,
    TickOutputs,
)
from fsw.link.wire.outgoing import TelemetryContext

VEHICLE = replace(AIRFRAME, rotor_thrust_max=(16.0,) * 4)
FACTS = VehicleFacts(
    VEHICLE,
    tick_period_us=2_000,
    mpc_period_us=100_000,
    mpc_delay_us=10_000,
    horizon=5,
    sqp_iterations=2,
)
CONTEXT = TelemetryContext(
    FACTS,
    LoopHealth(
        inner=GroupTiming(2_000, 5000, 3, 1, 60.0, 120.0, 500.0, 20.0, 90.0, 700.0, 0.03),
        mpc=GroupTiming(100_000, 100, 0, 0, 900.0, 1500.0, 2100.0, 0.0, 0.0, 0.0, 0.01),
        vibration=(0.02, 0.3),
        clipped=17,
    ),
    start_unix_us=1_750_000_000_000_000,
    plan_ids={0: 0xDEADBEEF, 1: 7, 2: 9},
)

# Yaw of 90 degrees: body x points east.
_EAST = (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
ACTUATORS = ActuatorCommand((8.0, 4.0, 12.0, 16.0), (1.0, -0.5))
PLAN = Plan(
    plan_id=7,
    t_us=3_000_000,
    period_us=100_000,
    start=PredictionState(
        (0.0, 0.0, -1.0), (0.0,) * 3, (0.0,) * 3, (0.0,) * 2, (0.0,) * 2, 0.0, 0.0, (0.0,) * 2,
        (0.0,) * 2,
    ),
    inputs=(),
    status=SolverStatus.SOLVED,
    cost=12.5,
    slack_max=0.25,
    barrier=(),
    sqp_iterations=2,
    solver_iterations=19,
    timings=PlanTimings(linearise_us=101.0, solve_us=502.0, total_us=703.0),
)  # fmt: skip
REPORT = EstimatorReport(
    t_us=3_003_000,
    pose_covariance=tuple(1e-4 * k for k in range(1, 22)),
    velocity_covariance=tuple(1e-3 * k for k in range(1, 22)),
    accel_bias=(0.01, 0.02, 0.03),
    gyro_bias=(0.001, 0.002, 0.003),
    accel_bias_variance=(1e-4, 2e-4, 3e-4),
    gyro_bias_variance=(1e-6, 2e-6, 3e-6),
    pose_delay=0.015,
    sensors=(SensorReport("IMU", 0), SensorReport("GNSS", 90_000, "rate too low", (0.5, 0.25))),
    ratios=TestRatios(0.1, 0.2, 0.3, 0.4, 0.5),
    unaided_us=80_000,
    resets=2,
    flags=831,
    fix=SatelliteFix(
        2_900_000,
        (0.0, 0.0, -3.0),
        (3.0, 4.0, 0.5),
        (0.012, 0.01, 0.02),
        0.1,
        kind=5,
        satellites=14,
    ),
)
SNAPSHOT = FlightSnapshot(
    t_us=3_004_000,
    mode=Mode.TRAJECTORY,
    armed=True,
    estimate=StateEstimate(
        3_004_000, (1.0, 2.0, -3.0), (0.1, 0.2, 0.3), _EAST, (0.4, 0.5, 0.6), 1.5707963,
        (0.7, 0.8), (0.9, 1.1),
    ),
    reference=EndEffectorTarget(3_004_000, (1.6, 2.6, -2.6), (0.1,) * 3, (0.2,) * 3, 0.3),
    plan_state=PredictionState(
        (1.1, 2.1, -3.1), (0.11, 0.21, 0.31), (0.12, 0.22, 0.32), (0.0,) * 2, (0.0,) * 2, 0.33,
        0.03, (0.71, 0.81), (0.91, 1.01),
    ),
    plan_input=PlanInput((0.5, 0.6, 0.7), 0.05, (0.8, 0.9)),
    actuators=ACTUATORS,
    plan=PLAN,
    plan_status=SolverStatus.TIME_LIMIT,
    counters=PlannerCounters(plans=10, missed_deadlines=1, fallbacks=2),
    safety=SafetyCounters(departures=5, breaches=3, interventions=7, refusals=4),
    constraints=ConstraintReport(
        ConstraintKind.WALLS,
        (0.3, 0.2, 0.4),
        (0.5, -0.1, 0.6),
        added=(0.125, 0.25),
        shortfall=0.0625,
    ),
    home=Home((-0.5, 0.25, -0.3), math.pi),
    battery=BatteryState(voltage=15.2, current=18.3, consumed=1.9, remaining=0.62),
    offboard=OffboardReport(accepted=5, refused=2, age_us=40_000),
    mission=MissionProgress(MissionState.PAUSED, 2, 5, 1, 2),
    orbit=Orbit((1.0, 2.0, -3.0), 2.5, 0.4, clockwise=False),
    accel_B=(0.1, 0.2, -9.7),
    estimator=REPORT,
    touching=ContactReport(True, (-5.0, 0.5, 1.5), 5.25, 0.375, 5.125, 4.75, 10.0, -0.0625),
    payload=PayloadReport(True, 0.28125),
)  # fmt: skip


def outputs_at(t_us: int, **changes: object) -> TickOutputs:
    """What a tick would say at a time; keyword arguments replace fields of the outputs."""
    estimate = SNAPSHOT.estimate._replace(t_us=t_us)
    snapshot = replace(SNAPSHOT, t_us=t_us, estimate=estimate)
    if "snapshot" in changes:
        changes["shown"] = changes.pop("snapshot")
    return replace(TickOutputs(ACTUATORS, snapshot.mode, snapshot.armed, shown=snapshot), **changes)  # type: ignore[arg-type]
