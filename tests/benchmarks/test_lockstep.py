"""The lockstep bench: what it refuses, what it makes of two processes' reports, and its peer."""

from __future__ import annotations

from typing import Any

import pytest

from benchmarks import lockstep
from benchmarks.pymavlink_process import step
from messages import dialect
from sitl.link.encode import StepEncoder
from sitl.sensors.exact import SensorReadings

READINGS = SensorReadings(
    1_002_000,
    (1.1, 2.2, -1.3),
    (0.1, 0.2, 0.3),
    (0.9, 0.1, 0.1, 0.1),
    (0.1, 0.2, 0.3),
    (0.1, 0.2, 0.4),
    (0.1, 0.2, -9.8),
    (0.1, -0.2),
    (0.3, 0.4),
    (0.5, 0.6),
)


def test_the_peer_packs_the_very_bytes() -> None:
    ours = StepEncoder(lockstep=True)
    peer = dialect.MAVLink(None, srcSystem=1, srcComponent=200)
    for _ in range(3):
        assert step(peer, READINGS) == ours.datagram(READINGS, ())


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--duration", "0"], "--duration"),
        (["--duration", "nan"], "--duration"),
        (["--rounds", "0"], "--rounds"),
        (["--round", "1"], "--round"),
        (["--sensors", "eyes"], "eyes"),
        (["--json", "/nowhere/at/all.json"], "/nowhere/at/all.json"),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(
    words: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = lockstep.main(words)
    except SystemExit as error:
        code = int(str(error.code))
    assert code == 2
    reported = capsys.readouterr().err.strip()
    assert named in reported
    assert "\n" not in reported


def _flown(factor: float) -> dict[str, Any]:
    def took(us: float) -> dict[str, float]:
        return {"p50_us": us}

    stages = {"receive": took(4.0), "tick": took(20.0), "actuate": took(6.0)}
    mpc = {"p50_us": 700.0, "rate_hz": 10.0}
    return {
        "sitl": {"real_time_factor": factor, "steps": 1000, "wall_s": 0.08, "waited_s": 0.05},
        "fsw": {"stages": stages, "telemetry": took(10.0), "mpc": mpc},
        "places": "a processor for each process",
    }


def test_factor_ratio_and_stages_come_from_both_halves(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    factors = iter([24.0, 12.0, 30.0, 10.0, 27.0, 9.0])  # ours and the peer's take turns
    monkeypatch.setattr(lockstep, "_measure_one", lambda *_: _flown(next(factors)))
    assert lockstep.main([]) == 0
    reported = capsys.readouterr().out
    assert "median 27.0, best 30.0" in reported
    assert "3.00 times as fast as with pymavlink's packing" in reported
    assert "simulator                   30.0       30.0 us" in reported
    assert "mpc, share of a step        14.0       14.0 us" in reported


@pytest.mark.parametrize(("slower", "code"), [(0.86, 0), (0.84, 1)])
def test_a_suite_is_compared_with_exact_states(
    slower: float, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    flown = []

    def measure(_: object, kind: Any) -> dict[str, Any]:
        flown.append(kind.sensors)
        return _flown(20.0 * slower if kind.sensors == "mocap" else 20.0)

    monkeypatch.setattr(lockstep, "_measure_one", measure)
    assert lockstep.main(["--sensors", "mocap", "--rounds", "2"]) == code
    assert flown == ["mocap", "perfect"] * 2
    assert f"{slower:.2f} times as fast as with exact states" in capsys.readouterr().out


def test_too_slow_is_an_exit_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lockstep, "_measure_one", lambda *_: _flown(24.9))
    assert lockstep.main(["--rounds", "1"]) == 1


@pytest.mark.long
def test_the_peer_flies(capsys: pytest.CaptureFixture[str]) -> None:
    assert lockstep.main(["--duration", "1", "--rounds", "1"]) in (lockstep.DONE, lockstep.SLOW)
    assert "round 1, pymavlink: " in capsys.readouterr().out
