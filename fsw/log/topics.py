"""The topics of a flight log: one table for the writer, the reader and the page of topics.

Where PX4 has a topic of the same meaning, name, fields and units are PX4's, so that its tools
show a flight of Pandion; a topic may have fewer fields than there. What is fed back by
``pandion replay``, and the actuators, are doubles; the rest is for reading and is floats. How they
are written down: :func:`messages.ulog.declared`.

Source: PX4's message definitions, msg/*.msg.
"""

from __future__ import annotations

from typing import Final

from fsw.autopilot.estimation.sensors import SENSORS
from fsw.autopilot.estimation.sensors.base import LogTopic
from fsw.autopilot.measurements import ImuSample, JointSample, Sample
from messages.ulog import Field, Topic, declared

TEXT_SIZE: Final = 140  # characters of an input's text in one record
MARGINS: Final = 16
SAMPLED: Final = "timestamp_sample"

_FLIGHT: Final = declared(f"""
sensor_frame | Sensor readings; input of the tick | every tick
  double[3] p_WB: m, NED
  double[3] v_WB: m/s, NED
  double[4] q_WB: [w, x, y, z]
  double[3] gyro_B: rad/s, body
  double[3] accel_B: m/s^2, body
  double[joint] q_arm: rad
  double[joint] qd_arm: rad/s

tick_input | Every other input of a tick, by the name of its field; input of `pandion replay`
    | on change
  char[24] field: of TickInputs
  uint16_t part: a long text is cut into records of this topic
  uint16_t parts
  char[{TEXT_SIZE}] text: JSON, filled up with zeros

vehicle_command | Received command | each
  float param1, param2, param3, param4: NaN: not used
  double param5, param6
  float param7
  uint32_t command: MAV_CMD
  uint8_t source_system
  uint16_t source_component
  uint8_t confirmation

vehicle_command_ack | Acknowledgement of a command | each
  uint32_t command: MAV_CMD
  uint8_t result: MAV_RESULT
  uint8_t target_system
  uint16_t target_component

vehicle_attitude | Estimate | 50 Hz; every tick with `LOG_PROFILE` 1
  float[4] q: [w, x, y, z], body to NED

vehicle_angular_velocity | Estimate | 100 Hz; every tick with `LOG_PROFILE` 1
  float[3] xyz: rad/s, body

vehicle_local_position | Estimate of the body origin | 50 Hz; every tick with `LOG_PROFILE` 1
  float x, y, z: m, NED
  float vx, vy, vz: m/s, NED
  float heading: rad
  bool xy_valid, z_valid, v_xy_valid, v_z_valid
  float dist_bottom: m, above the origin: the ground is taken for flat
  bool dist_bottom_valid: a rangefinder is used

vehicle_local_position_setpoint | State of the running plan: body origin
    | in flight, 20 Hz; every tick with `LOG_PROFILE` 1
  float x, y, z: m, NED
  float vx, vy, vz: m/s, NED
  float[3] acceleration: m/s^2, NED, of the plan's state
  float yaw: rad
  float yawspeed: rad/s

vehicle_status | Mode, arming and active faults | on change and every second
  uint8_t arming_state: 1 disarmed, 2 armed
  uint8_t nav_state: PX4's number of the mode
  bool failsafe: a fault is active
  char[16] mode: Pandion's name of the mode
  char[96] failures: names of the active faults
  bool failsafe_and_user_took_over: after a failsafe, and it lasts
  uint8_t vehicle_type: 1 rotary wing
  bool is_vtol

failure_detector_status | Rotor and joints that have failed | on change of a fault and every second
  bool fd_motor: a rotor has failed
  uint16_t motor_failure_mask: bit 0: the first
  float motor_effectiveness: thrust over command of that rotor, as allocated
  bool motor_lost: it gives nothing
  bool motor_disobeys: it gives something else than is commanded
  uint8_t[joint] joint_state: 0 sound, 1 stuck, 2 limp

vehicle_land_detected | Landed or not | on change and every second
  bool landed

actuator_command | Actuator command, exactly as sent | every tick
  double[rotor] rotor_thrust: N
  double[joint] joint_torque: N m
  bool armed

actuator_motors | Rotor commands in PX4's form | 50 Hz; every tick with `LOG_PROFILE` 1
  float[rotor] control: 0 to 1, share of full thrust

arm_joint_state | Estimate, and commanded torque | 50 Hz; every tick with `LOG_PROFILE` 1
  float[joint] q: rad
  float[joint] qd: rad/s
  float[joint] tau: N m

arm_joint_setpoint | State of the running plan: joints
    | in flight, 20 Hz; every tick with `LOG_PROFILE` 1
  float[joint] q: rad
  float[joint] qd: rad/s
  float[joint] qdd: rad/s^2

plan_input | The paper's u in force; with the joints' in `arm_joint_setpoint`
    | in flight, 20 Hz; every tick with `LOG_PROFILE` 1
  float[3] a: m/s^2, NED
  float yaw_acc: rad/s^2

end_effector | Estimate and the reference in use | every planning cycle
  float[3] p: m, NED
  float[3] v: m/s, NED
  float[3] p_ref: m, NED; NaN without a reference
  float[3] v_ref: m/s, NED
  float yaw_ref: rad

barrier_margin | Margins of the active safe set, by the vehicle's own estimate
    | every planning cycle
  float[{MARGINS}] margin: m; of each zone and point (base, joint 2, end-effector); with the full
    body, or more zones, the least of each zone
  float[{MARGINS}] barrier: h, m/s, same order; active at or below 0
  float minimum: m
  uint8_t kind: 0 none, 1 walls, 2 workspace, 3 obstacles and walls
  uint8_t count: number of valid entries
  uint8_t argmin
  uint32_t breaches: times the safe set was left in flight
  uint32_t departures: times the vehicle left the tube around its plan
  uint32_t interventions: times the safety filter engaged
  float[{MARGINS}] added: m, kept from each zone beyond its clearance because the estimate is not
    sure; NaN: no such zone, or exact states
  float lacking: m, what the zone with the least room for that lacks

mpc_request | Request to the planner: start state of the plan | every planning cycle
  uint32_t plan_id
  uint64_t t_apply: us; when the answer takes effect
  double[3] p: m, NED
  double[3] v: m/s, NED
  double[3] a: m/s^2, NED
  double[2] j: m/s^3, horizontal
  double[2] s: m/s^4, horizontal
  double yaw: rad
  double yaw_rate: rad/s
  double[joint] q_arm: rad
  double[joint] qd_arm: rad/s
  double[3] p_WE: m, NED; first point of the reference
  bool from_nominal: start taken from the running plan, not measured

mpc_status | Last accepted plan, status of the last cycle, and counts since the start
    | on every answer, and on none
  uint64_t t_plan: us; start time of the plan, 0: no plan
  uint32_t plan_id, plans, missed_deadlines, fallbacks
  float cost
  float slack_max: m/s; softening of a barrier
  float linearise_us, solve_us, total_us: wall time; NaN in lockstep
  uint16_t sqp_iterations, solver_iterations
  uint8_t status: PANDION_SOLVER_STATUS of the last cycle

loop_timing | Timing of a rate group; the times are of the last second and, in lockstep, NaN
    | every second
  uint32_t ticks, late_ticks, skipped_ticks, period_us
  float execution_p50_us, execution_p99_us, execution_max_us, lateness_p50_us, lateness_p99_us,
    lateness_max_us
  uint8_t group: PANDION_RATE_GROUP
""")
_INERTIAL, _ENCODERS = declared("""
sensor_combined | Inertial unit; input of the tick | every measurement; none with exact sensors
  double time: s, of the measurement, on the clock of the tick
  double[3] accelerometer_m_s2: m/s^2, specific force, body
  double[3] gyro_rad: rad/s, body

joint_encoders | Encoders of the arm; input of the tick | every measurement; none with exact sensors
  double time: s, of the measurement, on the clock of the tick
  double[joint] angle: rad
""")
_STATUS, _BIAS, _TICK = declared("""
estimator_status | Accuracy, and innovations over their limits
    | every planning cycle; none with exact sensors
  float pos_horiz_accuracy: m, of north and east together
  float pos_vert_accuracy: m, standard deviation
  float hdg_test_ratio, vel_test_ratio, pos_test_ratio, hgt_test_ratio, hagl_test_ratio: 1: refused
  float vel_accuracy: m/s, standard deviation, largest axis
  float tilt_accuracy: rad, standard deviation, the larger of roll and pitch
  float unaided: s since a position was used last
  float pose_delay: s
  uint32_t reset_count: jumps of the estimate
  uint16_t solution_status_flags: ESTIMATOR_STATUS_FLAGS
  char[96] faults: sensors with something wrong, and what
  uint8_t health_flags: bits of no use: velocity, position, height
  uint8_t timeout_flags: the same bits, not corrected for a second
  uint16_t innovation_check_flags: PX4's bits of what was refused: 0 velocity, 1 position, 2 height,
    6 heading, 9 height above ground
  float time_slip: s; the filter goes by the sensors' clock alone: 0

estimator_sensor_bias | Biases of the inertial unit | every planning cycle; none with exact sensors
  float[3] gyro_bias: rad/s, body
  float[3] gyro_bias_variance: rad^2/s^2
  float[3] accel_bias: m/s^2, body
  float[3] accel_bias_variance: m^2/s^4

tick | In place of a `sensor_frame` that has nothing but the last `sensor_combined`
    | every tick, where sensors have times of their own
""")
_INNOVATIONS: Final = Topic(
    "estimator_innovations",
    "Measured minus expected, of the last reading of each sensor; NaN: none",
    _STATUS.when,
    tuple(
        Field(name, "float", count, note)
        for kind in SENSORS
        for name, count, note in kind.innovations
    ),
)
# Of each sensor how many numbers it has there.
INNOVATIONS: Final = tuple(
    (kind.sensor.value, sum(max(count, 1) for _, count, _ in kind.innovations)) for kind in SENSORS
)
# For PX4's tools: Flight Review, PlotJuggler, pyulog's KML. They follow from the others, so that
# nothing in here is needed to replay a flight. A field whose value is not known here is left out,
# or NaN where a tool asks for it.
_OF_PX4: Final = declared("""
vehicle_torque_setpoint | Torque that the rotor commands give | 100 Hz
  float[3] xyz: -1 to 1 of the largest, body

vehicle_thrust_setpoint | Thrust that the rotor commands give | 20 Hz
  float[3] xyz: -1 to 1 of the largest, body; z is negative

vehicle_attitude_setpoint | Attitude whose thrust gives the acceleration in force | in flight, 20 Hz
  float[4] q_d: [w, x, y, z], body to NED
  float yaw_sp_move_rate: rad/s
  float[3] thrust_body: -1 to 1 of the largest

vehicle_rates_setpoint | Body rates with which the running plan turns its thrust | in flight, 20 Hz
  float roll, pitch, yaw: rad/s, body
  float[3] thrust_body: -1 to 1 of the largest

vehicle_global_position | Estimate of the body origin on Earth | 5 Hz
  double lat, lon: deg
  float alt: m above mean sea level
  float eph, epv: m, standard deviation; NaN: exact states

vehicle_gps_position | What the receiver said last; without one the estimate, with 0 satellites
    | 5 Hz
  double latitude_deg, longitude_deg: deg
  double altitude_msl_m: m
  float eph, epv: m, standard deviation
  float hdop, vdop: not known: NaN
  float s_variance_m_s: m/s, standard deviation
  float vel_m_s: m/s, level
  uint8_t fix_type: GPS_FIX_TYPE
  uint8_t satellites_used: 255: not said

battery_status | Battery, as modelled and corrected by what is measured of it | every second
  float voltage_v: V, under load
  float current_a: A
  float discharged_mah: mA h
  float remaining: share of the capacity
  float time_remaining_s: s; NaN: not known
  uint8_t warning: 0 none, 1 low, 2 critical, 3 emergency

vehicle_imu_status | Vibration of the inertial unit, as PX4 computes it: 1 % of each change is added
    | every second
  float accel_vibration_metric: m/s^2
  float gyro_vibration_metric: rad/s

failsafe_flags | Active conditions under PX4's names; all of them by their own are in
    `vehicle_status` | on change of a fault and every second
  bool attitude_invalid, local_altitude_invalid, local_position_invalid, local_velocity_invalid
  bool auto_mission_missing: none was uploaded
  bool offboard_control_signal_lost: no setpoint in time
  bool gcs_connection_lost
  uint8_t battery_warning: as in `battery_status`
  bool battery_low_remaining_time, geofence_breached
  bool fd_critical_failure: tilt beyond recovery
  bool fd_motor_failure

cpuload | The tick's share of its period, and memory; of real time alone | every second
  float load: median execution time over the period
  float ram_usage: largest so far over the machine's
""")
_AT_THE_TOOL: Final = declared("""
tool_contact | What the tool does at a surface that it may touch
    | near one, 50 Hz; every tick with `LOG_PROFILE` 1
  float[3] force: N, NED, on the tool, observed
  float pressed: N, of that along the normal
  float unsure: N, by which that may be wrong
  float commanded: N, what the joints press with
  float asked: N, by the plan
  float most: N, that the surface allows
  float distance: m, to where the surface is
  bool contact

payload | What the gripper holds
    | from the first command to it, 50 Hz; every tick with `LOG_PROFILE` 1
  float mass: kg, at the end-effector, weighed by the joints
  bool closed: the gripper
""")


def _of_sensor(topic: LogTopic) -> Topic:
    fields = [Field(one.name, one.kind, one.size, one.note) for one in topic.fields]
    about = f"{topic.meaning}; input of the tick"
    return Topic(topic.name, about, _INERTIAL.when, (_INERTIAL.fields[0], *fields))


# Each kind of sample and its topic, whose fields are the sample's, in their order, and SAMPLED.
OF_SAMPLES: Final[dict[type[Sample], Topic]] = {
    ImuSample: _INERTIAL,
    **{kind.sample: _of_sensor(kind.topic) for kind in SENSORS},
    JointSample: _ENCODERS,
}
TOPICS: Final = (
    *(*_FLIGHT, *OF_SAMPLES.values()),
    *(_STATUS, _INNOVATIONS, _BIAS, _TICK),
    *(*_OF_PX4, *_AT_THE_TOOL),
)
"""Everything the flight software writes; a topic's place is its number in the file.

Arrays of joints and rotors are as long here as those of the paper's vehicle; ``Topic.sized`` has
those of another one.
"""
BY_NAME: Final = {topic.name: topic for topic in TOPICS}
NUMBERS: Final = {topic.name: number for number, topic in enumerate(TOPICS)}
