"""The matrix of modes and faults: whole, read strictly, and compared without mercy."""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from fsw.autopilot.flight.modes import MODES
from fsw.autopilot.signals import ActuatorCommand, Mode, Severity
from pandion.faults import main
from sitl.faults.keys import KINDS, SENSORS, Fault
from studies.fault_matrix import matrix
from studies.fault_matrix.expectations import (
    Expectation,
    ExpectationError,
    Expected,
    differences,
    expectations,
)
from studies.fault_matrix.flights import SITUATIONS, FaultFlight, Observer, Said, fly
from studies.fault_matrix.matrix import Cell, judge
from studies.fault_matrix.page import page
from tests.fsw.link.snapshots import outputs_at

TOLD = Said(0.2, int(Severity.WARNING), "pose silent")
OTHER = Said(0.1, int(Severity.CRITICAL), "IMU jumps")
MILD = Said(0.1, int(Severity.INFO), "pose is back")
LATE = replace(TOLD, after_s=0.6)
FINE = FaultFlight((TOLD,), ("land",), least_m=0.1)
LAND_SOON = Expectation(then=("land",), told_within_s=0.5, names="pose|GNSS")


def test_every_mode_and_every_way_to_fail_is_flown() -> None:
    # Descend is what a failsafe does; no command begins it.
    assert {one.mode for one in SITUATIONS.values()} == set(MODES) - {Mode.DESCEND}
    flown = {(it.unit, it.kind) for one in expectations().values() for it in one.faults}
    there = {(unit, kind) for unit, kinds in KINDS.items() for kind in kinds}
    # No suite has a camera for it.
    assert there - flown == {("optical flow", kind) for kind in KINDS["optical flow"]}


def test_what_a_sensor_says_wrongly_is_flown_both_ways_round() -> None:
    """There is one wall: what pushes away from it is no test of what keeps off it."""
    all_ways = {(one.faults, one.suite) for one in expectations().values()}
    signed = ("wrong", "drifting", "turning", "tilting")
    for faults, suite in all_ways:
        if any(it.kind in signed for it in faults) and all(it.unit in SENSORS for it in faults):
            sizes = [-it.size if it.kind in signed else it.size for it in faults]
            other = [replace(it, size=size) for it, size in zip(faults, sizes, strict=True)]
            assert (tuple(other), suite) in all_ways, faults


def test_what_must_be_told_names_the_unit_and_its_number() -> None:
    for one in expectations().values():
        for expected in one.modes.values():
            assert bool(expected.names) or expected.told_within_s is None, one.name
    assert expectations()["motor-weak-3"].modes["hold"].names == "rotor 3 "
    assert expectations()["gyro-off"].modes["hold"].names == "IMU"


def test_contact_is_never_allowed_without_a_reason() -> None:
    for one in expectations().values():
        for expected in one.modes.values():
            assert expected.contact == "none" or len(expected.why) > 20, one.name


@pytest.mark.parametrize(
    ("flight", "differs"),
    [
        (FINE, ()),
        (replace(FINE, texts=()), ("silent",)),
        (
            replace(FINE, texts=(LATE,)),
            ("told after 0.60 s, not within 0.5 s",),
        ),
        (replace(FINE, texts=(OTHER,)), ('no text names "pose|GNSS"',)),
        (replace(FINE, texts=(OTHER, MILD)), ('no text names "pose|GNSS"',)),
        (replace(FINE, texts=(OTHER, TOLD)), ()),
        (replace(FINE, texts=(OTHER, LATE)), ("told after 0.60 s, not within 0.5 s",)),
        (replace(FINE, actions=()), ("goes on; must be land",)),
        (replace(FINE, actions=("hold", "land")), ("hold, then land; must be land",)),
        (replace(FINE, contact="ground", ended="it fell"), ("it fell",)),
        (replace(FINE, problem="no flight", texts=()), ("no flight",)),
        (replace(FINE, least_m=-0.001), ("margin -1.0 mm; must be 0 mm",)),
        (replace(FINE, least_m=None), ()),
        (replace(FINE, least_m=float("nan")), ("margin nan mm; must be 0 mm",)),
        (replace(FINE, force_share=1.0), ()),
        (replace(FINE, force_share=1.2), ("120% of the force; must be 100% at most",)),
        (replace(FINE, force_share=float("nan")), ("nan% of the force; must be 100% at most",)),
        (
            replace(FINE, texts=(replace(TOLD, after_s=float("nan")),)),
            ("told after nan s, not within 0.5 s",),
        ),
    ],
)
def test_what_is_not_as_it_must_be_is_named(flight: FaultFlight, differs: tuple[str, ...]) -> None:
    assert differences("orbit", LAND_SOON, flight) == differs


@pytest.mark.parametrize(
    "wrong",
    [
        {"least_m": "x"},
        {"least_m": 10**400},
        {"actions": [["a"]]},
        {"actions": {"a": 1}},
        {"actions": "land"},
        {"texts": [1]},
        {"texts": [{"after_s": 1, "text": "a"}]},
        {"texts": [{"after_s": "1", "severity": 2, "text": "a"}]},
        {"contact": "none"},
        {"error": 0},
        {"more": 1},
    ],
)
def test_a_line_of_other_types_is_no_flight(wrong: dict[str, Any]) -> None:
    line = json.loads(json.dumps(asdict(FINE)))
    assert FaultFlight.from_line(line) == FINE
    with pytest.raises(TypeError):
        FaultFlight.from_line(line | wrong)


def test_a_flight_without_its_margin_is_none() -> None:
    line = asdict(FINE)
    del line["least_m"]
    with pytest.raises(TypeError, match="are not the fields of a flight"):
        FaultFlight.from_line(line)


def test_what_must_come_of_it_in_the_end_may_not_be_left_out() -> None:
    lost = replace(LAND_SOON, then=("hold", "descend"), last=("descend",))
    assert not differences("orbit", lost, replace(FINE, actions=("hold", "descend")))
    assert not differences("orbit", lost, replace(FINE, actions=("descend",)))
    differs = differences("orbit", lost, replace(FINE, actions=("hold",)))
    assert differs == ("hold; must end with descend",)
    assert differences("orbit", lost, replace(FINE, actions=())) == (
        "goes on; must be hold or descend",
    )


@pytest.mark.parametrize(
    "name", ["vio-off", "gps-off-rtk", "gyro-off", "motor-off-2", "joint-off-1"]
)
def test_what_needs_an_action_may_not_go_on(name: str) -> None:
    for mode, expected in expectations()[name].modes.items():
        # A limp joint that hangs at rest as it takes off with exact states shows nothing.
        if mode != "land" and (name, mode) != ("joint-off-1", "takeoff"):
            assert "goes on" not in expected.then, mode


def test_a_vehicle_that_holds_or_lands_already_goes_on() -> None:
    going_on = replace(FINE, actions=())
    hold = replace(LAND_SOON, then=("hold",))
    assert not differences("hold", hold, going_on)
    assert not differences("land", LAND_SOON, going_on)
    assert differences("return", hold, going_on)


def test_contact_with_the_ground_is_not_contact_with_a_wall() -> None:
    falls = replace(LAND_SOON, contact="ground", why="it cannot be helped at all")
    assert not differences("orbit", falls, replace(FINE, contact="ground", ended="fell"))
    assert differences("orbit", falls, replace(FINE, contact="wall", ended="hit"))


_MOTOR = '[[faults]]\nunits = ["motor"]\nkinds = ["weak"]\nthen = ["hold"]\n'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            '[[faults]]\nunits = ["gyros"]\nkinds = ["off"]\nthen = ["hold"]',
            'units[0] = "gyros": must be one of',
        ),
        ('[[faults]]\nunit = ["gyro"]', 'unknown key "unit"'),
        ('[[faults]]\nthen = ["stop"]', 'then[0] = "stop": must be one of "goes on"'),
        ("[[faults]]", 'missing key "then"'),
        ("[[faults]]\nthen = []", "then must name at least one"),
        ('[[faults]]\nthen = ["hold"]\nlast = ["land"]', "last = ['land']: must be among then"),
        ('[[faults]]\nthen = ["hold"]\ncontact = "ground"', "needs a reason"),
        ('[[faults]]\nthen = ["hold"]\ntold_within_s = -1', "told_within_s = -1"),
        ('[[faults]]\nthen = ["hold"]\nnames = "("', "names = '(' is no regular expression"),
        ('[[faults]]\nthen = ["hold"]\nnames = 3', "names = 3: must be a text"),
        ('[[faults]]\nthen = ["hold"]\ntold_within_s = 1', "what must be told needs names"),
        ('[[faults]]\nthen = ["hold"]\nmargin_mm = -1', "margin_mm = -1 needs a reason"),
        (
            '[[faults]]\nthen = ["hold"]\nmargin_mm = nan',
            "margin_mm = nan: must be -1e+06 to 1e+06",
        ),
        ('[[faults]]\nthen = ["hold"]\nforce = 2', "force = 2 needs a reason"),
        ('[[faults]]\nthen = ["hold"]\nforce = 0.5', "force = 0.5: must be 1 to 100"),
        ("names = 3", "names must give a regular expression for each unit"),
        ('names.gyros = "x"', "names must give a regular expression for each unit"),
        ("names.gyro = 3", "names must give a regular expression for each unit"),
        ('[[faults]]\nthen = ["hold"]\nin.hover.then = ["hold"]', '"in.hover": a mode is one of'),
        ('[[faults]]\nthen = ["hold"]\n[[faults]]\nthen = ["hold"]', '"none" is there twice'),
        ("faults = 3", "must be an array of tables"),
        ("not_flown.hold.rtk = 3", "not_flown must give a reason"),
        ('[[faults]]\nthen = ["hold"]\ntold_within_s = [1]', "faults[0]: "),
        ("[[faults]]\nthen = 3", "faults[0]: "),
        ('[[faults]]\nthen = ["hold"]\nfault = {unit = [1], kind = 2}', "faults[0]: "),
        ("[[", "faults.toml"),
        (
            f"{_MOTOR}instances = 5",
            "instances = 5: must be an array of numbers (0 to 8 in steps of 1)",
        ),
        (f"{_MOTOR}instances = [nan]", "instances[0] = nan: must be 0 to 8 in steps of 1"),
        (
            f"{_MOTOR}instances = [1, 5]",
            "instances[1] = 5: must be, of a motor, 0 (all) to 4",
        ),
        (f"{_MOTOR}instances = [true]", "instances[0] = True: must be"),
        (f"{_MOTOR}instances = [1.5]", "instances[0] = 1.5: must be"),
        (f"{_MOTOR}share = [nan]", "share = [nan]: must be a number (0 to 1)"),
        (f"{_MOTOR}share = nan", "share = nan: must be 0 to 1"),
        (f'{_MOTOR}size = "big"', "size = 'big': must be a number (-1000 to 1000)"),
        (f"{_MOTOR}delay_ms = 3", "delay_ms = 3: must be 0 to 10000 in steps of 2"),
        (f"{_MOTOR}duration_s = true", "duration_s = True: must be a number (0 to 86400)"),
        (f"{_MOTOR}jump_s = {'9' * 400}", "jump_s = 999"),
        (f'{_MOTOR}name = "a"\nwith = [{{ unit = "gyro" }}]', 'missing key "with[0].kind"'),
        (f'{_MOTOR}with = [{{ unit = "gyro", kind = "off" }}]', "needs a name"),
        (f"{_MOTOR}mirrored = 3", "mirrored = 3: must be true or false"),
        (f"{_MOTOR}mirrored = true", "mirrored: one of the kinds must be wrong, drifting"),
        (f'{_MOTOR}name = "a"\nwith = 3', "with must be an array of tables"),
        (f"{_MOTOR}name = 5", "name = 5: must be a text"),
        (f'{_MOTOR}link = "no"', "link = 'no': must be true or false"),
        (f"{_MOTOR}why = 3", "why = 3: must be a text"),
        (f"{_MOTOR}margin_mm = {'9' * 19}", "must be -1e+06 to 1e+06"),
        (f"{_MOTOR}told_within_s = {'9' * 19}", "must be 0.001 to 86400 or inf"),
        (
            '[[faults]]\nunits = ["vio"]\nkinds = ["wrong"]\nthen = ["hold"]',
            "vio-wrong: with perfect what a sensor says is believed, unless it is silent",
        ),
        (
            '[[faults]]\nunits = "gyro"\nthen = ["hold"]',
            "units = 'gyro': must be an array of texts",
        ),
    ],
)
def test_a_file_that_says_something_else_is_refused(
    text: str, sentence: str, tmp_path: Path
) -> None:
    path = tmp_path / "faults.toml"
    path.write_text(text)
    with pytest.raises(ExpectationError) as refused:
        expectations(path)
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_cell_is_flown_judged_and_written_down() -> None:
    cell = Cell("land", expectations()["vio-off"], 0)
    judged = judge(cell, cell.row())
    warning = judged.flight.warning
    assert judged.flight.problem == ""
    assert judged.flight.took_s > 0.0
    assert warning is not None
    assert warning.after_s < 0.5
    row = json.loads(json.dumps(judged.as_json(), allow_nan=False))
    assert (row["fault"], row["mode"], row["told_s"]) == ("vio-off", "land", warning.after_s)
    written = page([judged, judge(cell, replace(FINE, texts=()))], ("seed 0",))
    assert "vio-off" in written
    assert "silent" in written


@pytest.mark.long
@pytest.mark.parametrize("mode", SITUATIONS)
def test_without_a_fault_nothing_is_told_and_nothing_done(mode: str) -> None:
    flight = fly(mode)
    assert (flight.warning, flight.actions, flight.contact, flight.problem) == (None, (), "", "")
    assert flight.least_m is not None
    assert flight.least_m > 0.0


@pytest.mark.long
def test_a_fault_over_the_real_link_is_seen_by_the_station(tmp_path: Path) -> None:
    found = tmp_path / "cells.json"
    main(["hold", "simulator-killed", "--json", str(found)])
    (row,) = json.loads(found.read_text())
    assert row["actions"] == ["ended"]
    assert row["told"].startswith("sitl ended with code -9")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["hover", "vio-off"], "unknown mode hover"),
        (["hold", "vio-of"], "did you mean vio-off"),
        (["hold", "any"], "--matrix --list names all modes and faults"),
        (["hold"], "give MODE and FAULT, --matrix"),
        (["workspace", "gps-off-rtk"], "workspace is not flown with rtk"),
        ([], "give MODE and FAULT, --matrix"),
        (["hold", "vio-off", "--only", "vio"], "--only chooses cells of the matrix"),
        (["--matrix", "--only", "nothing like it"], "no fault and no mode contains"),
        (["hold", "vio-off", "--expect", "no/such.toml"], "no/such.toml"),
        (["--matrix", "--pairs", "3"], "give MODE and FAULT, --matrix, --pairs or --pair"),
        (["--pair", "0", "--only", "vio"], "--only chooses cells of the matrix, or pairs"),
        (["--pairs", "3", "--seed", "0:2"], "pairs are drawn from one seed"),
        (["--matrix", "--drawn", "3", "--seed", "0:2"], "cells are drawn from one seed"),
        (["hold", "vio-off", "--drawn", "3"], "--drawn draws cells of the matrix"),
        (["--pairs", "3", "--only", "nothing like it"], "none of 3 pairs contains"),
    ],
)
def test_what_cannot_be_flown_is_refused_in_a_sentence(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count("\n") == 1


def test_what_would_be_flown_is_named_and_nothing_flies(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Cell, "row", lambda self: pytest.fail("flown"))
    assert main(["--matrix", "--list", "--seed", "0:3"]) == 0
    named = [tuple(line.split()) for line in capsys.readouterr().out.splitlines()]
    known = expectations()
    assert named == [(mode, one.name) for one in known.values() for mode in one.modes]
    assert main(["--matrix", "--list", "--only", "hold simulator-killed"]) == 0
    assert capsys.readouterr().out == "hold       simulator-killed\n"
    assert main(["--pairs", "3", "--list"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 3


def test_a_drawn_cell_has_a_seed_of_its_own_and_flies_again_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    flown: list[tuple[str, str, int]] = []

    def hit(cell: Cell) -> FaultFlight:
        flown.append((cell.mode, cell.expected.name, cell.seed))
        return replace(FINE, contact="wall", ended="it hit the wall")

    monkeypatch.setattr(Cell, "row", hit)
    drawn = ["--matrix", "--only", "vio-wrong", "--drawn", "20", "--workers", "0"]
    assert main([*drawn, "--seed", "5", "--html", str(tmp_path / "cells.html")]) == 1
    first, said = sorted(flown), capsys.readouterr().out
    assert len({seed for _, _, seed in first}) == 20
    assert len({mode for mode, _, _ in first}) > 3
    again = re.search(r"again: pandion faults (\S+) (\S+) --seed (\d+)", said)
    assert again is not None
    flown.clear()
    main([*again.group(1, 2), "--seed", again.group(3)])
    assert len(flown) == 1
    assert flown[0] in first
    flown.clear()
    main([*drawn, "--seed", "5"])
    assert sorted(flown) == first
    flown.clear()
    main([*drawn, "--seed", "6"])
    assert sorted(flown) != first


def test_a_matrix_is_resumed_from_its_journal_and_judged_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    flown = []

    def count(cell: Cell) -> FaultFlight:
        flown.append(cell.mode)
        return replace(FINE, actions=("descend",))

    monkeypatch.setattr(Cell, "row", count)
    journal, found = str(tmp_path / "flown.jsonl"), tmp_path / "cells.json"
    words = ["land", "vio-off", "--journal", journal, "--json", str(found)]
    assert main(words) == 0
    first = json.loads(found.read_text())
    assert main(words) == 0
    assert (flown, json.loads(found.read_text())) == (["land"], first)
    strict = tmp_path / "strict.toml"
    strict.write_text('[[faults]]\nunits = ["vio"]\nkinds = ["off"]\nthen = ["terminate"]\n')
    assert main([*words, "--expect", str(strict)]) == 1
    assert "descend; must be terminate" in capsys.readouterr().out
    assert flown == ["land"]


def test_a_command_that_is_no_number_ends_the_flight_with_a_problem() -> None:
    seen = Observer(SITUATIONS["hold"])
    outputs = replace(outputs_at(0), actuators=ActuatorCommand((1.0,) * 4, (0.0, math.nan)))
    seen.see(4.5, outputs)
    assert seen.problem == "a command that is no number, 0.500 s after the fault"


@pytest.mark.parametrize(
    ("suite", "first", "flown"),
    [
        ("gnss", FaultFlight(problem="not armed"), 1_000_003),
        ("gnss", FaultFlight(contact="wall"), 1_000_003),
        ("rtk", FaultFlight(problem="not armed"), 1_000_003),
        ("rtk", FaultFlight(contact="wall"), 0),  # a defect of the vehicle
        ("mocap", FaultFlight(problem="not armed"), 0),
    ],
)
def test_a_seed_with_which_satellites_give_no_flight_is_replaced(
    suite: str, first: FaultFlight, flown: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    seeds: list[int] = []

    def fly_without(mode: str, faults: tuple[Fault, ...], suite: str, seed: int) -> FaultFlight:
        if faults:
            seeds.append(seed)
        return FINE if faults or seed else first

    monkeypatch.setattr(matrix, "fly", fly_without)
    matrix._natural.cache_clear()
    Cell("hold", Expected("off", (Fault("gyro", "off"),), suite, False, {}), 0).row()
    matrix._natural.cache_clear()
    assert seeds == [flown]


@pytest.mark.parametrize(("failsafe", "actions"), [(True, ["land"]), (False, [])])
def test_a_return_that_a_failsafe_lands_has_not_just_gone_on(
    failsafe: bool, actions: list[str]
) -> None:
    seen = Observer(SITUATIONS["return"])
    for k, mode in enumerate((Mode.RETURN, Mode.LAND, Mode.DISARMED)):
        was = Mode.RETURN if failsafe and mode is Mode.LAND else None
        outputs = outputs_at(10**6 * k)
        snapshot = replace(outputs.snapshot, mode=mode, failsafe_from=was)
        seen.see(4.0 + k, replace(outputs, shown=snapshot))
    assert seen.actions == actions
