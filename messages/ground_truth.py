"""Topics of the simulator's truth.

The simulator writes them into a file of its own, because the flight software must not see what
they say. The flight log declares them, so that both can be joined after the flight.
"""

from __future__ import annotations

from typing import Final

from messages.ulog import Field, Topic, doubles

SIM_GROUND_TRUTH: Final = Topic(
    "sim_ground_truth",
    "The simulator's true state",
    "50 Hz; every tick with `LOG_PROFILE` 1",
    (
        doubles("p_WB", 3, "m, NED"),
        doubles("v_WB", 3, "m/s, NED"),
        doubles("q_WB", 4, "[w, x, y, z], body to NED"),
        doubles("w_WB_B", 3, "rad/s, body"),
        Field("thrust", "double", 4, "N, of each rotor", "rotor"),
        Field("q_arm", "double", 2, "rad", "joint"),
        Field("qd_arm", "double", 2, "rad/s", "joint"),
    ),
)


def state_topic(rotors: int, joints: int) -> Topic:
    """The same of a vehicle with so many rotors and joints; the state vector is the record."""
    return SIM_GROUND_TRUTH.sized(rotor=rotors, joint=joints)


SIM_TRACKING: Final = Topic(
    "sim_tracking",
    "True end-effector, and the reference it should follow",
    "10 Hz",
    (doubles("p_WE", 3, "m, NED"), doubles("target", 3, "m, NED")),
)
# Under PX4's names, for tools that draw them beside the estimate.
ATTITUDE_TRUTH: Final = Topic(
    "vehicle_attitude_groundtruth",
    "True attitude",
    "10 Hz",
    (Field("q", "float", 4, "[w, x, y, z], body to NED"),),
)
RATES_TRUTH: Final = Topic(
    "vehicle_angular_velocity_groundtruth",
    "True body rates",
    "10 Hz",
    (Field("xyz", "float", 3, "rad/s, body"),),
)
POSITION_TRUTH: Final = Topic(
    "vehicle_local_position_groundtruth",
    "True position and velocity of the body origin",
    "10 Hz",
    (
        *(Field(name, "float", note="m, NED") for name in ("x", "y", "z")),
        *(Field(name, "float", note="m/s, NED") for name in ("vx", "vy", "vz")),
    ),
)
SIM_CONTACT: Final = Topic(
    "sim_contact",
    "What the tool touches and holds",
    "every tick, where a zone may be touched or there is a payload",
    (
        doubles("tip_force", 3, "N, NED, on the tip"),
        doubles("normal", 0, "N, along the normals of what it touches"),
        doubles("depth", 0, "m, of the tip below a surface"),
        doubles("asked", 0, "N, normal force that the reference asks for"),
        doubles("payload", 0, "kg, that the tool holds"),
    ),
)
TRUTH_TOPICS: Final = (
    SIM_GROUND_TRUTH,
    SIM_TRACKING,
    ATTITUDE_TRUTH,
    RATES_TRUTH,
    POSITION_TRUTH,
    SIM_CONTACT,
)
FIRST_NUMBER: Final = 1000  # of their subscriptions, out of the way of the flight software's
