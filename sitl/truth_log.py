"""The true state of every step, in a file that the flight software never sees.

``truth.ulg`` is a ULog of its own; ``pandion fly`` joins it to the flight log.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from struct import Struct
from typing import Final

from messages import ulog
from messages.block_file import BlockFile
from messages.ground_truth import (
    ATTITUDE_TRUTH,
    FIRST_NUMBER,
    POSITION_TRUTH,
    RATES_TRUTH,
    SIM_CONTACT,
    SIM_TRACKING,
    TRUTH_TOPICS,
    state_topic,
)
from messages.ulog import Topic
from messages.ulog_reader import unpacker
from sitl.scenario import Scenario, vehicle_of
from sitl.simulation import SAMPLE_STEPS, START_US, Simulation
from vehicles.vehicle_file import vehicle_text

_FLUSH_BYTES: Final = 1 << 16
_TRACKING_HEAD: Final = ulog.data_head(FIRST_NUMBER + 1, SIM_TRACKING)
_TRACKING: Final = unpacker(SIM_TRACKING)
_CONTACT_HEAD: Final = ulog.data_head(FIRST_NUMBER + TRUTH_TOPICS.index(SIM_CONTACT), SIM_CONTACT)
_CONTACT: Final = unpacker(SIM_CONTACT)
_PX4_TOPICS: Final = (ATTITUDE_TRUTH, RATES_TRUTH, POSITION_TRUTH)
_PX4: Final = Struct("<" + "".join("5s" + topic.codes for topic in _PX4_TOPICS))
_PX4_HEADS: Final = tuple(
    ulog.data_head(FIRST_NUMBER + TRUTH_TOPICS.index(topic), topic) for topic in _PX4_TOPICS
)
_MOTION: Final = Struct("<13d")  # position, velocity, attitude and rates, first in the state


class TruthLog:
    """Whole records, appended a few hundred steps at a time."""

    def __init__(
        self, path: Path, scenario: Scenario, seed: int, warn: Callable[[str], None]
    ) -> None:
        """Create the file in place of an older one; ``warn`` is called once if the disk refuses.

        Raises:
            OSError: The file cannot be created.
        """
        path.unlink(missing_ok=True)
        self.file = BlockFile(path)
        self._warn, self._warned = warn, False
        vehicle = vehicle_of(scenario)
        state = state_topic(len(vehicle.rotors), len(vehicle.joints))
        self._state_head = ulog.data_head(FIRST_NUMBER, state)
        self._records = bytearray(_definitions(scenario, seed, state))

    def add(self, simulation: Simulation) -> None:
        """Append the state of the current step."""
        t_us = simulation.t_us
        # The state vector lies in memory as the record's fields follow each other.
        self._records += self._state_head + t_us.to_bytes(8, "little") + simulation.state_bytes()
        if simulation.touch or simulation.payload:
            self._records += _CONTACT_HEAD + _CONTACT.pack(t_us, *contact(simulation))
        if simulation.step % SAMPLE_STEPS == 0:
            truth = simulation.truth()
            self._records += _TRACKING_HEAD + _TRACKING.pack(t_us, *truth.p_WE, *truth.target.p)
            motion = _MOTION.unpack_from(simulation.state_bytes())
            attitude, rates, position = _PX4_HEADS
            self._records += _PX4.pack(
                *(attitude, t_us, *motion[6:10], rates, t_us, *motion[10:13]),
                *(position, t_us, *motion[:6]),
            )
        if len(self._records) > _FLUSH_BYTES:
            self._flush()

    def close(self) -> None:
        """Write what is left and close the file."""
        self.file.look()  # a closed file no longer tells that it was deleted
        self._flush()
        self.file.close()

    def _flush(self) -> None:
        self.file.put(self._records)
        self._records = bytearray()
        if self.file.failure is not None and not self._warned:
            self._warned = True
            self._warn(f"truth.ulg ends early: {self.file.failure}")


def contact(simulation: Simulation) -> tuple[float, ...]:
    """The numbers of ``sim_contact`` now [SI]."""
    touch = simulation.touch
    felt = (*touch.force(), touch.normal(), touch.depth())
    return (*felt, simulation.asked_force(), simulation.payload.held_kg)


def _definitions(scenario: Scenario, seed: int, state: Topic) -> bytes:
    topics = (state, *TRUTH_TOPICS[1:])
    parts = [ulog.opening(START_US), ulog.information("sys_name", "Pandion simulator")]
    vehicle = vehicle_of(scenario)
    parts += [ulog.information("scenario", scenario.name), ulog.information("seed", seed)]
    parts += [ulog.information("vehicle", vehicle.name)]
    parts += [ulog.information("vehicle_file", vehicle_text(vehicle))]
    parts += [ulog.format_of(topic) for topic in topics]
    numbered = enumerate(topics, start=FIRST_NUMBER)
    parts += [ulog.subscription(number, topic) for number, topic in numbered]
    return b"".join(parts)
