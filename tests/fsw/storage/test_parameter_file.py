"""Parameter files: both formats, whole or not at all, nothing lost."""

from __future__ import annotations

import contextlib
import io
import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.mavparm import MAVParmDict

from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.registry import BY_NAME, PARAMETERS
from fsw.autopilot.tuning import Tuning
from fsw.storage import parameter_file as storage
from fsw.storage.parameter_file import ParameterFile, as_params, as_parm, load, parse, save
from fsw.storage.parameter_store import ParameterStore
from tests.fsw.storage.test_parameter_store import ticks

DEFAULTS = {parameter.name: parameter.default for parameter in PARAMETERS}


def by_mavproxy(path: Path) -> dict[str, float]:
    """What pymavlink's reader, which MAVProxy uses, makes of a file."""
    read = MAVParmDict()
    with contextlib.redirect_stdout(io.StringIO()) as reported:
        assert read.load(str(path), use_excludes=False)
    assert "Invalid" not in reported.getvalue()
    return dict(read)


@st.composite
def value_sets(draw: st.DrawFn) -> dict[str, float]:
    chosen = draw(st.lists(st.sampled_from(PARAMETERS), unique=True, min_size=1))
    return {
        p.name: p.kept(draw(st.floats(p.least, p.most, width=64)))
        for p in chosen
        if p.refusal(p.least) is None
    }


@given(value_sets())
@settings(max_examples=50, deadline=None)
def test_both_formats_bring_every_value_back(values: dict[str, float]) -> None:
    inside = {n: v for n, v in values.items() if BY_NAME[n].refusal(v) is None}
    for text in (as_params(inside), as_parm(inside)):
        loaded = parse(text)
        assert loaded.values == inside
        assert {n: type(v) for n, v in loaded.values.items()} == {
            n: int if BY_NAME[n].integer else float for n in inside
        }
        assert loaded.complaints == ()


def test_mavproxy_reads_what_we_write(tmp_path: Path) -> None:
    path = tmp_path / "vehicle.parm"
    save(path, DEFAULTS)
    assert by_mavproxy(path) == pytest.approx(DEFAULTS)


def test_we_read_what_mavproxy_writes_and_nothing_has_changed(tmp_path: Path) -> None:
    """MAVProxy keeps six decimals."""
    written = MAVParmDict()
    written.update(DEFAULTS)
    path = tmp_path / "mav.parm"
    written.save(str(path))
    assert load(path).values == DEFAULTS


def test_we_read_what_qgroundcontrol_writes() -> None:
    """Its lines: tabs, full precision of the REAL32, integers without a point."""
    text = (
        "# Onboard parameters for Vehicle 1\n#\n# Vehicle-Id Component-Id Name Value Type\n"
        "1\t1\tPID_YAW_P\t5\t9\n1\t1\tWALL_LAMBDA\t0.330000013113021851\t9\n"
    )
    assert parse(text).values == {"PID_YAW_P": 5.0, "WALL_LAMBDA": 0.33}


def test_a_params_file_has_qgroundcontrol_s_columns() -> None:
    (line,) = [row for row in as_params({"PID_YAW_P": 5.5}).splitlines() if row[0] != "#"]
    assert line.split("\t") == ["1", "1", "PID_YAW_P", "5.5", "9"]


def test_an_integer_has_qgroundcontrol_s_type_of_it() -> None:
    values = {"NAV_DLL_ACT": 3, "LND_SPEED": 0.3}
    rows = [row.split("\t") for row in as_params(values).splitlines() if row[0] != "#"]
    assert [row[2:] for row in rows] == [["LND_SPEED", "0.3", "9"], ["NAV_DLL_ACT", "3", "6"]]
    assert "NAV_DLL_ACT      3\n" in as_parm(values)


@pytest.mark.parametrize(
    "line", ["1\t1\tNAV_DLL_ACT\t3\t9", "NAV_DLL_ACT,3.000000", "NAV_DLL_ACT 3", "NAV_DLL_ACT 3e0"]
)
def test_a_file_of_a_vehicle_that_knew_no_integers_is_still_read(line: str) -> None:
    loaded = parse(line)
    assert (loaded.values, loaded.complaints) == ({"NAV_DLL_ACT": 3}, ())
    assert isinstance(loaded.values["NAV_DLL_ACT"], int)


@pytest.mark.parametrize(
    ("px4", "ours"), [("MPC_XY_VEL_MAX", "STR_V_MAX"), ("MPC_TKO_SPEED", "TKO_SPEED")]
)
def test_px4_s_name_of_a_parameter_sets_it(px4: str, ours: str) -> None:
    assert parse(f"{px4} 1.25").values == {ours: 1.25}


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16-le", "utf-16-be"])
def test_what_an_editor_of_windows_writes_is_read_from_its_first_line_on(
    encoding: str, tmp_path: Path
) -> None:
    path = tmp_path / "bom.param"
    mark = "" if encoding == "utf-8-sig" else "\ufeff"
    path.write_bytes(f"{mark}MIS_TAKEOFF_ALT,2\r\nNAV_DLL_ACT,3\r\n".encode(encoding))
    loaded = load(path)
    assert (loaded.values, loaded.complaints) == ({"MIS_TAKEOFF_ALT": 2.0, "NAV_DLL_ACT": 3}, ())


@pytest.mark.parametrize("there", [True, False])
def test_a_link_stays_one_and_what_it_leads_to_is_written(there: bool, tmp_path: Path) -> None:
    target, link = tmp_path / "elsewhere" / "vehicle.params", tmp_path / "link.params"
    target.parent.mkdir()
    if there:
        save(target, {"PID_YAW_P": 5.0})
    link.symlink_to(target)
    save(link, {"PID_YAW_P": 6.0})
    assert link.is_symlink()
    assert load(target).values == {"PID_YAW_P": 6.0}
    assert [file.name for file in target.parent.iterdir()] == ["vehicle.params"]


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("NAV_DLL_ACT 2.5", "NAV_DLL_ACT is an INT32 and must be a whole number"),
        ("FD_FAIL_R 60.5", "FD_FAIL_R is an INT32 and must be a whole number"),
        ("SAFE_OWNER nan", "nan is not a number"),
        ("COM_OBL_RC_ACT 0", "COM_OBL_RC_ACT is to be one of 3 Return"),
        ("SYS_HAS_MAG 1", "SYS_HAS_MAG is read only and 0 here"),
        ("1\t1\tNOT_OURS\t1\t9", "NOT_OURS is unknown"),
        ("PID_YAW_P five", "five is not a number"),
        ("PID_YAW_P nan", "nan is not a number"),
        ("PID_YAW_P inf", "inf is refused"),
        ("PID_YAW_P 1e9", "1e+09 is refused"),
        ("1\t154\tPID_YAW_P\t1\t9", "it is for component 1/154"),
        ("garbage", "it is not a parameter"),
        ("\x00\ufffd\x1b[2J a b", "it is not a parameter"),
        ("PID_YAW_P 0x10", "0x10 is not a number"),
        ("PID_YAW_P 1_0.0", "1_0.0 is not a number"),
        ("PID_YAW_P \u0663", "\u0663 is not a number"),
    ],
)
def test_a_line_of_no_use_is_passed_over_with_a_sentence(line: str, why: str) -> None:
    loaded = parse(f"# a comment\nPID_YAW_D 3 # kept\n{line}\n\nPID_YAW_I,1\n")
    assert loaded.values == {"PID_YAW_D": 3.0, "PID_YAW_I": 1.0}
    (complaint,) = loaded.complaints
    assert complaint.startswith("line 3 is passed over: ")
    assert why in complaint


@given(st.text())
def test_no_text_raises(text: str) -> None:
    loaded = parse(text)
    assert all("\n" not in complaint for complaint in loaded.complaints)


def test_a_file_that_is_no_text_is_read_as_lines_of_no_use(tmp_path: Path) -> None:
    path = tmp_path / "noise.params"
    path.write_bytes(bytes(range(256)))
    assert load(path).values == {}


def test_a_write_that_fails_leaves_the_old_file_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "vehicle.params"
    save(path, {"PID_YAW_P": 5.0})

    def power_cut(handle: int) -> None:
        raise OSError("power cut")

    monkeypatch.setattr(storage.os, "fsync", power_cut)
    with pytest.raises(OSError, match="power cut"):
        save(path, {"PID_YAW_P": 6.0})
    assert load(path).values == {"PID_YAW_P": 5.0}
    assert [file.name for file in tmp_path.iterdir()] == ["vehicle.params"]


def keeping(path: Path | None, tmp_path: Path) -> tuple[ParameterStore, ParameterFile]:
    store = ParameterStore(FlightConfig(), lambda tuning: None)
    kept = ParameterFile(path, tmp_path / "record.params", FlightConfig())
    kept.restore(store)
    kept.start()
    return store, kept


def settled(store: ParameterStore, name: str, value: float) -> list[Tuning]:
    """Change a value and wait until it is written."""
    asker = store.listen()
    assert store.change(name, value, asker) is None
    given: list[Tuning] = []
    while not asker.changed:
        given += ticks(store, 1)
    return given


def test_a_change_outlives_a_restart(tmp_path: Path) -> None:
    path = tmp_path / "vehicle.params"
    store, kept = keeping(path, tmp_path)
    settled(store, "PID_YAW_P", 5.0)
    kept.close()
    assert load(path).values == {"PID_YAW_P": 5.0}, "only what differs is the vehicle's own"
    assert load(tmp_path / "record.params").values == {**DEFAULTS, "PID_YAW_P": 5.0}
    again, kept = keeping(path, tmp_path)
    assert kept.restored == 1
    assert again.values["PID_YAW_P"] == 5.0
    kept.close()


def test_without_a_file_a_change_is_on_record_and_gone(tmp_path: Path) -> None:
    store, kept = keeping(None, tmp_path)
    settled(store, "PID_YAW_P", 5.0)
    kept.close()
    assert load(tmp_path / "record.params").values["PID_YAW_P"] == 5.0
    again, kept = keeping(None, tmp_path)
    assert again.values == DEFAULTS
    kept.close()


def test_what_could_not_be_used_is_not_lost_when_the_file_is_written(tmp_path: Path) -> None:
    path = tmp_path / "vehicle.params"
    path.write_text("PID_YAW_P 5\nOF_ANOTHER_AGE 7\n")
    _, kept = keeping(path, tmp_path)
    assert kept.complaints == ("line 2 is passed over: OF_ANOTHER_AGE is unknown",)
    kept.close()
    assert load(path).values == {"PID_YAW_P": 5.0}
    assert "OF_ANOTHER_AGE 7" in (tmp_path / "vehicle.params.old").read_text()


def test_a_file_that_cannot_be_written_is_noticed_before_the_flight(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nowhere"):
        keeping(tmp_path / "nowhere" / "vehicle.params", tmp_path)


def test_a_file_of_any_length_is_refused_at_once(tmp_path: Path) -> None:
    endless = tmp_path / "endless.params"
    endless.symlink_to("/dev/zero")
    with pytest.raises(OSError, match="it is not a regular file"):
        load(endless)
    endless.unlink()
    endless.touch()
    os.truncate(endless, 1 << 40)
    with pytest.raises(OSError, match="too long: must be at most 1048576 bytes"):
        load(endless)


def test_of_many_lines_of_no_use_the_first_are_named_and_the_rest_counted() -> None:
    complaints = parse("nothing\n" * 50_000).complaints
    assert len(complaints) == 21
    assert complaints[0].startswith("line 1 is passed over")
    assert complaints[-1] == "49980 more lines are passed over"
    assert len(parse("nothing\n" * 20).complaints) == 20
