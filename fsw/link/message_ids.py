"""Message ids and enum values of MAVLink that the link uses, by name."""

from typing import Final

HEARTBEAT: Final = 0
SYS_STATUS: Final = 1
PING: Final = 4
ATTITUDE: Final = 30
ATTITUDE_QUATERNION: Final = 31
LOCAL_POSITION_NED: Final = 32
COMMAND_INT: Final = 75
COMMAND_LONG: Final = 76
COMMAND_ACK: Final = 77
ATTITUDE_TARGET: Final = 83
POSITION_TARGET_LOCAL_NED: Final = 85
HIL_ACTUATOR_CONTROLS: Final = 93
HIL_SENSOR: Final = 107
FILE_TRANSFER_PROTOCOL: Final = 110
LOG_REQUEST_LIST: Final = 117
LOG_ENTRY: Final = 118
LOG_REQUEST_DATA: Final = 119
LOG_DATA: Final = 120
LOG_ERASE: Final = 121
LOG_REQUEST_END: Final = 122
EXTENDED_SYS_STATE: Final = 245
STATUSTEXT: Final = 253
ODOMETRY: Final = 331
ARM_JOINT_STATE: Final = 60200
ARM_JOINT_SETPOINT: Final = 60201
END_EFFECTOR_TARGET: Final = 60202
BARRIER_MARGIN: Final = 60203
MPC_STATUS: Final = 60204
LOOP_TIMING: Final = 60206
OBSTACLE_WALL: Final = 60207
WORKSPACE_SPHERE: Final = 60208

SYSTEM_ID: Final = 1  # the vehicle
AUTOPILOT: Final = 1  # MAV_COMP_ID_AUTOPILOT1: speaks common.xml
PANDION: Final = 191  # MAV_COMP_ID_ONBOARD_COMPUTER: speaks the dialect, with its own sequence
PATH_PLANNER: Final = 195  # MAV_COMP_ID_PATHPLANNER: the scenario's pilot, on the simulator link
