"""Which frames the services of a link hear."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from fsw.link.services.service import Dispatch, LinkService
from fsw.link.wire.outgoing import Outgoing
from messages import message_ids as ids
from messages.frames import Frame, FrameWriter, split, wire_fields


class Hearing(LinkService):
    """Counts what it hears."""

    message_ids = frozenset(
        {ids.FILE_TRANSFER_PROTOCOL, ids.LOG_ERASE, ids.PARAM_SET, ids.MISSION_COUNT, ids.PING}
    )

    def __init__(self) -> None:
        self.heard = 0

    def handle(self, frame: Frame, t_us: int) -> Sequence[Outgoing]:
        self.heard += 1
        return ()


def hears(message_id: int, system: int, component: int) -> bool:
    target = {"target_system": system, "target_component": component}
    values = [
        target.get(name, b"" if name == "param_id" else 0) for name in wire_fields(message_id)
    ]
    (frame,) = split(FrameWriter(255, 190).frame(message_id, *values))
    service = Hearing()
    Dispatch([service], lambda outgoing, t_us: None).handle(frame, 0)
    return service.heard == 1


@pytest.mark.parametrize("message_id", sorted(Hearing.message_ids - {ids.PING}))
def test_what_is_for_another_vehicle_is_left_to_it(message_id: int) -> None:
    assert not hears(message_id, 2, 1)
    assert not hears(message_id, 1, 100)
    assert hears(message_id, 1, 1)
    assert hears(message_id, 0, 0)
    assert hears(message_id, 1, ids.PANDION)
