"""SETUP_SIGNING: conditions for setting a signing key."""

from __future__ import annotations

from typing import cast

from fsw.link.signing.signing import Signing
from fsw.link.udp_endpoint import Address, is_loopback
from fsw.link.wire.decode import Numbers, for_this_vehicle
from fsw.signals import Severity, StatusText
from messages.frames import Frame


def set_up_signing(
    signing: Signing, frame: Frame, sender: Address, armed: bool
) -> StatusText | None:
    """Carry out SETUP_SIGNING.

    The key crosses the link in the clear, so only this machine may send it; and storing it takes
    time, which an armed vehicle does not have.

    Args:
        signing: Of the link it came on.
        frame: SETUP_SIGNING; already judged, so on a signed link it was signed.
        sender: Where it came from.
        armed: Whether actuators may move.

    Returns:
        The text for the operator; None if the message was not for this vehicle.
    """
    initial_time, system, component, *key = cast(Numbers, frame.payload_values)
    if not for_this_vehicle(system, component):
        return None
    if not is_loopback(sender):
        return StatusText(
            Severity.WARNING, "signing unchanged: a key is taken from this machine only"
        )
    if armed:
        return StatusText(Severity.WARNING, "signing unchanged: disarm first")
    try:
        signing.set_up(bytes(int(byte) for byte in key), int(initial_time))
    except OSError as error:
        return StatusText(
            Severity.WARNING, f"signing unchanged: the key cannot be kept, {error.strerror}"
        )
    return StatusText(Severity.NOTICE, "signing is on" if signing.active else "signing is off")
