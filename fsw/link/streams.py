"""What is sent to ground stations, and how often: one table.

Rates are counted in ticks, that is in sensor time, so they are the same in real time and in
lockstep at any speed. Each rate is exact over a second, and the streams are spread over the ticks
so that they do not all fall on one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from fsw.link import encode_dialect, encode_standard, message_ids
from fsw.link.message_ids import AUTOPILOT, PANDION
from fsw.link.telemetry import TelemetryContext
from fsw.signals import FlightSnapshot

Encoder = Callable[[FlightSnapshot, TelemetryContext], tuple[float | bytes, ...] | None]


@dataclass(frozen=True, slots=True)
class Stream:
    """One message at one rate from one component."""

    message_id: int
    rate_hz: int
    component: int
    encode: Encoder


HEARTBEAT: Final = Stream(message_ids.HEARTBEAT, 1, AUTOPILOT, encode_standard.heartbeat)

# HEARTBEAT also leaves at once when mode or arming change; COMMAND_ACK and STATUSTEXT as they come.
STREAMS: Final = (
    HEARTBEAT,
    Stream(message_ids.SYS_STATUS, 2, AUTOPILOT, encode_standard.sys_status),
    Stream(message_ids.EXTENDED_SYS_STATE, 1, AUTOPILOT, encode_standard.extended_sys_state),
    Stream(message_ids.ATTITUDE, 50, AUTOPILOT, encode_standard.attitude),
    Stream(message_ids.ATTITUDE_QUATERNION, 10, AUTOPILOT, encode_standard.attitude_quaternion),
    Stream(message_ids.LOCAL_POSITION_NED, 30, AUTOPILOT, encode_standard.local_position),
    Stream(message_ids.POSITION_TARGET_LOCAL_NED, 10, AUTOPILOT, encode_standard.position_target),
    Stream(message_ids.ATTITUDE_TARGET, 10, AUTOPILOT, encode_standard.attitude_target),
    Stream(message_ids.ARM_JOINT_STATE, 30, PANDION, encode_dialect.arm_joint_state),
    Stream(message_ids.ARM_JOINT_SETPOINT, 10, PANDION, encode_dialect.arm_joint_setpoint),
    Stream(message_ids.END_EFFECTOR_TARGET, 10, PANDION, encode_dialect.end_effector_target),
    Stream(message_ids.BARRIER_MARGIN, 10, PANDION, encode_dialect.barrier_margin),
    Stream(message_ids.MPC_STATUS, 10, PANDION, encode_dialect.mpc_status),
    Stream(message_ids.LOOP_TIMING, 1, PANDION, encode_dialect.inner_timing),
    Stream(message_ids.LOOP_TIMING, 1, PANDION, encode_dialect.mpc_timing),
)


def schedule(streams: tuple[Stream, ...], ticks_per_second: int) -> tuple[tuple[Stream, ...], ...]:
    """Lay the streams out over one second.

    Args:
        streams: Rates of at most one message a tick.
        ticks_per_second: Ticks in a second.

    Returns:
        For each tick of a second the streams that are due; message k of a stream of rate r is due
        ``floor((k + 1/2) * ticks_per_second / r)`` ticks after the stream's phase, and each phase
        is the one at which the busiest tick it meets is least busy.

    Raises:
        ValueError: A rate is not between 1 and the tick rate.
    """
    slots: list[list[Stream]] = [[] for _ in range(ticks_per_second)]
    # The fast streams have the least freedom, so they choose first.
    for stream in sorted(streams, key=lambda stream: -stream.rate_hz):
        if not 1 <= stream.rate_hz <= ticks_per_second:
            raise ValueError(f"stream rate {stream.rate_hz} Hz is outside 1..{ticks_per_second}")
        for tick in min(_placements(stream.rate_hz, slots), key=lambda p: _crowding(p, slots)):
            slots[tick].append(stream)
    return tuple(tuple(slot) for slot in slots)


def _placements(rate_hz: int, slots: list[list[Stream]]) -> list[list[int]]:
    ticks = len(slots)
    offsets = [(2 * k + 1) * ticks // (2 * rate_hz) for k in range(rate_hz)]
    return [[(offset + phase) % ticks for offset in offsets] for phase in range(ticks // rate_hz)]


def _crowding(ticks: list[int], slots: list[list[Stream]]) -> tuple[int, int]:
    loads = [len(slots[tick]) for tick in ticks]
    return max(loads), sum(loads)
