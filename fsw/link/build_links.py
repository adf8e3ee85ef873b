"""Opens the links to the ground that were chosen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from command_line.folders import NoHomeError, state_folder
from fsw.autopilot.ports import Clock
from fsw.link.bounded_memory import RecordFrame, SentFrames
from fsw.link.gcs_link import GcsLink, LinkSetup
from fsw.link.ground_links import GroundLinks
from fsw.link.inbox import Inbox
from fsw.link.link_choice import LinkChoice, addresses
from fsw.link.services.service import LinkService, TimeService
from fsw.link.signing.key_file import KeyFile, NoKeyFile
from fsw.link.signing.signing import SignedTimes, Signing
from fsw.link.telemetry.streams import API_RATES, GROUND_RATES
from fsw.link.wire.outgoing import TelemetryContext

_GCS_PORT: Final = 18570  # of our own, as PX4 has it, if they are free
_API_PORT: Final = 14580


def build_links(
    choice: LinkChoice,
    inbox: Inbox,
    context: TelemetryContext,
    clocks: tuple[Clock, Clock],
    record: RecordFrame,
    services: Callable[[], Sequence[LinkService]],
    *,
    beside: bool = False,
) -> GroundLinks:
    """Open the links; ``clocks`` are monotonic time and Unix time [us].

    Only the ground station's link is recorded: the programs' link would repeat the same telemetry
    under the same sequence numbers. ``services`` makes what one link serves. A planner ``beside``
    PX4 leaves PX4 its ports.

    Raises:
        LinkError: An address is none, or a key cannot be trusted.
    """
    gcs, api = addresses(choice)
    now_us, unix_us = clocks
    remote = choice.allow_remote
    setups = [LinkSetup("gcs", gcs, _GCS_PORT + beside, GROUND_RATES, unheard=True, remote=remote)]
    if api is not None:
        # Until a program speaks, a heartbeat a second is all it needs to find the vehicle.
        setups.append(
            LinkSetup("api", api, _API_PORT + beside, API_RATES, unheard=False, remote=remote)
        )
    times, sent = SignedTimes(), SentFrames()
    links = [
        GcsLink(
            setup,
            inbox,
            context,
            Signing(number, unix_us, _key_file(choice, setup.name), times),
            now_us,
            record if number == 0 else None,
            (TimeService(), *services()),
            sent,
        )
        for number, setup in enumerate(setups)
    ]
    return GroundLinks(links, context.facts.tick_period_us, now_us)


def _key_file(choice: LinkChoice, link: str) -> KeyFile:
    """Where the signing key of a link of this name is kept."""
    try:
        return KeyFile((choice.keys or state_folder()) / f"signing-{link}.json")
    except NoHomeError:
        return NoKeyFile()
