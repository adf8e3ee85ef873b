"""Message ids and enum values of MAVLink that the simulator uses, by name."""

from typing import Final

HEARTBEAT: Final = 0
COMMAND_LONG: Final = 76
COMMAND_ACK: Final = 77
HIL_ACTUATOR_CONTROLS: Final = 93
HIL_SENSOR: Final = 107
HIL_GPS: Final = 113
DISTANCE_SENSOR: Final = 132
BATTERY_STATUS: Final = 147
STATUSTEXT: Final = 253
ODOMETRY: Final = 331
ARM_JOINT_STATE: Final = 60200
END_EFFECTOR_TARGET: Final = 60202
OBSTACLE_SHAPE: Final = 60211
JOINT_ENCODERS: Final = 60212
FORCE_TORQUE: Final = 60214

SYSTEM_ID: Final = 1  # the vehicle that is simulated
SENSORS: Final = 200  # component of the simulated sensors
PATH_PLANNER: Final = 195  # MAV_COMP_ID_PATHPLANNER: the scenario's pilot

CMD_LAND: Final = 21  # MAV_CMD
CMD_TAKEOFF: Final = 22
CMD_DO_SET_MODE: Final = 176
CMD_DO_GRIPPER: Final = 211
CMD_REBOOT_SHUTDOWN: Final = 246
CMD_ARM_DISARM: Final = 400
CMD_INJECT_FAILURE: Final = 420

ACCEPTED: Final = 0  # MAV_RESULT
TEMPORARILY_REJECTED: Final = 1
DENIED: Final = 2
UNSUPPORTED: Final = 3
IN_PROGRESS: Final = 5
