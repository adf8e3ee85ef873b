"""Opens the links to PX4 and to the arm at the addresses that were chosen."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

from fsw.autopilot.ports import Clock, VehicleFacts
from fsw.link.endpoints import open_endpoint
from fsw.link.inbox import Inbox
from fsw.link.px4.arm import ArmLink, Joints
from fsw.link.px4.link import MIN_BYTES_PER_S, PX4_PORT, Px4Link
from fsw.link.udp_endpoint import LinkError
from messages.addresses import LinkAddress, parse_link_address


class Px4Addresses(NamedTuple):
    """Where PX4 is, and where the arm speaks; None: on no link of its own."""

    px4: LinkAddress
    arm: LinkAddress | None


def px4_addresses(px4: str, arm: str | None) -> Px4Addresses:
    """Read addresses.

    Raises:
        LinkError: One of them is none, or PX4's is a line that is too slow for its estimate.
    """
    found = Px4Addresses(parse_link_address(px4), None if arm is None else parse_link_address(arm))
    speed = None if isinstance(found.px4, tuple) else found.px4.bytes_per_s
    if speed is not None and speed < MIN_BYTES_PER_S:
        raise LinkError(
            f"{px4} takes {speed} bytes/s and PX4's estimate needs {MIN_BYTES_PER_S}; "
            "use 460800 baud or more"
        )
    return found


def open_px4(
    where: Px4Addresses, inbox: Inbox, facts: VehicleFacts, clock: Clock, *, servos: bool = False
) -> Px4Link:
    """Open the links; joints are PX4's ``servos``, without a link of the arm they are anyway.

    Raises:
        LinkError: One cannot be opened, or is too slow.
    """

    def arm_link(joints: Joints, address: LinkAddress) -> ArmLink:
        return ArmLink(address, joints, inbox, clock)

    endpoint, peer = open_endpoint(where.px4, clock, PX4_PORT)
    arm = None if where.arm is None else partial(arm_link, address=where.arm)
    return Px4Link(endpoint, peer, inbox, facts, clock, arm, servos=servos)
