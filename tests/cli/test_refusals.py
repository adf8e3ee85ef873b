"""What cannot start says why in one sentence, with exit code 2, and leaves nothing behind."""

from __future__ import annotations

import resource
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from pandion.__main__ import main
from tests.cli.command import one_sentence, pandion


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        yield int(taken.getsockname()[1])


# In this process: starting Python takes longer than refusing a word. Some more are below.
OF_FLY = [
    (["fly", "walls", "--sed", "3"], ["unknown option --sed", "--seed"]),
    (["fly", "walls", "--seed", "1.5"], ["--seed", "1.5"]),
    (["fly", "walls", "--duration", "nan"], ["--duration", "nan"]),
    (["fly", "walls", "--duration", "0"], ["--duration", "0"]),
    (["fly", "walls", "--speed", "nan"], ["--speed", "nan"]),
    (["fly", "walls", "--realtime", "--speed", "3"], ["--realtime", "--speed"]),
    (["fly", "walls", "--realtime", "--lockstep"], ["--lockstep", "--realtime"]),
    (["fly", "walls", "--gcs", "localhost"], ["localhost", "udp:HOST:PORT"]),
    (["fly", "walls", "--gcs", "udp:127.0.0.1:70000"], ["70000"]),
    (["fly", "walls", "--gcs", "udp:127.0.0.1:14550", "more"], ["more"]),
    (["fly", "walls", "--json", "no/such/result.json"], ["no/such/result.json"]),
    (["fly", "walls", "--json", "a" * 300], ["--json", "name too long"]),
    (["campaign", "x.toml", "--tls-key", "a" * 300], ["--tls-key", "name too long"]),
    (["view", "a" * 300], ["LOG", "name too long"]),
    (["fly", "walls", "--out", ""], ["--out", "'' is no name"]),
    (["fly", "walls", "--seed", "9" * 5000], ["is not a whole number from 0 to 9223372036854775"]),
    (["fly", "walls", "--seed", "\N{ARABIC-INDIC DIGIT THREE}"], ["is not a whole number"]),
    (["fly", "walls", "--duration", "1_0"], ["'1_0' is not a positive number"]),
    (["param", "set", "MPC_XY_VEL_MAX", "1_0"], ["'1_0' is not a number"]),
    (["faults", "--seed", "0:" + "9" * 5000], ["is not A:B", "at most 9223372036854775807"]),
]


@pytest.mark.parametrize(("arguments", "words"), OF_FLY)
def test_a_wrong_word_of_a_flight_is_named_with_what_was_meant(
    arguments: list[str],
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert exit_code(arguments) == 2
    done = capsys.readouterr()
    assert one_sentence(done.err), done.err
    assert done.out == ""
    for word in words:
        assert word in done.err
    assert list(tmp_path.iterdir()) == []


def exit_code(arguments: list[str]) -> object:
    """Of the command in this process."""
    try:
        return main(arguments)
    except SystemExit as end:
        return end.code


@pytest.mark.drawn(3)
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["flyy"], ["unknown verb flyy", "fly"]),
        (["--versio"], ["unknown option", "--version"]),
        (["fly", "wals"], ["unknown scenario", "walls"]),
        (["fly", "walls", "--seed", "-1"], ["--seed", "-1"]),
        (["sitl", "--json", "no/such/result.json"], ["no/such/result.json"]),
        (["sitl", "wals"], ["unknown scenario", "walls"]),
        (["sitl", "--listen", "tcp:1"], ["tcp:1", "udp:HOST:PORT"]),
        (["sitl", "--listen", "udp:192.0.2.1:4560"], ["192.0.2.1"]),
        (["fsw", "--sim", "nowhere"], ["nowhere", "udp:HOST:PORT"]),
        (["fsw", "--sim", "udp:no.such.host.invalid:4560"], ["no.such.host.invalid"]),
    ],
)
def test_a_wrong_word_is_named_with_what_was_meant(
    arguments: list[str], words: list[str], tmp_path: Path
) -> None:
    done = pandion(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert one_sentence(done.stderr), done.stderr
    assert done.stdout == ""
    for word in words:
        assert word in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_unknown_controllers_are_refused_with_the_known_ones(tmp_path: Path) -> None:
    done = pandion("fly", "walls", "--controller", "bfl", "--json", "-", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert "unknown controller 'bfl'" in done.stderr
    assert "blf" in done.stderr
    assert one_sentence(done.stderr), done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_port_in_use_is_named(taken_port: int, tmp_path: Path) -> None:
    done = pandion("sitl", "--listen", f"udp:127.0.0.1:{taken_port}", cwd=tmp_path)
    assert done.returncode == 2
    assert one_sentence(done.stderr)
    assert f"udp:127.0.0.1:{taken_port}" in done.stderr
    assert "in use" in done.stderr


def test_a_vehicle_that_never_comes_ends_the_wait(tmp_path: Path) -> None:
    done = pandion("sitl", "--listen", "udp:127.0.0.1:0", "--wait", "0.5", cwd=tmp_path)
    assert done.returncode == 2
    assert "no flight software" in done.stderr
    assert one_sentence(done.stderr)


def test_a_scenario_that_starts_outside_its_safe_set_cannot_start(tmp_path: Path) -> None:
    scenario = tmp_path / "inside-a-wall.toml"
    scenario.write_text(
        """
        duration_s = 5.0
        [start]
        kind = "airborne"
        [pilot]
        plan = "trajectory"
        [trajectory]
        kind = "hold"
        position_m = [0.0, 0.0, -1.0]
        [[walls]]
        name = "front"
        normal = [-1.0, 0.0, 0.0]
        offset_m = 0.0
        clearance_m = 0.1
        """
    )
    done = pandion("sitl", str(scenario), "--listen", "udp:127.0.0.1:0", cwd=tmp_path)
    assert done.returncode == 2
    assert one_sentence(done.stderr)
    assert "front" in done.stderr
    assert "safe set" in done.stderr


def test_a_directory_with_a_flight_is_not_written_over(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text("{}")
    done = pandion("fly", "walls", "--out", str(tmp_path), cwd=tmp_path)
    assert done.returncode == 2
    assert "already holds a flight" in done.stderr
    assert (tmp_path / "result.json").read_text() == "{}"


@pytest.mark.parametrize(
    "arguments",
    [["--help"], ["fly", "--help"], ["sitl", "--help"], ["fsw", "--help"], ["--version"]],
)
def test_help_and_version_answer_at_once(arguments: list[str], tmp_path: Path) -> None:
    # Processor time, and the best of three: a busy machine must not fail a test about imports.
    for _ in range(3):
        begin = _spent_by_children_s()
        done = pandion(*arguments, cwd=tmp_path)
        took_s = _spent_by_children_s() - begin
        assert done.returncode == 0
        assert done.stdout
        if took_s < 0.5:
            break
    assert took_s < 0.5


def _spent_by_children_s() -> float:
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime
