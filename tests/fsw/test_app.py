"""Starting and ending the flight software, with a program that only stands there."""

from __future__ import annotations

import os
import re
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from command_line.parser import COULD_NOT_START
from command_line.process import NOT_COMPLETED
from fsw import app
from fsw.arguments import FswOptions
from fsw.autopilot.parameters.control_choice import ControlChoice
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.registry import PARAMETERS
from fsw.autopilot.signals import Plan, PlanFailure, PlanRequest, TickInputs, TickOutputs
from fsw.link.link_choice import NO_LINK, LinkChoice
from fsw.link.services.mission_store import MissionStore, Site
from fsw.runtime.program import FlightProgram
from fsw.storage.parameter_file import load as parameter_file
from fsw.storage.parameter_store import ParameterStore
from tests.fsw.link.snapshots import FACTS, outputs_at
from tests.whole_tick import parts_of

CHOICE = ControlChoice()


class NoPlanner:
    """Never asked."""

    def plan(self, request: PlanRequest) -> Plan | PlanFailure:
        raise AssertionError("not expected to be called")


def standing(state: int, inputs: TickInputs) -> tuple[int, TickOutputs]:
    return state + 1, outputs_at(inputs.sensors.t_us)


def load(options: FswOptions) -> FlightProgram:
    parameters = ParameterStore(FlightConfig(), lambda tuning: None)
    site = Site(lambda *place: (0.0, 0.0, 0.0), lambda: 0.1)
    return FlightProgram(FACTS, 0, *parts_of(standing), NoPlanner(), parameters, MissionStore(site))


@pytest.fixture
def silent() -> Iterator[socket.socket]:
    """A simulator that hears and never answers."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
        deaf.bind(("127.0.0.1", 0))
        deaf.settimeout(30.0)
        yield deaf


@pytest.fixture
def options(silent: socket.socket, tmp_path: Path) -> Iterator[FswOptions]:
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    address = f"udp:127.0.0.1:{silent.getsockname()[1]}"
    links = LinkChoice(gcs=address, api=NO_LINK)
    yield FswOptions(sim=address, links=links, control=CHOICE, out=tmp_path, wait_s=0.4)
    for number, handler in zip((signal.SIGINT, signal.SIGTERM), handlers, strict=True):
        signal.signal(number, handler)


@pytest.mark.long
def test_a_simulator_that_never_answers_ends_the_wait(
    options: FswOptions, capsys: pytest.CaptureFixture[str]
) -> None:
    assert app.run(options, load) == COULD_NOT_START
    reported = capsys.readouterr().err
    assert reported == f"fsw: no simulator answered at {options.sim} within 0.4 s\n"


def test_nobody_at_the_simulators_port_is_the_same(
    options: FswOptions, capsys: pytest.CaptureFixture[str]
) -> None:
    silent = replace(options, sim="udp:127.0.0.1:9")
    assert app.run(silent, load) == COULD_NOT_START
    assert "no simulator answered at udp:127.0.0.1:9" in capsys.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_wait(
    options: FswOptions, silent: socket.socket, number: signal.Signals
) -> None:
    def signal_once_it_announces_itself() -> None:
        silent.recv(2048)
        os.kill(os.getpid(), number)

    threading.Thread(target=signal_once_it_announces_itself, daemon=True).start()
    assert app.run(replace(options, wait_s=30.0), load) == NOT_COMPLETED
    assert (Path(str(options.out)) / "fsw.json").exists()


@pytest.mark.parametrize("name", ["flight.tlog", "flight.ulg"])
def test_a_directory_with_a_flight_is_refused(
    name: str, options: FswOptions, capsys: pytest.CaptureFixture[str]
) -> None:
    (Path(str(options.out)) / name).write_bytes(b"")
    assert app.run(options, load) == COULD_NOT_START
    assert "already holds a flight" in capsys.readouterr().err


def test_kept_parameters_are_taken_over_and_what_is_of_no_use_is_said(
    options: FswOptions, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "vehicle.params"
    file.write_text("PID_YAW_P 5\nOF_ANOTHER_AGE 1\n")
    assert app.run(replace(options, params=file), load) == COULD_NOT_START
    reported = "".join(capsys.readouterr())
    assert f"fsw: {file}, line 2 is passed over: OF_ANOTHER_AGE is unknown\n" in reported
    assert f"fsw: parameters from {file}, 1 of them not the default\n" in reported
    record = parameter_file(Path(str(options.out)) / "parameters.params").values
    assert record["PID_YAW_P"] == 5.0
    assert len(record) == len(PARAMETERS)


def test_a_place_where_parameters_cannot_be_kept_is_one_sentence(
    options: FswOptions, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    nowhere = tmp_path / "nowhere" / "vehicle.params"
    assert app.run(replace(options, params=nowhere), load) == COULD_NOT_START
    assert capsys.readouterr().err == (
        f"fsw: cannot keep parameters in {nowhere}: No such file or directory\n"
    )


def _contradiction(path: Path) -> None:
    path.write_text("BAT_CRIT_THR 0.3\nBAT_LOW_THR 0.25\n")


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (os.mkfifo, "it is not a regular file"),
        (Path.mkdir, "Is a directory|not a regular file"),
        (lambda path: path.symlink_to(path.with_name("nowhere") / "there"), "No such file"),
        (_contradiction, "contradict each other: BAT_CRIT_THR 0.3 is to be below BAT_LOW_THR"),
    ],
)
def test_parameters_of_no_use_are_refused_before_anything_is_compiled(
    make: Callable[[Path], None],
    why: str,
    options: FswOptions,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def compiling(options: FswOptions) -> FlightProgram:
        raise AssertionError("it was to be refused before")

    make(tmp_path / "vehicle.params")
    given = replace(options, params=tmp_path / "vehicle.params")
    assert app.run(given, compiling) == COULD_NOT_START
    assert re.search(why, capsys.readouterr().err)
