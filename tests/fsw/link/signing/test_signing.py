"""Signing, with pymavlink's own as the independent oracle, in both directions."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from fsw.link.endpoints import LinkError
from fsw.link.ground_links import build_links
from fsw.link.inbox import Inbox
from fsw.link.link_choice import LinkChoice
from fsw.link.signing.key_file import KeyFile, SigningKey
from fsw.link.signing.signing import FrameTrust, SignedTimes
from messages import dialect
from messages import message_ids as ids
from messages.frames import FrameWriter, as_version_1, is_signed, split
from tests.fsw.link.ground import Ground, ManualClock, Unkept, ground_station, station_socket
from tests.fsw.link.snapshots import CONTEXT, outputs_at

KEY = bytes(range(1, 33))
OTHER_KEY = bytes(range(2, 34))
EPOCH_UNIX_US = 1_420_070_400_000_000
MINUTE = 6_000_000  # in units of signing time
LATEST = (1 << 48) - 1
ARM = (1.0, *(0.0,) * 6, 400, 1, 1, 0)


class Client:
    """pymavlink, signing."""

    def __init__(self, ground: Ground, key: bytes = KEY, system: int = 255) -> None:
        self._ground = ground
        self.mav = dialect.MAVLink(None, srcSystem=system, srcComponent=190)
        self.mav.signing.secret_key = key
        self.mav.signing.sign_outgoing = True
        self.mav.signing.link_id = 3
        self.mav.signing.timestamp = self.now()

    def now(self) -> int:
        return (self._ground.clock.unix_us - EPOCH_UNIX_US) // 10

    def at(self, time: int) -> Client:
        self.mav.signing.timestamp = time
        return self

    def arm(self) -> bytes:
        message = dialect.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
        return bytes(message.pack(self.mav))

    def beat(self) -> bytes:
        return bytes(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(self.mav))

    def set_up(self, key: bytes) -> bytes:
        message = dialect.MAVLink_setup_signing_message(1, 1, list(key), self.now())
        return bytes(message.pack(self.mav))


def unsigned(message_id: int, *values: float) -> bytes:
    return FrameWriter(255, 190).frame(message_id, *values)


def set_up(key: bytes = KEY, time: int = 0) -> bytes:
    return unsigned(ids.SETUP_SIGNING, time, 1, 1, *key)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "keys" / "signing-test.json"


@pytest.fixture
def ground(file: Path) -> Iterator[Ground]:
    with ground_station(key_file=KeyFile(file)) as ground:
        ground.fly(5, armed=False)
        ground.polled(set_up())
        assert ground.link.signing.active
        ground.heard()
        yield ground


def commands(ground: Ground) -> int:
    return len(ground.inbox.take().commands)


def test_pymavlink_believes_what_we_sign_and_only_with_the_key(ground: Ground) -> None:
    def read(key: bytes, datagrams: list[bytes]) -> tuple[int, int]:
        reader = dialect.MAVLink(None)
        reader.robust_parsing = True
        reader.signing.secret_key = key
        messages: list[Any] = []
        for datagram in datagrams:
            messages += reader.parse_buffer(bytearray(datagram)) or []
        good = sum(message.get_type() != "BAD_DATA" for message in messages)
        return good, reader.signing.badsig_count

    ground.heard()
    for _ in range(100):
        ground.clock.pass_s(0.002)
        ground.fly(1)
    ground.fly(100)  # the wall clock stands still: times still grow
    kept = [raw for _, raw in ground.recorded if is_signed(raw)]
    good, bad = read(KEY, kept)
    assert good == len(kept) > 30
    assert bad == 0
    assert read(OTHER_KEY, kept)[1] == len(kept)


def test_we_believe_what_pymavlink_signs(ground: Ground) -> None:
    client = Client(ground)
    for _ in range(3):
        ground.polled(client.arm())
    assert commands(ground) == 3


@pytest.mark.requirement("REQ-LINK-3")
def test_unsigned_commands_do_nothing(ground: Ground) -> None:
    stranger = station_socket()
    ground.polled(unsigned(ids.COMMAND_LONG, *ARM), stranger)
    ground.polled(unsigned(ids.COMMAND_LONG, 30.0, 1e5, *(0.0,) * 5, 511, 1, 1, 0), stranger)
    ground.polled(unsigned(ids.TIMESYNC, 0, 1), stranger)
    assert commands(ground) == 0
    assert ground.heard() == []
    assert ground.link.rates.interval_us(ids.ATTITUDE) == 20_000
    assert ground.link.signing.counters.unsigned == 3
    stranger.close()


def test_presence_needs_no_signature_but_teaches_no_peer(ground: Ground) -> None:
    stranger = station_socket()
    ground.polled(unsigned(ids.HEARTBEAT, 0, 6, 8, 0, 4, 3), stranger)
    ground.polled(unsigned(ids.RADIO_STATUS, 0, 0, 1, 1, 1, 1, 1), stranger)
    assert ground.link.signing.counters.unsigned == 0
    assert stranger.getsockname() not in ground.link.peers.all
    stranger.close()


@pytest.mark.requirement("REQ-LINK-4")
def test_only_a_signed_heartbeat_is_a_sign_of_life(ground: Ground) -> None:
    """Anybody could keep a lost station alive otherwise, or have a failsafe wait for a silence."""
    ground.inbox.take()
    ground.polled(unsigned(ids.HEARTBEAT, 6, 8, 0, 0, 4, 3), station_socket())
    ground.polled(unsigned(ids.HEARTBEAT, 0, 6, 8, 0, 4, 3), station_socket())
    assert not ground.inbox.take().ground_station_heard
    ground.polled(Client(ground).beat())
    assert ground.inbox.take().ground_station_heard


@pytest.mark.requirement("REQ-LINK-3")
def test_a_tampered_frame_does_nothing_and_locks_nobody_out(ground: Ground) -> None:
    """Stock pymavlink believes a forged time before it has checked the hash."""
    client = Client(ground)
    frame = bytearray(client.arm())
    far = client.now() + 20 * 365 * 86_400 * 100_000
    frame[-12:-6] = far.to_bytes(6, "little")
    ground.polled(bytes(frame))
    for place in range(len(frame) - 13, len(frame)):
        broken = bytearray(client.arm())
        broken[place] ^= 1
        ground.polled(bytes(broken))
    assert commands(ground) == 0
    assert ground.link.signing.counters.wrong_hash == 14
    ground.polled(client.arm())
    assert commands(ground) == 1


@pytest.mark.requirement("REQ-LINK-3")
def test_a_wrong_key_is_refused(ground: Ground) -> None:
    ground.polled(Client(ground, OTHER_KEY).arm())
    assert commands(ground) == 0
    assert ground.link.signing.counters.wrong_hash == 1


@pytest.mark.requirement("REQ-LINK-3")
def test_a_replayed_frame_is_refused(ground: Ground) -> None:
    client = Client(ground)
    first, second = client.arm(), client.arm()
    ground.polled(first)
    ground.polled(second)
    ground.polled(first)
    ground.polled(second)
    assert commands(ground) == 2
    assert ground.link.signing.counters.wrong_time == 2


def test_each_sender_has_a_time_of_its_own(ground: Ground) -> None:
    ahead, behind = Client(ground, system=255), Client(ground, system=254)
    ground.polled(ahead.at(ahead.now() + MINUTE // 2).arm())
    ground.polled(behind.arm())
    assert commands(ground) == 2


@pytest.mark.parametrize(
    ("offset", "believed"),
    [(MINUTE - 10, True), (MINUTE + 10, False), (-MINUTE + 10, True), (-MINUTE - 10, False)],
)
def test_a_new_sender_may_be_off_by_a_minute(ground: Ground, offset: int, believed: bool) -> None:
    client = Client(ground)
    ground.polled(client.at(client.now() + offset).arm())
    assert commands(ground) == believed


def test_the_key_is_for_its_owners_eyes_and_outlives_the_process(
    ground: Ground, file: Path
) -> None:
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert [path.name for path in file.parent.iterdir()] == [file.name]
    old = Client(ground).arm()
    ground.polled(old)
    ground.link.close()
    with ground_station(key_file=KeyFile(file)) as restarted:
        restarted.fly(5)
        assert all(is_signed(raw) for _, raw in restarted.recorded)
        restarted.polled(unsigned(ids.COMMAND_LONG, *ARM))
        restarted.polled(old)  # recorded before, played again
        assert commands(restarted) == 0
        restarted.polled(Client(restarted).at(Client(restarted).now() + 5).arm())
        assert commands(restarted) == 1


@pytest.mark.requirement("REQ-LINK-3")
def test_a_process_that_is_killed_leaves_the_newest_time_to_the_next_one(
    ground: Ground, file: Path
) -> None:
    old = Client(ground).arm()
    ground.polled(old)  # and nothing is closed
    ground.clock.pass_s(19.6)
    with ground_station(key_file=KeyFile(file)) as restarted:
        restarted.fly(5)
        restarted.polled(old)
        assert commands(restarted) == 0
        assert restarted.link.signing.counters.wrong_time == 1
        restarted.polled(Client(restarted).at(Client(restarted).now() + 5).arm())
        assert commands(restarted) == 1


@pytest.mark.requirement("REQ-LINK-3")
def test_a_frame_of_one_link_cannot_be_played_to_another_with_the_same_key(tmp_path: Path) -> None:
    times = SignedTimes()
    with ground_station(times=times) as gcs, ground_station(times=times, api=True) as api:
        for ground in (gcs, api):
            ground.fly(5, armed=False)
            ground.polled(set_up())
        old = Client(gcs).arm()
        gcs.polled(old)
        api.polled(old)
        assert (commands(gcs), commands(api)) == (1, 0)
        assert api.link.signing.counters.wrong_time == 1
        late = Client(api).at(Client(api).now() + 5).arm()
        api.polled(late)
        gcs.polled(late)
        assert (commands(gcs), commands(api)) == (0, 1)


def test_links_with_keys_of_their_own_have_times_of_their_own() -> None:
    times = SignedTimes()
    with ground_station(times=times) as gcs, ground_station(times=times, api=True) as api:
        for ground, key in ((gcs, KEY), (api, OTHER_KEY)):
            ground.fly(5, armed=False)
            ground.polled(set_up(key))
        ahead = Client(gcs).at(Client(gcs).now() + MINUTE // 2)
        gcs.polled(ahead.arm())
        api.polled(Client(api, OTHER_KEY).arm())
        assert (commands(gcs), commands(api)) == (1, 1)


@pytest.mark.requirement("REQ-LINK-3")
def test_the_time_of_one_link_is_kept_in_the_file_of_each_that_has_the_key(tmp_path: Path) -> None:
    files = [tmp_path / "gcs.json", tmp_path / "api.json"]
    times = SignedTimes()
    with (
        ground_station(times=times, key_file=KeyFile(files[0])) as gcs,
        ground_station(times=times, key_file=KeyFile(files[1]), api=True) as api,
    ):
        for ground in (gcs, api):
            ground.fly(5, armed=False)
            ground.polled(set_up())
        old = Client(gcs).arm()
        gcs.polled(old)  # and the process is killed: nothing is closed
        kept = [KeyFile(file).read(LATEST) for file in files]
    assert kept == [SigningKey(KEY, int.from_bytes(old[-12:-6], "little"))] * 2
    # The programs' link alone, after a restart and without what the other one kept.
    with ground_station(key_file=KeyFile(files[1]), api=True) as restarted:
        restarted.fly(5)
        restarted.polled(old)
        assert commands(restarted) == 0


@pytest.mark.requirement("REQ-LINK-3")
def test_after_a_restart_the_newest_time_in_any_file_of_the_key_counts(tmp_path: Path) -> None:
    """A link may have been off when the other one's time was kept."""
    old, new = KeyFile(tmp_path / "gcs.json"), KeyFile(tmp_path / "api.json")
    new.write(SigningKey(KEY, 500))
    old.write(SigningKey(KEY, 300))
    for file in (old, new):
        file.close()
    times = SignedTimes()
    with (
        ground_station(times=times, key_file=KeyFile(tmp_path / "gcs.json")),
        ground_station(times=times, key_file=KeyFile(tmp_path / "api.json")),
    ):
        assert times.of(KEY).newest == 500
        assert KeyFile(tmp_path / "gcs.json").read(LATEST) == SigningKey(KEY, 500)


def test_the_vehicle_has_one_record_for_its_links(tmp_path: Path) -> None:
    for name in ("gcs", "api"):
        file = KeyFile(tmp_path / f"signing-{name}.json")
        file.write(SigningKey(KEY, 5))
        file.close()
    choice = LinkChoice(gcs="udp:127.0.0.1:42011", api="udp:127.0.0.1:42012", keys=tmp_path)
    clock = ManualClock()
    clocks = (lambda: clock.now_us, lambda: clock.unix_us)
    links = build_links(choice, Inbox(), CONTEXT, clocks, lambda t, frame: None, list)
    try:
        gcs, api = (link.signing for link in links.links)
        with ground_station() as ground:
            raw = Client(ground).arm()
        (frame,) = split(raw)
        assert gcs.judge(frame, raw) is FrameTrust.TRUSTED
        assert api.judge(frame, raw) is FrameTrust.REFUSED
    finally:
        links.close()


def test_a_key_that_comes_back_remembers_its_times(ground: Ground) -> None:
    old = Client(ground).arm()
    ground.polled(old)
    ground.polled(Client(ground).at(Client(ground).now() + 5).set_up(bytes(32)))
    ground.polled(set_up())
    ground.polled(old)
    assert commands(ground) == 1
    assert ground.link.signing.counters.wrong_time == 1


def test_keys_that_are_remembered_are_bounded() -> None:
    times, file = SignedTimes(), Unkept()
    for number in range(20):
        record = times.of(bytes([number]) * 32)
        record.join(file, 0)
        assert record.accept((255, 190, 0), 100 + number, 0)
        record.leave(file)
    assert times.of(bytes([19]) * 32).newest == 119
    assert not times.of(bytes(32)).accept((255, 190, 0), 100, 0)  # forgotten, and still refused


def test_a_key_that_is_set_again_forgets_no_time(ground: Ground) -> None:
    client = Client(ground)
    old = client.arm()
    ground.polled(old)
    ground.polled(client.set_up(KEY))
    ground.polled(old)
    assert commands(ground) == 1


@pytest.mark.parametrize("content", ["", "{}", '{"key": "00", "newest": 1}', "[]", "\xff"])
def test_a_damaged_key_is_an_error_and_no_open_link(file: Path, content: str) -> None:
    file.parent.mkdir()
    file.write_text(content, encoding="latin-1")
    file.chmod(0o600)
    with pytest.raises(LinkError, match="no signing key"), ground_station(key_file=KeyFile(file)):
        pass


def test_a_key_that_is_a_pipe_or_nested_is_an_error_and_not_waited_for(file: Path) -> None:
    file.parent.mkdir()
    os.mkfifo(file, 0o600)
    with pytest.raises(LinkError, match="no signing key"), ground_station(key_file=KeyFile(file)):
        pass
    file.unlink()
    file.write_text("[" * 1000)
    file.chmod(0o600)
    with pytest.raises(LinkError, match="no signing key"), ground_station(key_file=KeyFile(file)):
        pass


def test_a_key_that_others_may_read_is_refused(ground: Ground, file: Path) -> None:
    file.chmod(0o644)
    with pytest.raises(LinkError, match="read by others"), ground_station(key_file=KeyFile(file)):
        pass


def test_a_key_of_zeros_signed_with_the_old_one_ends_signing(ground: Ground, file: Path) -> None:
    ground.polled(set_up(bytes(32)))
    assert ground.link.signing.active  # unsigned: refused
    ground.polled(Client(ground).set_up(bytes(32)))
    assert not ground.link.signing.active
    assert not file.exists()
    ground.polled(unsigned(ids.COMMAND_LONG, *ARM))
    assert commands(ground) == 1


def test_the_key_can_be_changed_by_who_has_it(ground: Ground) -> None:
    client = Client(ground)
    ground.polled(set_up(OTHER_KEY))
    ground.polled(client.arm())
    assert commands(ground) == 1
    ground.polled(client.set_up(OTHER_KEY))
    ground.polled(client.arm())
    assert commands(ground) == 0
    ground.polled(Client(ground, OTHER_KEY).arm())
    assert commands(ground) == 1


def test_an_armed_vehicle_takes_no_key(file: Path) -> None:
    with ground_station(key_file=KeyFile(file)) as ground:
        ground.fly(5)
        ground.polled(set_up())
        assert not ground.link.signing.active
        assert not file.exists()


def test_a_key_for_another_vehicle_is_not_taken(file: Path) -> None:
    with ground_station(key_file=KeyFile(file)) as ground:
        ground.polled(unsigned(ids.SETUP_SIGNING, 0, 2, 1, *KEY))
        assert not ground.link.signing.active


def test_a_key_from_another_machine_is_not_taken(file: Path) -> None:
    from fsw.link.signing.signing import set_up_signing
    from messages.frames import split

    with ground_station(key_file=KeyFile(file)) as ground:
        (frame,) = split(set_up())
        text = set_up_signing(ground.link.signing, frame, ("192.0.2.7", 14550), armed=False)
        assert text is not None
        assert "this machine" in text.text
        assert not ground.link.signing.active


def test_a_key_that_cannot_be_kept_changes_nothing(file: Path) -> None:
    with ground_station(key_file=KeyFile(file)) as ground:
        file.parent.write_text("a file where the directory should be")
        ground.polled(set_up())
        assert not ground.link.signing.active


def test_senders_that_are_remembered_are_bounded(ground: Ground) -> None:
    for system in range(1, 100):
        ground.polled(Client(ground, system=system).arm())
    assert commands(ground) <= 64


def test_an_unsigned_link_takes_signed_frames_as_they_are() -> None:
    with ground_station() as ground:
        ground.polled(Client(ground).arm())
        assert commands(ground) == 1


@pytest.mark.requirement("REQ-LINK-3")
@pytest.mark.parametrize("sets_the_key", [False, True])
def test_a_second_process_with_the_same_keys_does_not_make_the_time_go_back(
    ground: Ground, file: Path, sets_the_key: bool
) -> None:
    with ground_station(key_file=KeyFile(file)) as second:
        if sets_the_key:
            second.fly(5, armed=False)
            second.polled(Client(second).set_up(KEY))
    old = Client(ground).at(Client(ground).now() + 5).arm()
    ground.polled(old)  # after the second one has ended; and the first one is killed
    assert commands(ground) == 1
    with ground_station(key_file=KeyFile(file)) as restarted:
        restarted.fly(5)
        restarted.polled(old)
        assert commands(restarted) == 0


@pytest.mark.requirement("REQ-LINK-3")
def test_a_file_that_another_process_has_replaced_is_taken_up(ground: Ground, file: Path) -> None:
    content = file.read_bytes()
    file.unlink()
    file.write_bytes(content)
    file.chmod(0o600)
    old = Client(ground).at(Client(ground).now() + 5).arm()
    ground.polled(old)
    assert KeyFile(file).read(LATEST) == SigningKey(KEY, int.from_bytes(old[-12:-6], "little"))


def test_the_time_in_a_file_never_goes_back_and_no_other_key_gets_it(file: Path) -> None:
    one, other = KeyFile(file), KeyFile(file)
    one.write(SigningKey(KEY, 500))
    other.write(SigningKey(KEY, 300))
    other.keep(KEY, 400)
    assert KeyFile(file).read(LATEST) == SigningKey(KEY, 500)
    other.write(SigningKey(OTHER_KEY, 5))
    one.keep(KEY, 600)
    assert KeyFile(file).read(LATEST) == SigningKey(OTHER_KEY, 5)


@pytest.mark.requirement("REQ-LINK-3")
@pytest.mark.parametrize("width", [1, 14, 16])
def test_a_file_that_was_not_written_here_is_written_anew_and_its_time_kept(
    ground: Ground, file: Path, width: int
) -> None:
    """As an earlier version wrote it, or somebody by hand."""
    file.write_text(f'{{"key": "{KEY.hex()}", "newest": {5:>{width}}}}')
    file.chmod(0o600)
    with ground_station(key_file=KeyFile(file)) as flown:
        flown.fly(5)
        old = Client(flown).at(Client(flown).now() + 5).arm()
        flown.polled(old)
        assert commands(flown) == 1
    assert KeyFile(file).read(LATEST) == SigningKey(KEY, int.from_bytes(old[-12:-6], "little"))


@pytest.mark.requirement("REQ-LINK-9")
@pytest.mark.parametrize("content", [b"", b'{"key": "', b"x" * 200])
def test_a_file_that_is_spoilt_in_flight_ends_nothing(
    ground: Ground, file: Path, content: bytes
) -> None:
    file.write_bytes(content)  # in place
    ground.polled(Client(ground).at(Client(ground).now() + 5).arm())
    assert commands(ground) == 1
    with pytest.raises(LinkError, match="holds no signing key"):
        KeyFile(file).read(LATEST)


@pytest.mark.requirement("REQ-LINK-9")
def test_a_time_ahead_of_the_clock_is_refused_and_ends_nothing(ground: Ground, file: Path) -> None:
    now = Client(ground).now()
    for newest, refused in ((now + MINUTE, False), (now + 2 * MINUTE, True), (LATEST, True)):
        file.unlink()
        KeyFile(file).write(SigningKey(KEY, newest))
        if refused:
            with (
                pytest.raises(LinkError, match="s too far ahead of the clock; set the clock, or"),
                ground_station(key_file=KeyFile(file)),
            ):
                pass
        else:
            with ground_station(key_file=KeyFile(file)) as ahead:
                ahead.fly(5)


def test_signing_times_that_have_run_out_end_no_flight(ground: Ground) -> None:
    ground.clock.pass_s(1e-5 * (1 << 48))  # a clock in the year 2104
    ground.fly(100)
    times = {int.from_bytes(raw[-12:-6], "little") for _, raw in ground.recorded[-10:]}
    assert times == {LATEST}


def test_what_is_written_is_replaced_whole(file: Path) -> None:
    keys = KeyFile(file)
    keys.write(SigningKey(KEY, 5))
    inode = file.stat().st_ino
    keys.write(SigningKey(OTHER_KEY, 6))
    assert file.stat().st_ino != inode
    assert keys.read(LATEST) == SigningKey(OTHER_KEY, 6)


@pytest.mark.parametrize(
    ("message_id", "values"), [(ids.COMMAND_LONG, ARM), (ids.HEARTBEAT, (0, 6, 8, 0, 4, 3))]
)
def test_a_signed_link_takes_nothing_of_mavlink_1_and_sends_none(
    ground: Ground, message_id: int, values: tuple[float, ...]
) -> None:
    """It cannot be signed; not even a heartbeat, which passes unsigned in MAVLink 2."""
    old = as_version_1(unsigned(message_id, *values))
    assert old is not None
    before = ground.link.accepted
    ground.polled(old)
    assert ground.link.accepted == before
    assert ground.link.signing.counters.unsigned == 1
    assert ground.link.peers.all == (ground.station.getsockname(),)
    ground.datagrams()
    for _ in range(100):
        ground.t_us += 2_000
        ground.links.publish(outputs_at(ground.t_us))
    assert all(datagram[0] == 0xFD for datagram in ground.datagrams())
