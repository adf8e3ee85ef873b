"""One process of the system whose lockstep frames are packed and read by pymavlink itself.

The peer of ``python -m benchmarks lockstep``: the same loop, the same bytes, the usual library.
Run as ``python -m benchmarks.pymavlink_process sitl|fsw …``.
"""

from __future__ import annotations

import math
import runpy
import sys
from typing import Any, Final

from messages import dialect

_UNKNOWN: Final = [math.nan, *[0.0] * 20]
_STEP: Final = ("ODOMETRY", "ARM_JOINT_STATE", "HIL_SENSOR")


def main() -> None:
    """Swap the codec of one process and run it."""
    name = sys.argv[1]
    {"sitl": _swap_sitl, "fsw": _swap_fsw}[name]()
    sys.argv = [name, *sys.argv[2:]]
    runpy.run_module(name, run_name="__main__", alter_sys=True)


def _swap_sitl() -> None:
    from sitl.link import decode
    from sitl.link.encode import StepEncoder
    from sitl.simulation import Controls

    sender, receiver = _codec(200), _codec(200)
    general = decode.read_reply

    def datagram(self: Any, readings: Any, messages: Any) -> bytes:
        spoken: bytes = self.spoken(messages) if messages else b""
        return spoken + step(sender, readings)

    def read_reply(received: bytes, vehicle: Any) -> Any:
        messages = receiver.parse_buffer(received) or []
        if len(messages) != 1 or messages[0].get_type() != "HIL_ACTUATOR_CONTROLS":
            return general(received, vehicle)
        controls, (message,) = messages[0].controls, messages
        rotors, outputs = len(vehicle.rotors), len(vehicle.rotors) + len(vehicle.joints)
        shares = tuple(controls[:rotors]), tuple(controls[rotors:outputs])
        wanted = Controls(*shares, bool(message.mode & 128))
        return decode.VehicleReply(message.time_usec, wanted)

    StepEncoder.datagram = datagram  # type: ignore[method-assign]
    decode.read_reply = read_reply  # type: ignore[assignment]


def step(sender: Any, readings: Any) -> bytes:
    """The frames of one step, by pymavlink."""
    t_us, p, v, q, w, gyro, accel, angles, rates, torques, _ = readings
    still = [0.0, 0.0, 0.0]
    rest = [0.0] * (4 - len(angles))
    messages = (
        sender.odometry_encode(*(t_us, 1, 1, *p, list(q), *v, *w, _UNKNOWN, _UNKNOWN, 0, 6, 100)),
        sender.arm_joint_state_encode(
            t_us,
            [*angles, *rest],
            [*rates, *rest],
            [*torques, *rest],
            still,
            still,
            len(angles),
        ),
        sender.hil_sensor_encode(t_us, *accel, *gyro, *[0.0] * 7, 0x3F),
    )
    return b"".join(_packed(sender, message) for message in messages)


def _swap_fsw() -> None:
    from fsw.link.sim_link import SimLink
    from fsw.link.wire.encode_standard import hil_actuator_controls
    from messages.frames import Frame

    sender, receiver = _codec(1), _codec(1)
    general = SimLink._read

    def read(self: Any, datagram: bytes) -> Any:
        messages = receiver.parse_buffer(datagram) or []
        if tuple(message.get_type() for message in messages) != _STEP:
            return general(self, datagram)
        o, a, h = messages
        odometry = (o.time_usec, o.x, o.y, o.z, *o.q, o.vx, o.vy, o.vz)
        arm = (a.time_usec, *a.position, *a.velocity)
        hil = (h.time_usec, h.xacc, h.yacc, h.zacc, h.xgyro, h.ygyro, h.zgyro)
        frames = [
            Frame(1, one.get_srcComponent(), one.get_seq(), one.get_msgId(), values)
            for one, values in zip(messages, (odometry, arm, hil), strict=True)
        ]
        return self._new(frames[-1], *frames[:-1])

    def controls_of(self: Any, stamp_us: int, outputs: Any) -> bytes:
        t_us, flags, *controls, mode = hil_actuator_controls(self._airframe, stamp_us, outputs)
        message = sender.hil_actuator_controls_encode(t_us, controls, mode, flags)
        return _packed(sender, message)

    SimLink._read = read  # type: ignore[method-assign]
    SimLink._controls = controls_of  # type: ignore[method-assign]


def _packed(sender: Any, message: Any) -> bytes:
    """What ``sender.send`` would put on the link."""
    packed: bytes = message.pack(sender)
    sender.seq = (sender.seq + 1) % 256
    return packed


def _codec(component: int) -> Any:
    return dialect.MAVLink(None, srcSystem=1, srcComponent=component)


if __name__ == "__main__":
    main()
