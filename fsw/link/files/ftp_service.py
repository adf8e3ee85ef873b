"""MAVLink FTP, to read only: every request is answered, with a refusal if need be.

Reads, bursts and checksums are jobs: they go on a little each tick and wait for no disk.

Source: https://mavlink.io/en/services/ftp.html
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias, cast

from fsw.link.bounded_memory import renew
from fsw.link.files import ftp_jobs
from fsw.link.files.ftp_jobs import MAX_DATA, MAX_FILE, Job, Reply, Request, refused
from fsw.link.files.served_file import Directory, Node, OpenFile
from fsw.link.services.service import LinkService
from fsw.link.wire.outgoing import Outgoing
from messages import dialect, message_ids
from messages.frames import Frame

_FRAMES: Final = 10  # a tick: two datagrams
_DATAGRAM_FRAMES: Final = 5
_MAX_JOBS: Final = 12
_MAX_SESSIONS: Final = 8
_EXPIRY_US: Final = 30_000_000  # of a session without a read: its client has gone without a word
_MAX_REMEMBERED: Final = 8  # clients
_REMEMBERED_US: Final = 3_000_000  # a client has given up repeating by then
_WRITES: Final = range(dialect.MAV_FTP_OPCODE_CREATEFILE, dialect.MAV_FTP_OPCODE_RENAME + 1)
_NO_SESSION: Final = -1

Client: TypeAlias = tuple[int, int]
"""System and component id."""

_Key: TypeAlias = tuple[Client, int]
"""A client and the number of its session."""


@dataclass(slots=True)
class _Session:
    """An open file."""

    file: OpenFile
    used_us: int


@dataclass(frozen=True, slots=True)
class _Answered:
    """A request that must run once only, because it opens or closes a session."""

    payload: bytes
    answer: Outgoing
    t_us: int


@dataclass(slots=True)
class _Running:
    client: Client
    request: Request
    job: Job
    sequence: int  # of the last message


class FtpService(LinkService):
    """Serves one tree of files on one link."""

    message_ids = frozenset({message_ids.FILE_TRANSFER_PROTOCOL})

    def __init__(self, root: Directory) -> None:
        self._root = root
        self._sessions: dict[_Key, _Session] = {}
        self._answered: dict[Client, _Answered] = {}
        self._jobs: dict[_Key, _Running] = {}
        self._handlers: dict[int, Callable[[Request, Client, int], Reply | None]] = {
            dialect.MAV_FTP_OPCODE_TERMINATESESSION: self._terminate,
            dialect.MAV_FTP_OPCODE_RESETSESSION: self._reset,
            dialect.MAV_FTP_OPCODE_LISTDIRECTORY: self._list_directory,
            dialect.MAV_FTP_OPCODE_OPENFILERO: self._open,
            dialect.MAV_FTP_OPCODE_READFILE: self._read,
            dialect.MAV_FTP_OPCODE_BURSTREADFILE: self._read,
            dialect.MAV_FTP_OPCODE_CALCFILECRC: self._checksum,
        }

    def handle(self, frame: Frame, t_us: int) -> Sequence[Outgoing]:
        """Answer a request, or start the job that will."""
        _, _, _, *payload = cast("tuple[int, ...]", frame.payload_values)
        client, packed = (frame.system_id, frame.component_id), bytes(payload)
        before = self._answered.get(client)
        if before and before.payload == packed and t_us - before.t_us < _REMEMBERED_US:
            return [before.answer]
        request = ftp_jobs.read_request(packed)
        reply = self._answer(request, client, t_us)
        if reply is None:
            return ()
        answer = _outgoing(reply, request, request.sequence + 1, client)
        if request.opcode in (
            dialect.MAV_FTP_OPCODE_OPENFILERO,
            dialect.MAV_FTP_OPCODE_TERMINATESESSION,
        ):
            renew(self._answered, client, _Answered(packed, answer, t_us), _MAX_REMEMBERED)
        return [answer]

    def poll(self, t_us: int) -> Sequence[Outgoing]:
        """Go on with the jobs, each in its turn."""
        return self._go_on(list(self._jobs), _FRAMES) if self._jobs else ()

    def bulk(self, t_us: int) -> Sequence[Outgoing]:
        """Go on with the bursts: after each the client asks for the next one."""
        if not self._jobs:
            return ()
        burst = dialect.MAV_FTP_OPCODE_BURSTREADFILE
        bursts = [key for key, one in self._jobs.items() if one.request.opcode == burst]
        return self._go_on(bursts, _DATAGRAM_FRAMES)

    def _go_on(self, ready: list[_Key], frames: int) -> list[Outgoing]:
        answers: list[Outgoing] = []
        while ready and len(answers) < frames:
            key = ready.pop(0)
            running = self._jobs.pop(key)
            try:
                reply = next(running.job)
            except StopIteration:
                continue
            self._jobs[key] = running
            if reply is None:
                break  # it has worked, or waits: the others at the next tick, in their turn
            running.sequence += 1
            answers.append(_outgoing(reply, running.request, running.sequence, running.client))
            ready.append(key)
        return answers

    def _answer(self, request: Request, client: Client, t_us: int) -> Reply | None:
        """The answer; None if a job gives it."""
        if request.size > MAX_DATA:  # it announces more than there is room for
            return refused(dialect.MAV_FTP_ERR_INVALIDDATASIZE)
        handler = self._handlers.get(request.opcode)
        if handler is not None:
            return handler(request, client, t_us)
        if request.opcode in _WRITES:
            return refused(dialect.MAV_FTP_ERR_FILEPROTECTED)
        return refused(dialect.MAV_FTP_ERR_UNKNOWNCOMMAND)

    def _terminate(self, request: Request, client: Client, t_us: int) -> Reply:
        if (client, request.session) not in self._sessions:
            return refused(dialect.MAV_FTP_ERR_INVALIDSESSION)
        self._close((client, request.session))
        return Reply()

    def _reset(self, request: Request, client: Client, t_us: int) -> Reply:
        # Those of the client: another ground station goes on with its download.
        for key in [key for key in self._sessions if key[0] == client]:
            self._close(key)
        return Reply()

    def _list_directory(self, request: Request, client: Client, t_us: int) -> Reply:
        directory = find(self._root, request.path)
        if not isinstance(directory, Mapping):
            return refused(dialect.MAV_FTP_ERR_FILENOTFOUND)
        entries = listing(directory, request.offset)
        if not entries:
            return refused(dialect.MAV_FTP_ERR_EOF)
        return Reply(entries, request.offset)

    def _open(self, request: Request, client: Client, t_us: int) -> Reply:
        node = find(self._root, request.path)
        if node is None or isinstance(node, Mapping):
            return refused(dialect.MAV_FTP_ERR_FILENOTFOUND)
        number = self._room(client, request.session, t_us)
        if number is None:
            return refused(dialect.MAV_FTP_ERR_NOSESSIONSAVAILABLE)
        try:
            file = node.open()
        except OSError:
            return refused(dialect.MAV_FTP_ERR_FILENOTFOUND)
        # Clients read up to the size that they are told, which has 32 bits.
        size = ftp_jobs.served_size(file).to_bytes(4, "little")
        self._sessions[client, number] = _Session(file, t_us)
        return Reply(size, session=number)

    def _room(self, client: Client, wanted: int, t_us: int) -> int | None:
        """A number for a further session; None if there are as many as there may be.

        Some clients choose the number of a session when they open a file, others take the one that
        is answered; so the wanted number is given unless the client has it open already.
        """
        for key, session in list(self._sessions.items()):
            if t_us - session.used_us > _EXPIRY_US:
                self._sessions.pop(key).file.close()
        if len(self._sessions) >= _MAX_SESSIONS and not self._make_room(client):
            return None
        numbers: tuple[int, ...] = (wanted, *range(_MAX_SESSIONS))
        return next(number for number in numbers if (client, number) not in self._sessions)

    def _make_room(self, client: Client) -> bool:
        """Close the session that was used longest ago of who has most, so that nobody has all.

        False: nobody has more than the ``client`` would have.
        """
        held = Counter(holder for holder, _ in self._sessions)
        holder = max(held, key=held.__getitem__)
        if held[holder] <= held[client] + 1:
            return False
        of_holder = [key for key in self._sessions if key[0] == holder]
        self._close(min(of_holder, key=lambda key: self._sessions[key].used_us))
        return True

    def _read(self, request: Request, client: Client, t_us: int) -> Reply | None:
        session = self._sessions.get((client, request.session))
        if session is None:
            return refused(dialect.MAV_FTP_ERR_INVALIDSESSION)
        session.used_us = t_us
        burst = request.opcode == dialect.MAV_FTP_OPCODE_BURSTREADFILE
        job = (ftp_jobs.burst if burst else ftp_jobs.read)(request, session.file)
        self._start(request, client, job)
        return None

    def _checksum(self, request: Request, client: Client, t_us: int) -> Reply | None:
        running = self._jobs.get((client, _NO_SESSION))
        if running is not None and running.request == request:
            return None  # asked again because it takes long
        node = find(self._root, request.path)
        if node is None or isinstance(node, Mapping):
            return refused(dialect.MAV_FTP_ERR_FILENOTFOUND)
        if len(self._jobs) >= _MAX_JOBS:
            return refused(dialect.MAV_FTP_ERR_FAIL)
        self._start(request, client, ftp_jobs.checksum(node))
        return None

    def _start(self, request: Request, client: Client, job: Job) -> None:
        """Start a job; it replaces the client's job of the same session."""
        reads = request.opcode != dialect.MAV_FTP_OPCODE_CALCFILECRC
        key = client, request.session if reads else _NO_SESSION
        self._stop(key)
        self._jobs[key] = _Running(client, request, job, request.sequence)

    def _stop(self, key: _Key) -> None:
        running = self._jobs.pop(key, None)
        if running is not None:
            running.job.close()

    def _close(self, key: _Key) -> None:
        self._stop(key)
        self._sessions.pop(key).file.close()


def _outgoing(reply: Reply, request: Request, sequence: int, client: Client) -> Outgoing:
    payload = bytes((0, *client)) + ftp_jobs.write_reply(reply, request, sequence)
    return Outgoing(message_ids.FILE_TRANSFER_PROTOCOL, payload)


def find(root: Directory, path: bytes) -> Node | None:
    """Look a path up; None if there is nothing of that name.

    No path of a client ever reaches the file system, and what is not in the tree does not exist: so
    there is no way out of it, whatever a path is made of.
    """
    try:
        parts = path.decode().split("/")
    except UnicodeDecodeError:
        return None
    node: Node = root
    for part in parts:
        if part in ("", "."):
            continue
        if not isinstance(node, Mapping) or part not in node:
            return None
        node = node[part]
    return node


def listing(directory: Directory, first: int) -> bytes:
    """Entries from number ``first`` on, as many as fit one message; empty when there are no more.

    An entry is ``D``, name, NUL for a directory; ``F``, name, tab, size, NUL for a file.
    """
    entries = b""
    for name in list(directory)[first:]:
        node = directory[name]
        if isinstance(node, Mapping):
            entry = f"D{name}\0".encode()
        else:
            entry = f"F{name}\t{min(node.size, MAX_FILE)}\0".encode()
        if len(entries) + len(entry) > MAX_DATA:
            break
        entries += entry
    return entries
