"""Missions, fences and rally points over MAVLink's mission protocol.

One transfer at a time a link; a second ground station, known by ids and address, is denied until it
has ended. An upload is collected aside and takes the old one's place whole, or not at all; it is
acknowledged once a tick has decided, whose text says why it is refused. The vehicle asks again for
an item that does not come; duplicates and items out of turn are passed over without an answer,
because each answer would bring forth another duplicate.

Source: https://mavlink.io/en/services/mission.html
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Final, NamedTuple, cast

from fsw.autopilot.signals import Severity, StatusText
from fsw.link.services.mission_store import (
    ACCEPTED,
    ALL_KINDS,
    EMPTY,
    ERROR,
    ROOM,
    Kind,
    Meaning,
    MissionStore,
    Upload,
)
from fsw.link.services.service import LinkService
from fsw.link.wire.decode import Numbers
from fsw.link.wire.encode_standard import current_values
from fsw.link.wire.mission_items import (
    DENIED,
    UNSUPPORTED,
    BadItem,
    MissionItem,
    Peer,
    encode_item,
    item_float,
    item_int,
)
from fsw.link.wire.outgoing import Outgoing, ServiceOutput
from messages import message_ids as ids
from messages.frames import Frame

_ReadItem = Callable[[Numbers], MissionItem]

# MAV_MISSION_RESULT
NO_SPACE: Final = 4
INVALID_SEQUENCE: Final = 13
CANCELLED: Final = 15

ASK_AGAIN_US: Final = 250_000
TRIES: Final = 20  # of asking for one item, which makes 5 s
REACHED_REPEATS: Final = 10  # of MISSION_ITEM_REACHED, as PX4 has them
_REPEAT_US: Final = 1_000_000
SILENCE_US: Final = 5_000_000  # ends a download that is not asked on


@dataclass(slots=True)
class _Incoming:
    """Items on their way in, until the tick has decided on them."""

    peer: Peer
    address: str  # two ground stations may have the same ids: QGroundControl's are always 255/190
    kind: Kind
    count: int
    items: list[MissionItem] = field(default_factory=list)
    meanings: list[Meaning] = field(default_factory=list)
    asked_us: int = 0
    tries: int = 0


class _Asked(NamedTuple):
    """An upload that the tick has yet to decide on, and who waits for its acknowledgement."""

    upload: Upload
    number: int  # MAV_MISSION_TYPE
    peer: Peer
    incoming: _Incoming | None  # None: lists were to be cleared


@dataclass(slots=True)
class _Download:
    """Items on their way out, as they were when it began."""

    peer: Peer
    address: str
    kind: Kind
    items: tuple[MissionItem, ...]
    last_received_us: int


class _Refused(Exception):
    """No transfer of a type of list can begin now; its MISSION_ACK says why."""

    def __init__(self, ack: Outgoing) -> None:
        super().__init__()
        self.ack = ack


class MissionService(LinkService):
    """The mission protocol on one link."""

    def __init__(self, store: MissionStore) -> None:
        self._store = store
        self._upload: _Incoming | None = None
        self._download: _Download | None = None
        self._done: _Incoming | None = None  # the last one
        self._asked: deque[_Asked] = deque()
        self._shown = store.progress
        self._show_again = False
        self._repeats = 0  # of MISSION_ITEM_REACHED that are still to be sent
        self._repeat_us = 0
        self._handlers: dict[int, Callable[[Numbers, Peer, int], Sequence[ServiceOutput]]] = {
            ids.MISSION_COUNT: self._count,
            ids.MISSION_ITEM: partial(self._take, item_float),
            ids.MISSION_ITEM_INT: partial(self._take, item_int),
            ids.MISSION_REQUEST_LIST: self._request_list,
            ids.MISSION_REQUEST: partial(self._send_item, False),
            ids.MISSION_REQUEST_INT: partial(self._send_item, True),
            ids.MISSION_ACK: self._ack,
            ids.MISSION_CLEAR_ALL: self._clear_all,
            ids.MISSION_SET_CURRENT: self._set_current,
            ids.MISSION_WRITE_PARTIAL_LIST: self._partial,
            ids.MISSION_REQUEST_PARTIAL_LIST: self._partial,
        }
        self.message_ids = frozenset(self._handlers)

    def handle(self, frame: Frame, t_us: int) -> Sequence[ServiceOutput]:
        """See :class:`~fsw.link.services.service.LinkService`."""
        values, peer = cast(Numbers, frame.payload_values), (frame.system_id, frame.component_id)
        try:
            return self._handlers[frame.message_id](values, peer, t_us)
        except _Refused as refused:
            return (refused.ack,)

    def poll(self, t_us: int) -> Sequence[ServiceOutput]:
        """Request missing items again, and report the mission's progress."""
        replies: list[ServiceOutput] = []
        if self._store.progress is not self._shown or self._show_again:
            replies += self._show_progress(t_us)
        elif self._repeats and t_us >= self._repeat_us:
            replies.append(self._reached(t_us))
        while self._asked and self._asked[0].upload.result is not None:
            replies += self._decided(self._asked.popleft())
        upload = self._upload
        if upload is None or len(upload.items) == upload.count:
            return replies
        if t_us - upload.asked_us >= ASK_AGAIN_US:
            if upload.tries < TRIES:
                replies.append(self._ask(upload, t_us))
            else:
                self._upload = None
                missing = f"item {len(upload.items)} was not received"
                replies.append(_answer(CANCELLED, upload.kind, upload.peer))
                replies.append(
                    StatusText(Severity.WARNING, f"upload aborted: {missing}; kept the old list")
                )
        return replies

    def _show_progress(self, t_us: int) -> list[Outgoing]:
        before, now = self._shown, self._store.progress
        self._shown, self._show_again = now, False
        values = current_values(now, self._store.in_mission, self._store.ids)
        replies = [Outgoing(ids.MISSION_CURRENT, values)]
        if now.reached_count > before.reached_count:
            self._repeats = 1 + REACHED_REPEATS
            replies.append(self._reached(t_us))
        elif now.reached < 0:
            self._repeats = 0  # begun again, or another mission
        return replies

    def _reached(self, t_us: int) -> Outgoing:
        """The item that was reached last, repeated for a while: it has no acknowledgement."""
        self._repeats -= 1
        self._repeat_us = t_us + _REPEAT_US
        return Outgoing(ids.MISSION_ITEM_REACHED, (self._shown.reached,))

    def _count(self, values: Numbers, peer: Peer, t_us: int) -> Sequence[ServiceOutput]:
        count, kind = int(values[0]), self._available(int(values[3]), peer, t_us)
        self._upload = self._download = self._done = None
        if count > ROOM[kind]:
            reason = f"{count} items of {kind.name.lower()}; the limit is {ROOM[kind]}"
            return self._refuse(BadItem(NO_SPACE, reason), kind, peer)
        self._upload = _Incoming(peer, self._address, kind, count)
        if count == 0:
            return self._finish(self._upload)
        return (self._ask(self._upload, t_us),)

    def _take(
        self, read: _ReadItem, values: Numbers, peer: Peer, t_us: int
    ) -> Sequence[ServiceOutput]:
        """Add the item that was asked for; the last one completes the upload."""
        seq, number = int(values[7]), int(values[14])
        upload = self._upload
        if upload is None or not self._is_of(upload, peer) or upload.kind != number:
            return self._stray(seq, number, peer)
        if seq >= upload.count:
            reason = f"item {seq} in an upload of {upload.count}"
            return self._refuse(BadItem(INVALID_SEQUENCE, reason), upload.kind, peer)
        if seq != len(upload.items):
            return ()
        try:
            item = read(values)
            upload.meanings.append(self._store.read(upload.kind, item))
        except BadItem as wrong:
            named = BadItem(wrong.result, f"item {seq}: {wrong.reason}")
            return self._refuse(named, upload.kind, peer)
        upload.items.append(item)
        if len(upload.items) == upload.count:
            return self._finish(upload)
        upload.tries = 0
        return (self._ask(upload, t_us),)

    def _stray(self, seq: int, number: int, peer: Peer) -> Sequence[ServiceOutput]:
        """Handle an item without an upload; the acknowledgement of the last one may be lost."""
        done = self._done
        if done is not None and self._is_of(done, peer) and done.kind == number:
            again = _answer(ACCEPTED, number, peer, self._store.ids[done.kind])
            return (again,) if seq == done.count - 1 else ()
        if self._is_of(self._upload, peer):
            return ()
        return (_answer(DENIED if self._upload else ERROR, number, peer),)

    def _ask(self, upload: _Incoming, t_us: int) -> Outgoing:
        upload.asked_us = t_us
        upload.tries += 1
        return Outgoing(ids.MISSION_REQUEST_INT, (len(upload.items), *upload.peer, upload.kind))

    def _finish(self, incoming: _Incoming) -> Sequence[ServiceOutput]:
        """Offer a whole list to the tick."""
        kind, peer = incoming.kind, incoming.peer
        lists = {kind: (tuple(incoming.items), tuple(incoming.meanings))}
        try:
            upload = self._store.offer(lists, self.source)
        except BadItem as refused:
            return self._refuse(refused, kind, peer)
        self._asked.append(_Asked(upload, kind, peer, incoming))
        return ()

    def _decided(self, asked: _Asked) -> Sequence[ServiceOutput]:
        """The acknowledgement of what the tick has decided on; it has said itself why not."""
        upload, number, peer, incoming = asked
        assert upload.result is not None
        if self._upload is incoming:
            self._upload = None
        accepted = upload.result == ACCEPTED
        ack = _answer(upload.result, number, peer, upload.identity(number) if accepted else 0)
        if incoming is None or not accepted:
            return (ack,)
        self._done = incoming
        text = f"{incoming.kind.name.lower()} of {incoming.count} items received"
        return (
            ack,
            StatusText(Severity.INFO, text),
            *(StatusText(Severity.WARNING, remark) for remark in upload.remarks),
        )

    def _request_list(self, values: Numbers, peer: Peer, t_us: int) -> Sequence[ServiceOutput]:
        kind = self._available(int(values[2]), peer, t_us)
        self._upload = None
        items = self._store.items[kind]
        self._download = _Download(peer, self._address, kind, items, t_us) if items else None
        count = (len(items), *peer, kind, self._store.ids[kind])
        return (Outgoing(ids.MISSION_COUNT, count),)

    def _send_item(
        self, as_int: bool, values: Numbers, peer: Peer, t_us: int
    ) -> Sequence[ServiceOutput]:
        """Send any item, in any order and repeatedly: requests and items may be lost."""
        seq, number = int(values[0]), int(values[3])
        download = self._download
        if download is None or not self._is_of(download, peer) or download.kind != number:
            kind = self._available(number, peer, t_us)
            download = _Download(peer, self._address, kind, self._store.items[kind], t_us)
        if seq >= len(download.items):
            return (_answer(INVALID_SEQUENCE, number, peer),)
        download.last_received_us = t_us
        return (encode_item(download.items[seq], seq, number, peer, as_int),)

    def _ack(self, values: Numbers, peer: Peer, t_us: int) -> Sequence[ServiceOutput]:
        """Handle the client's acknowledgement, which ends the transfer."""
        if self._is_of(self._download, peer):
            self._download = None
        if self._is_of(self._upload, peer) and values[2] != ACCEPTED:
            self._upload = None
        return ()

    def _clear_all(self, values: Numbers, peer: Peer, t_us: int) -> Sequence[ServiceOutput]:
        number = int(values[2])
        if number == ALL_KINDS:
            self._check_idle(number, peer, t_us)
            kinds = tuple(Kind)
        else:
            kinds = (self._available(number, peer, t_us),)
        self._upload = self._download = None
        try:
            upload = self._store.offer(dict.fromkeys(kinds, EMPTY), self.source)
        except BadItem as wrong:
            text = f"nothing cleared: {wrong.reason}"
            return _answer(wrong.result, number, peer), StatusText(Severity.WARNING, text)
        self._asked.append(_Asked(upload, number, peer, None))
        return ()

    def _set_current(self, values: Numbers, peer: Peer, t_us: int) -> Sequence[ServiceOutput]:
        seq = int(values[0])
        if self._store.set_current(seq):
            self._show_again = True
            return ()
        return (
            _answer(INVALID_SEQUENCE, Kind.MISSION, peer),
            StatusText(Severity.WARNING, f"there is no mission item {seq}"),
        )

    def _partial(self, values: Numbers, peer: Peer, t_us: int) -> Sequence[ServiceOutput]:
        """A part of a list cannot be checked by itself; ground stations then send all of it."""
        return (_answer(UNSUPPORTED, int(values[4]), peer),)

    def _available(self, number: int, peer: Peer, t_us: int) -> Kind:
        """The list of a MAV_MISSION_TYPE, if a transfer of it can begin now; else ``_Refused``."""
        if number not in ROOM:
            raise _Refused(_answer(UNSUPPORTED, number, peer))
        self._check_idle(number, peer, t_us)
        return Kind(number)

    def _check_idle(self, number: int, peer: Peer, t_us: int) -> None:
        """Refuse what another client's transfer is in the way of."""
        upload, download = self._upload, self._download
        if download is not None and t_us - download.last_received_us > SILENCE_US:
            download = self._download = None
        busy = upload or download
        if busy is not None and not self._is_of(busy, peer):
            raise _Refused(_answer(DENIED, number, peer))

    @property
    def _address(self) -> str:
        """Where the frame that is handled now came from."""
        return "" if self.source is None else self.source.address

    def _is_of(self, transfer: _Incoming | _Download | None, peer: Peer) -> bool:
        """Whether a transfer is of the client whose frame is handled now."""
        if transfer is None:
            return False
        return (transfer.peer, transfer.address) == (peer, self._address)

    def _refuse(self, refused: BadItem, kind: Kind, peer: Peer) -> Sequence[ServiceOutput]:
        self._upload = None
        text = f"{kind.name.lower()} refused: {refused.reason}"
        return (_answer(refused.result, kind, peer), StatusText(Severity.WARNING, text))


def _answer(result: int, kind: int, peer: Peer, opaque_id: int = 0) -> Outgoing:
    """MISSION_ACK; the id is that of the list which an upload has put on the vehicle."""
    return Outgoing(ids.MISSION_ACK, (*peer, result, kind, opaque_id))
