"""The topics of a flight log: one table for the writer, the reader and the page of topics.

Where PX4 has a topic of the same meaning, name, fields and units are PX4's, so that its tools
show a flight of Pandion; a topic may have fewer fields than there. What is fed back by
``pandion replay``, and the actuators, are doubles; the rest is for reading and is floats.
"""

from __future__ import annotations

from typing import Final

from fsw.autopilot.estimation.sensors import SENSORS
from fsw.autopilot.estimation.sensors.base import LogTopic
from fsw.autopilot.measurements import ImuSample, JointSample, Sample
from fsw.log import px4_topics
from messages.ulog import Field, Topic, doubles, floats

TEXT_SIZE: Final = 140  # characters of an input's text in one record
MARGINS: Final = 16
SAMPLED: Final = "timestamp_sample"

EVERY_TICK: Final = "every tick"
DETAIL: Final = "50 Hz; every tick with `LOG_PROFILE` 1"
DETAIL_IN_FLIGHT: Final = "in flight, 20 Hz; every tick with `LOG_PROFILE` 1"
PLANNING: Final = "every planning cycle"
CHANGE: Final = "on change"


def _vector(name: str, size: int, note: str) -> Field:
    return Field(name, "float", size, note)


def _of_joints(name: str, kind: str, note: str) -> Field:
    return Field(name, kind, 2, note, "joint")


def _of_rotors(name: str, kind: str, note: str) -> Field:
    return Field(name, kind, 4, note, "rotor")


SENSOR_FRAME: Final = Topic(
    "sensor_frame",
    "Sensor readings; input of the tick",
    EVERY_TICK,
    (
        doubles("p_WB", 3, "m, NED"),
        doubles("v_WB", 3, "m/s, NED"),
        doubles("q_WB", 4, "[w, x, y, z]"),
        doubles("gyro_B", 3, "rad/s, body"),
        doubles("accel_B", 3, "m/s^2, body"),
        _of_joints("q_arm", "double", "rad"),
        _of_joints("qd_arm", "double", "rad/s"),
    ),
)
TICK: Final = Topic(
    "tick",
    "In place of a `sensor_frame` that has nothing but the last `sensor_combined`",
    "every tick, where sensors have times of their own",
    (),
)
VEHICLE_ATTITUDE: Final = Topic(
    "vehicle_attitude", "Estimate", DETAIL, (_vector("q", 4, "[w, x, y, z], body to NED"),)
)
VEHICLE_ANGULAR_VELOCITY: Final = Topic(
    "vehicle_angular_velocity", "Estimate", px4_topics.FAST, (_vector("xyz", 3, "rad/s, body"),)
)
VEHICLE_LOCAL_POSITION: Final = Topic(
    "vehicle_local_position",
    "Estimate of the body origin",
    DETAIL,
    (
        *floats("x", "y", "z", note="m, NED"),
        *floats("vx", "vy", "vz", note="m/s, NED"),
        *floats("heading", note="rad"),
        *(Field(name, "bool") for name in ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid")),
        *floats("dist_bottom", note="m, above the origin: the ground is taken for flat"),
        Field("dist_bottom_valid", "bool", note="a rangefinder is used"),
    ),
)
ACTUATOR_COMMAND: Final = Topic(
    "actuator_command",
    "Actuator command, exactly as sent",
    EVERY_TICK,
    (
        _of_rotors("rotor_thrust", "double", "N"),
        _of_joints("joint_torque", "double", "N m"),
        Field("armed", "bool"),
    ),
)
ACTUATOR_MOTORS: Final = Topic(
    "actuator_motors",
    "Rotor commands in PX4's form",
    DETAIL,
    (_of_rotors("control", "float", "0 to 1, share of full thrust"),),
)
ARM_JOINT_STATE: Final = Topic(
    "arm_joint_state",
    "Estimate, and commanded torque",
    DETAIL,
    (
        _of_joints("q", "float", "rad"),
        _of_joints("qd", "float", "rad/s"),
        _of_joints("tau", "float", "N m"),
    ),
)
VEHICLE_LOCAL_POSITION_SETPOINT: Final = Topic(
    "vehicle_local_position_setpoint",
    "State of the running plan: body origin",
    DETAIL_IN_FLIGHT,
    (
        *floats("x", "y", "z", note="m, NED"),
        *floats("vx", "vy", "vz", note="m/s, NED"),
        _vector("acceleration", 3, "m/s^2, NED, of the plan's state"),
        *floats("yaw", note="rad"),
        *floats("yawspeed", note="rad/s"),
    ),
)
ARM_JOINT_SETPOINT: Final = Topic(
    "arm_joint_setpoint",
    "State of the running plan: joints",
    DETAIL_IN_FLIGHT,
    (
        _of_joints("q", "float", "rad"),
        _of_joints("qd", "float", "rad/s"),
        _of_joints("qdd", "float", "rad/s^2"),
    ),
)
PLAN_INPUT: Final = Topic(
    "plan_input",
    "The paper's u in force; with the joints' in `arm_joint_setpoint`",
    DETAIL_IN_FLIGHT,
    (_vector("a", 3, "m/s^2, NED"), *floats("yaw_acc", note="rad/s^2")),
)
BARRIER_MARGIN: Final = Topic(
    "barrier_margin",
    "Margins of the active safe set, by the vehicle's own estimate",
    PLANNING,
    (
        _vector(
            "margin",
            MARGINS,
            "m; of each zone and point (base, joint 2, end-effector); with the full body, or "
            "more zones, the least of each zone",
        ),
        _vector("barrier", MARGINS, "h, m/s, same order; active at or below 0"),
        *floats("minimum", note="m"),
        Field("kind", "uint8_t", note="0 none, 1 walls, 2 workspace, 3 obstacles and walls"),
        Field("count", "uint8_t", note="number of valid entries"),
        Field("argmin", "uint8_t"),
        Field("breaches", "uint32_t", note="times the safe set was left in flight"),
        Field("departures", "uint32_t", note="times the vehicle left the tube around its plan"),
        Field("interventions", "uint32_t", note="times the safety filter engaged"),
        _vector(
            "added",
            MARGINS,
            "m, kept from each zone beyond its clearance because the estimate is not sure; NaN: no "
            "such zone, or exact states",
        ),
        *floats("lacking", note="m, what the zone with the least room for that lacks"),
    ),
)
TOOL_CONTACT: Final = Topic(
    "tool_contact",
    "What the tool does at a surface that it may touch",
    "near one, 50 Hz; every tick with `LOG_PROFILE` 1",
    (
        _vector("force", 3, "N, NED, on the tool, observed"),
        *floats("pressed", note="N, of that along the normal"),
        *floats("unsure", note="N, by which that may be wrong"),
        *floats("commanded", note="N, what the joints press with"),
        *floats("asked", note="N, by the plan"),
        *floats("most", note="N, that the surface allows"),
        *floats("distance", note="m, to where the surface is"),
        Field("contact", "bool"),
    ),
)
PAYLOAD: Final = Topic(
    "payload",
    "What the gripper holds",
    "from the first command to it, 50 Hz; every tick with `LOG_PROFILE` 1",
    (
        *floats("mass", note="kg, at the end-effector, weighed by the joints"),
        Field("closed", "bool", note="the gripper"),
    ),
)
END_EFFECTOR: Final = Topic(
    "end_effector",
    "Estimate and the reference in use",
    PLANNING,
    (
        _vector("p", 3, "m, NED"),
        _vector("v", 3, "m/s, NED"),
        _vector("p_ref", 3, "m, NED; NaN without a reference"),
        _vector("v_ref", 3, "m/s, NED"),
        *floats("yaw_ref", note="rad"),
    ),
)
MPC_REQUEST: Final = Topic(
    "mpc_request",
    "Request to the planner: start state of the plan",
    PLANNING,
    (
        Field("plan_id", "uint32_t"),
        Field("t_apply", "uint64_t", note="us; when the answer takes effect"),
        doubles("p", 3, "m, NED"),
        doubles("v", 3, "m/s, NED"),
        doubles("a", 3, "m/s^2, NED"),
        doubles("j", 2, "m/s^3, horizontal"),
        doubles("s", 2, "m/s^4, horizontal"),
        doubles("yaw", 0, "rad"),
        doubles("yaw_rate", 0, "rad/s"),
        _of_joints("q_arm", "double", "rad"),
        _of_joints("qd_arm", "double", "rad/s"),
        doubles("p_WE", 3, "m, NED; first point of the reference"),
        Field("from_nominal", "bool", note="start taken from the running plan, not measured"),
    ),
)
MPC_STATUS: Final = Topic(
    "mpc_status",
    "Last accepted plan, status of the last cycle, and counts since the start",
    "on every answer, and on none",
    (
        Field("t_plan", "uint64_t", note="us; start time of the plan, 0: no plan"),
        Field("plan_id", "uint32_t"),
        Field("plans", "uint32_t"),
        Field("missed_deadlines", "uint32_t"),
        Field("fallbacks", "uint32_t"),
        *floats("cost"),
        *floats("slack_max", note="m/s; softening of a barrier"),
        *floats("linearise_us", "solve_us", "total_us", note="wall time; NaN in lockstep"),
        Field("sqp_iterations", "uint16_t"),
        Field("solver_iterations", "uint16_t"),
        Field("status", "uint8_t", note="PANDION_SOLVER_STATUS of the last cycle"),
    ),
)
VEHICLE_STATUS: Final = Topic(
    "vehicle_status",
    "Mode, arming and active faults",
    "on change and every second",
    (
        Field("arming_state", "uint8_t", note="1 disarmed, 2 armed"),
        Field("nav_state", "uint8_t", note="PX4's number of the mode"),
        Field("failsafe", "bool", note="a fault is active"),
        Field("mode", "char", 16, "Pandion's name of the mode"),
        Field("failures", "char", 96, "names of the active faults"),
        Field("failsafe_and_user_took_over", "bool", note="after a failsafe, and it lasts"),
        Field("vehicle_type", "uint8_t", note="1 rotary wing"),
        Field("is_vtol", "bool"),
    ),
)
FAILURE_DETECTOR_STATUS: Final = Topic(
    "failure_detector_status",
    "Rotor and joints that have failed",
    "on change of a fault and every second",
    (
        Field("fd_motor", "bool", note="a rotor has failed"),
        Field("motor_failure_mask", "uint16_t", note="bit 0: the first"),
        *floats("motor_effectiveness", note="thrust over command of that rotor, as allocated"),
        Field("motor_lost", "bool", note="it gives nothing"),
        Field("motor_disobeys", "bool", note="it gives something else than is commanded"),
        _of_joints("joint_state", "uint8_t", "0 sound, 1 stuck, 2 limp"),
    ),
)
VEHICLE_LAND_DETECTED: Final = Topic(
    "vehicle_land_detected", "Landed or not", "on change and every second",
    (Field("landed", "bool"),),
)  # fmt: skip
VEHICLE_COMMAND: Final = Topic(
    "vehicle_command",
    "Received command",
    "each",
    (
        *floats("param1", "param2", "param3", "param4", note="NaN: not used"),
        Field("param5", "double"),
        Field("param6", "double"),
        *floats("param7"),
        Field("command", "uint32_t", note="MAV_CMD"),
        Field("source_system", "uint8_t"),
        Field("source_component", "uint16_t"),
        Field("confirmation", "uint8_t"),
    ),
)
VEHICLE_COMMAND_ACK: Final = Topic(
    "vehicle_command_ack",
    "Acknowledgement of a command",
    "each",
    (
        Field("command", "uint32_t", note="MAV_CMD"),
        Field("result", "uint8_t", note="MAV_RESULT"),
        Field("target_system", "uint8_t"),
        Field("target_component", "uint16_t"),
    ),
)
TICK_INPUT: Final = Topic(
    "tick_input",
    "Every other input of a tick, by the name of its field; input of `pandion replay`",
    CHANGE,
    (
        Field("field", "char", 24, "of TickInputs"),
        Field("part", "uint16_t", note="a long text is cut into records of this topic"),
        Field("parts", "uint16_t"),
        Field("text", "char", TEXT_SIZE, "JSON, filled up with zeros"),
    ),
)
LOOP_TIMING: Final = Topic(
    "loop_timing",
    "Timing of a rate group; the times are of the last second and, in lockstep, NaN",
    "every second",
    (
        Field("ticks", "uint32_t"),
        Field("late_ticks", "uint32_t"),
        Field("skipped_ticks", "uint32_t"),
        Field("period_us", "uint32_t"),
        *floats("execution_p50_us", "execution_p99_us", "execution_max_us"),
        *floats("lateness_p50_us", "lateness_p99_us", "lateness_max_us"),
        Field("group", "uint8_t", note="PANDION_RATE_GROUP"),
    ),
)
_MEASURED: Final = "every measurement; none with exact sensors"
_MEASURED_AT: Final = doubles("time", 0, "s, of the measurement, on the clock of the tick")
SENSOR_COMBINED: Final = Topic(
    "sensor_combined",
    "Inertial unit; input of the tick",
    _MEASURED,
    (
        _MEASURED_AT,
        doubles("accelerometer_m_s2", 3, "m/s^2, specific force, body"),
        doubles("gyro_rad", 3, "rad/s, body"),
    ),
)
JOINT_ENCODERS: Final = Topic(
    "joint_encoders",
    "Encoders of the arm; input of the tick",
    _MEASURED,
    (_MEASURED_AT, _of_joints("angle", "double", "rad")),
)


def _of_sensor(topic: LogTopic) -> Topic:
    fields = [Field(one.name, one.kind, one.size, one.note) for one in topic.fields]
    return Topic(
        topic.name, f"{topic.meaning}; input of the tick", _MEASURED, (_MEASURED_AT, *fields)
    )


# Each kind of sample and its topic, whose fields are the sample's, in their order, and SAMPLED.
OF_SAMPLES: Final[dict[type[Sample], Topic]] = {
    ImuSample: SENSOR_COMBINED,
    **{kind.sample: _of_sensor(kind.topic) for kind in SENSORS},
    JointSample: JOINT_ENCODERS,
}
_ESTIMATED: Final = "every planning cycle; none with exact sensors"
ESTIMATOR_STATUS: Final = Topic(
    "estimator_status",
    "Accuracy, and innovations over their limits",
    _ESTIMATED,
    (
        *floats("pos_horiz_accuracy", note="m, of north and east together"),
        *floats("pos_vert_accuracy", note="m, standard deviation"),
        *floats("hdg_test_ratio", "vel_test_ratio", "pos_test_ratio", note="1: refused"),
        *floats("hgt_test_ratio", "hagl_test_ratio", note="1: refused"),
        *floats("vel_accuracy", note="m/s, standard deviation, largest axis"),
        *floats("tilt_accuracy", note="rad, standard deviation, the larger of roll and pitch"),
        *floats("unaided", note="s since a position was used last"),
        *floats("pose_delay", note="s"),
        Field("reset_count", "uint32_t", note="jumps of the estimate"),
        Field("solution_status_flags", "uint16_t", note="ESTIMATOR_STATUS_FLAGS"),
        Field("faults", "char", 96, "sensors with something wrong, and what"),
        Field("health_flags", "uint8_t", note="bits of no use: velocity, position, height"),
        Field("timeout_flags", "uint8_t", note="the same bits, not corrected for a second"),
        Field(
            "innovation_check_flags",
            "uint16_t",
            note="PX4's bits of what was refused: 0 velocity, 1 position, 2 height, 6 heading, "
            "9 height above ground",
        ),
        *floats("time_slip", note="s; the filter goes by the sensors' clock alone: 0"),
    ),
)
ESTIMATOR_INNOVATIONS: Final = Topic(
    "estimator_innovations",
    "Measured minus expected, of the last reading of each sensor; NaN: none",
    _ESTIMATED,
    (
        *[
            Field(name, "float", count, note)
            for kind in SENSORS
            for name, count, note in kind.innovations
        ],
    ),
)
# Of each sensor how many numbers it has there.
INNOVATIONS: Final = tuple(
    (kind.sensor.value, sum(max(count, 1) for _, count, _ in kind.innovations)) for kind in SENSORS
)
ESTIMATOR_SENSOR_BIAS: Final = Topic(
    "estimator_sensor_bias",
    "Biases of the inertial unit",
    _ESTIMATED,
    (
        _vector("gyro_bias", 3, "rad/s, body"),
        _vector("gyro_bias_variance", 3, "rad^2/s^2"),
        _vector("accel_bias", 3, "m/s^2, body"),
        _vector("accel_bias_variance", 3, "m^2/s^4"),
    ),
)
TOPICS: Final = (
    SENSOR_FRAME,
    TICK_INPUT,
    VEHICLE_COMMAND,
    VEHICLE_COMMAND_ACK,
    VEHICLE_ATTITUDE,
    VEHICLE_ANGULAR_VELOCITY,
    VEHICLE_LOCAL_POSITION,
    VEHICLE_LOCAL_POSITION_SETPOINT,
    VEHICLE_STATUS,
    FAILURE_DETECTOR_STATUS,
    VEHICLE_LAND_DETECTED,
    ACTUATOR_COMMAND,
    ACTUATOR_MOTORS,
    ARM_JOINT_STATE,
    ARM_JOINT_SETPOINT,
    PLAN_INPUT,
    END_EFFECTOR,
    BARRIER_MARGIN,
    MPC_REQUEST,
    MPC_STATUS,
    LOOP_TIMING,
    *OF_SAMPLES.values(),
    ESTIMATOR_STATUS,
    ESTIMATOR_INNOVATIONS,
    ESTIMATOR_SENSOR_BIAS,
    TICK,
    *px4_topics.PX4_TOPICS,
    TOOL_CONTACT,
    PAYLOAD,
)
"""Everything the flight software writes; a topic's place is its number in the file.

Arrays of joints and rotors are as long here as those of the paper's vehicle; ``Topic.sized`` has
those of another one.
"""
NUMBERS: Final = {topic.name: number for number, topic in enumerate(TOPICS)}
