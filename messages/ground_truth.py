"""Topics of the simulator's truth.

The simulator writes them into a file of its own, because the flight software must not see what
they say. The flight log declares them, so that both can be joined after the flight.
"""

from __future__ import annotations

from typing import Final

from messages.ulog import Topic, declared

TRUTH_TOPICS: Final = declared("""
sim_ground_truth | The simulator's true state | 50 Hz; every tick with `LOG_PROFILE` 1
  double[3] p_WB: m, NED
  double[3] v_WB: m/s, NED
  double[4] q_WB: [w, x, y, z], body to NED
  double[3] w_WB_B: rad/s, body
  double[rotor] thrust: N, of each rotor
  double[joint] q_arm: rad
  double[joint] qd_arm: rad/s

sim_tracking | True end-effector, and the reference it should follow | 10 Hz
  double[3] p_WE, target: m, NED

vehicle_attitude_groundtruth | True attitude | 10 Hz
  float[4] q: [w, x, y, z], body to NED

vehicle_angular_velocity_groundtruth | True body rates | 10 Hz
  float[3] xyz: rad/s, body

vehicle_local_position_groundtruth | True position and velocity of the body origin | 10 Hz
  float x, y, z: m, NED
  float vx, vy, vz: m/s, NED

sim_contact | What the tool touches and holds
    | every tick, where a zone may be touched or there is a payload
  double[3] tip_force: N, NED, on the tip
  double normal: N, along the normals of what it touches
  double depth: m, of the tip below a surface
  double asked: N, normal force that the reference asks for
  double payload: kg, that the tool holds
""")
(
    SIM_GROUND_TRUTH,
    SIM_TRACKING,
    # Under PX4's names, for tools that draw them beside the estimate.
    ATTITUDE_TRUTH,
    RATES_TRUTH,
    POSITION_TRUTH,
    SIM_CONTACT,
) = TRUTH_TOPICS
FIRST_NUMBER: Final = 1000  # of their subscriptions, out of the way of the flight software's


def state_topic(rotors: int, joints: int) -> Topic:
    """SIM_GROUND_TRUTH of a vehicle with so many rotors and joints: its state vector."""
    return SIM_GROUND_TRUTH.sized(rotor=rotors, joint=joints)
