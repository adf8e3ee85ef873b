"""The flight log, ``flight.ulg``: every tick with all that went into it and all that came out.

What it costs the tick is the packing of some 250 bytes, or of 600 with all details. In lockstep the
loop writes them itself, so that the file repeats to the byte; in real time a thread does, and what
the disk cannot take in time is lost and marked as lost. The telemetry log beside it is
``flight.tlog``; the logs of a flight are opened, watched and closed together.
"""

from __future__ import annotations

import json
import math
import os
import resource
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.parameters.facts import FACTS
from fsw.autopilot.ports import GroupTiming
from fsw.autopilot.signals import StatusText, TickInputs, TickOutputs
from fsw.log.encoder import FULL, LogEncoder, loop_timing
from fsw.log.px4_records import cpu_load, origin_of
from fsw.log.topics import TOPICS
from messages import ulog
from messages.block_file import BlockFile
from messages.ground_truth import TRUTH_TOPICS
from messages.ulog import Topic
from vehicles.description import Vehicle
from vehicles.vehicle_file import vehicle_text

Number = int | float | bool

_FLUSH_INTERVAL_US: Final = 250_000
_TLOG_INTERVAL_US: Final = 500_000
_FLUSH_BYTES: Final = 1 << 16
_OF_THE_LOOP: Final = 1  # tag of its sentences
_TICK_GROUP: Final = 0  # PANDION_RATE_GROUP
_UNMEASURED: Final = (math.nan,) * 6


@dataclass(frozen=True, slots=True)
class LogSubject:
    """What a log says about the flight before it begins."""

    facts: Mapping[str, str | int]  # revision, scenario, seed, controller, …
    numbers: Mapping[str, Number]  # of the whole configuration, by dotted name
    parameters: Mapping[str, float]  # those that a ground station may change, by their names there
    airframe: Airframe
    profile: int = FULL  # what is written how often, LOG_PROFILE


def vehicle_facts(vehicle: Vehicle) -> dict[str, str | int]:
    """What a log says of the vehicle as the flight software knows it: its file."""
    return {"vehicle": vehicle.name, "vehicle_file": vehicle_text(vehicle)}


class FlightLog:
    """One flight's ULog file.

    A sync message follows each block, and the number of ticks the last one, so that a cut end is
    seen.
    """

    def __init__(self, path: Path, subject: LogSubject) -> None:
        """Create the file, empty until :meth:`begin`; ``OSError`` if it exists or cannot be."""
        self.file = BlockFile(path)
        self.lost_us = 0  # length of what the disk did not take in time
        self.unwritten_ticks = 0  # ticks with a number that fits no field
        self._subject = subject
        self._records = bytearray()
        self._encoder: LogEncoder | None = None
        self._measured = False
        self._block_us = 0  # time of the first record that is not yet with the disk
        self._last_us = 0  # time of the last tick
        self._unmarked_us = 0  # lost, and not yet marked as lost
        self._ticks = 0  # with records

    def begin(self, t_us: int, lockstep: bool) -> None:
        """Write what stands before the data of the first tick, that of ``t_us``.

        In lockstep, write in this thread and nothing that the wall clock measured.
        """
        subject, self._measured = self._subject, not lockstep
        self._encoder = LogEncoder(
            measured=self._measured,
            airframe=subject.airframe,
            profile=subject.profile,
            origin=origin_of(subject.numbers),
        )
        pacing = "lockstep" if lockstep else "realtime"
        self._records += definitions(t_us, subject, pacing, self._encoder.inputs.schema)
        self._block_us = self._last_us = t_us
        if not lockstep:
            self.file.start_thread()

    def add(self, inputs: TickInputs, outputs: TickOutputs) -> None:
        """Append one tick; call it when its actuators have been sent."""
        assert self._encoder is not None
        records, begin = self._records, len(self._records)
        try:
            self._encoder.add(inputs, outputs, records)
            self._ticks += 1
        except (struct.error, ValueError, TypeError):
            # A number that fits no field must not end the flight it describes.
            del records[begin:]
            self.unwritten_ticks += 1
        t_us = self._last_us = inputs.sensors.t_us
        if len(records) > _FLUSH_BYTES or t_us - self._block_us >= _FLUSH_INTERVAL_US:
            self._flush(t_us)

    def add_timing(self, t_us: int, group: int, timing: GroupTiming) -> None:
        """Append the timing of a rate group; see :func:`fsw.log.encoder.loop_timing`."""
        if not self._measured:  # being late or skipped is measured too
            timing = GroupTiming(timing.period_us, timing.ticks, 0, 0, *_UNMEASURED)
        self._records += loop_timing(t_us, group, timing)
        if self._measured and group == _TICK_GROUP and timing.period_us > 0:
            self._records += cpu_load(t_us, timing.execution_p50_us / timing.period_us, _memory())

    def add_notice(self, t_us: int, notice: StatusText) -> None:
        """Append a text of the loop; a replay of the tick does not repeat it."""
        self._records += ulog.tagged_text(notice.severity & 7, _OF_THE_LOOP, t_us, notice.text)

    def close(self) -> None:
        """Write what is left and the end, and close the file; safe to call twice."""
        if self._encoder is not None:
            self._encoder = None
            self._records += ulog.information(ulog.TICKS, self._ticks)
            self._flush(self._last_us)
        self.file.close()

    def _flush(self, t_us: int) -> None:
        block, begin_us = self._records + ulog.sync(), self._block_us
        self._records, self._block_us = bytearray(), t_us
        if self._unmarked_us:
            block = bytearray(ulog.dropout(round(1e-3 * self._unmarked_us))) + block
        if self.file.put(block):
            self._unmarked_us = 0
        else:
            self.lost_us += t_us - begin_us
            self._unmarked_us += t_us - begin_us


class TlogWriter:
    """The telemetry log, ``.tlog``: every frame of the ground link, in both directions.

    A record is the time in microseconds (8 bytes, big-endian) and the frame. Stamps are the wall
    time of the start plus sensor time, so that a flight in lockstep plays back at the speed at
    which it happened. A thread writes, so a slow disk cannot stop a tick; whole records reach the
    file, so a process that is killed leaves a readable log.
    """

    def __init__(self, path: Path, start_unix_us: int) -> None:
        """Create the file, or raise OSError; sensor time 0 is stamped with ``start_unix_us``."""
        self.file = BlockFile(path)
        self.file.start_thread()
        self._start_us = start_unix_us
        self._records = bytearray()
        self._flushed_us = 0

    def add(self, t_us: int, frame: bytes) -> None:
        """Append one whole MAVLink frame."""
        self._records += (self._start_us + t_us).to_bytes(8, "big") + frame
        if t_us - self._flushed_us >= _TLOG_INTERVAL_US or len(self._records) > _FLUSH_BYTES:
            self._flushed_us = t_us
            self._flush()

    def close(self) -> None:
        """Write what is left and close the file; safe to call twice."""
        self._flush()
        self.file.close()

    def _flush(self) -> None:
        if self._records:
            self.file.put(self._records)
            self._records = bytearray()


class RunFiles:
    """``flight.ulg`` and ``flight.tlog``. A disk error is reported once per file."""

    def __init__(
        self,
        directory: Path,
        start_unix_us: int,
        subject: LogSubject,
        warn: Callable[[str], None],
    ) -> None:
        """Create both files, or raise OSError; sensor time 0 is ``start_unix_us``."""
        self.ulog = FlightLog(directory / "flight.ulg", subject)
        self.tlog = TlogWriter(directory / "flight.tlog", start_unix_us)
        self._warn = warn
        self._reported: set[str] = set()
        self._dropped = 0  # blocks, when it was last asked for

    def check(self) -> None:
        """Report what went wrong since the last call; cheap."""
        for file in self._files():
            file.look()
            if file.failure is not None:
                self._report(_ends_early(file))
            elif file.dropped:
                self._report(f"{file.path.name} has gaps: the disk does not keep up")

    def failure(self) -> str:
        """What is wrong with the files now, in a sentence; empty: they are written."""
        for file in self._files():
            if file.failure is not None:
                return _ends_early(file)
        before, self._dropped = self._dropped, sum(file.dropped for file in self._files())
        return "the log has gaps: the disk does not keep up" if self._dropped > before else ""

    @property
    def lost(self) -> list[str]:
        """Files that end early, and why."""
        return [one for file in self._files() for one in file.lost]

    @property
    def size(self) -> int:
        """Bytes written of both files."""
        return sum(file.size for file in self._files())

    def room(self) -> int:
        """Bytes that the disk will take."""
        disk = os.statvfs(self.ulog.file.path.parent)
        return disk.f_bavail * disk.f_frsize

    def close(self) -> None:
        """Write what is left; safe to call twice."""
        self.check()  # a closed file no longer tells that it was deleted
        self.ulog.close()
        self.tlog.close()
        self.check()

    def as_json(self) -> dict[str, object]:
        """What became of the files, for ``fsw.json``."""
        described: dict[str, object] = {
            file.path.name: {
                "bytes": file.size,
                "dropped_blocks": file.dropped,
                "failure": file.failure,
            }
            for file in self._files()
        }
        return {
            **described,
            "lost_ms": round(1e-3 * self.ulog.lost_us),
            "unwritten_ticks": self.ulog.unwritten_ticks,
        }

    def _files(self) -> tuple[BlockFile, BlockFile]:
        return self.ulog.file, self.tlog.file

    def _report(self, sentence: str) -> None:
        if sentence not in self._reported:
            self._reported.add(sentence)
            self._warn(sentence)


def _ends_early(file: BlockFile) -> str:
    return f"{file.path.name} ends early: {file.failure}"


def _memory() -> float:
    """The largest share of the machine's memory that the process had so far."""
    pages, size = os.sysconf("SC_PHYS_PAGES"), os.sysconf("SC_PAGE_SIZE")
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (pages * size)


def parameters(subject: LogSubject) -> dict[str, Number]:
    """The parameters of a log, which have 32 bits there."""
    # Those that only state what is so are for PX4's tools: Flight Review shows MAV_TYPE.
    stated = {fact.name: fact.read({}, subject.airframe) for fact in FACTS if not fact.repeats}
    return {**stated, **subject.numbers, **subject.parameters}


def information(subject: LogSubject, pacing: str, schema: str) -> dict[str, str | int]:
    """The information of a log, with the shape of the inputs, to read them back."""
    exact = json.dumps(dict(subject.numbers), separators=(",", ":"))
    return {
        "sys_name": "Pandion",
        "ver_data_format": 2,  # of PX4's topics: degrees and metres of vehicle_gps_position
        **subject.facts,
        "pacing": pacing,
        "profile": subject.profile,
        "numbers": exact,  # as doubles; the format's own parameters are 32-bit
        "inputs": schema,
    }


def formats(airframe: Airframe) -> list[Topic]:
    """The topics that a log of such a vehicle declares: ours, and then the simulator's."""
    counts = {"rotor": airframe.rotors, "joint": airframe.bodies.joints}
    return [topic.sized(**counts) for topic in (*TOPICS, *TRUTH_TOPICS)]


def definitions(t_us: int, subject: LogSubject, pacing: str, schema: str) -> bytes:
    """Everything before the first record."""
    facts, topics = information(subject, pacing, schema), formats(subject.airframe)
    parts = [ulog.opening(t_us)]
    parts += [ulog.information(key, value) for key, value in facts.items()]
    parts += [ulog.format_of(one) for one in topics]
    parts += [ulog.parameter(name, value) for name, value in parameters(subject).items()]
    ours = enumerate(topics[: len(TOPICS)])
    parts += [ulog.subscription(number, topic) for number, topic in ours]
    return b"".join(parts)
