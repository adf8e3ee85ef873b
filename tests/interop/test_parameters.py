"""Parameters of a flying program over real UDP, by the clients people use."""

from __future__ import annotations

import contextlib
import io
import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.param.param import Param, ParamError, ParamResult
from pymavlink import mavutil
from pymavlink.mavparm import MAVParmDict

from fsw.autopilot.parameters.param_type import value_of
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.storage.parameter_file import load
from pandion import param
from pandion.param_vehicle import NoAnswer, ParameterClient
from tests.interop.vehicle import REAL_TIME, Vehicle, parameter_file
from tests.parameters_on_the_wire import LISTED
from tests.processes.both_processes import free_port

PACING = REAL_TIME
DEFAULTS = LISTED


class Ground:
    """A vehicle that stands and waits, and where it listens."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.params = parameter_file(vehicle.out.parent)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
            ear.bind(("127.0.0.1", vehicle.gcs_port))
            ear.settimeout(90.0)
            self.port = int(ear.recvfrom(2048)[1][1])


@pytest.fixture(scope="module")
def ground(vehicle: Vehicle) -> Ground:
    return Ground(vehicle)


@pytest.fixture
def mavlink(ground: Ground) -> Iterator[Any]:
    link = mavutil.mavlink_connection(
        f"udpout:127.0.0.1:{ground.port}", source_system=255, source_component=190
    )
    link.mav.heartbeat_send(6, 8, 0, 0, 4)
    assert link.wait_heartbeat(timeout=30) is not None
    yield link
    link.close()


def downloaded(link: Any) -> dict[str, float]:
    """The whole list, by pymavlink."""
    link.mav.param_request_list_send(1, 1)
    values: dict[str, float] = {}
    until = time.monotonic() + 5.0
    while len(values) < len(LISTED) and time.monotonic() < until:
        value = link.recv_match(type="PARAM_VALUE", blocking=True, timeout=1.0)
        assert value is not None
        assert value.param_count == len(LISTED)
        if value.param_index != 65535:  # the checksum of all
            values[value.param_id] = value_of(value.param_value, value.param_type) or 0
    return values


def test_pymavlink_downloads_sets_and_reads_back(mavlink: Any, ground: Ground) -> None:
    begin = time.monotonic()
    values = downloaded(mavlink)
    assert time.monotonic() - begin < 1.0
    assert values == pytest.approx(DEFAULTS, rel=1e-6)
    with contextlib.redirect_stdout(io.StringIO()):
        assert MAVParmDict().mavset(mavlink, "PID_YAW_I", 1.5, parm_type=9)
    mavlink.mav.param_request_read_send(1, 1, b"PID_YAW_I", -1)
    assert mavlink.recv_match(type="PARAM_VALUE", blocking=True, timeout=1.0).param_value == 1.5
    assert load(ground.params).values["PID_YAW_I"] == 1.5, "on the disk before it is echoed"


@pytest.mark.long
def test_mavproxy_s_reader_loads_a_file_into_the_vehicle(
    mavlink: Any, ground: Ground, tmp_path: Path
) -> None:
    """As MAVProxy's `param load` does: values that differ are set and echoed."""
    file = tmp_path / "some.parm"
    file.write_text("PID_YAW_D 4.500000\nLND_SPEED 0.300000\n")
    known = MAVParmDict()
    known.update(downloaded(mavlink))
    with contextlib.redirect_stdout(io.StringIO()) as reported:
        assert known.load(str(file), mav=mavlink)
    assert "changed 2" in reported.getvalue()
    assert downloaded(mavlink)["LND_SPEED"] == pytest.approx(0.3)


@pytest.mark.long
def test_mavsdk_lists_everything_within_a_second_and_is_told_the_truth(ground: Ground) -> None:
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        sdk.add_any_connection(f"udpout://127.0.0.1:{ground.port}")
        system = sdk.first_autopilot(10.0)
        assert system is not None
        param = Param(system)
        begin = time.monotonic()
        values = param.get_all_params()
        assert time.monotonic() - begin < 1.0
        integers = {value.name: value.value for value in values.int_params}
        assert integers == {name: n for name, n in DEFAULTS.items() if isinstance(n, int)}
        floats = {value.name for value in values.float_params}
        assert floats == set(DEFAULTS) - set(integers)
        for name, whole in (("COM_OBL_RC_ACT", 4), ("COM_RCL_EXCEPT", 7), ("NAV_DLL_ACT", 0)):
            param.set_param_int(name, whole)
            assert param.get_param_int(name) == whole
            param.set_param_int(name, DEFAULTS[name])
        with pytest.raises(ParamError):
            param.set_param_int("COM_OBL_RC_ACT", 0)
        param.set_param_float("MIS_TAKEOFF_ALT", 1.3)
        assert param.get_param_float("MIS_TAKEOFF_ALT") == pytest.approx(1.3)
        for name, value, result in (
            ("MIS_TAKEOFF_ALT", 1e6, ParamResult.VALUE_OUT_OF_RANGE),
            ("MIS_TAKEOFF_ALT", float("nan"), ParamResult.VALUE_OUT_OF_RANGE),
            ("NOT_OURS", 1.0, ParamResult.DOES_NOT_EXIST),
        ):
            with pytest.raises(ParamError, match=result.name):
                param.set_param_float(name, value)
        assert param.get_param_float("MIS_TAKEOFF_ALT") == pytest.approx(1.3)
    finally:
        sdk.destroy()


@pytest.mark.long
def test_the_command_line_lists_sets_exports_and_imports(
    ground: Ground, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def output_of(*arguments: str, code: int = 0) -> tuple[str, str]:
        assert param.main([*arguments, f"--vehicle=udp:127.0.0.1:{ground.port}"]) == code
        output = capsys.readouterr()
        return output.out, output.err

    entries = {
        entry["name"]: entry for entry in json.loads(output_of("list", "trk_*", "--json")[0])
    }
    assert set(entries) == {name for name in DEFAULTS if name.startswith("TRK_")}
    assert entries["TRK_EFFORT"]["max"] == BY_NAME["TRK_EFFORT"].most
    _, error = output_of("set", "TRK_EFFORT", "1e9", code=1)
    assert error.startswith("pandion param: TRK_EFFORT is to be ")
    assert error.count("\n") == 1
    assert output_of("set", "TRK_EFFORT", "0.3")[0] == "TRK_EFFORT is 0.3\n"
    file = tmp_path / "out.parm"
    output_of("export", str(file))
    assert load(file).values["TRK_EFFORT"] == 0.3
    file.write_text("TRK_EFFORT 0.2\nPLN_W_YAW 0.06\nGONE 1\n")
    received, error = output_of("import", str(file), code=1)
    assert received == "2 parameters read, 2 changed, 1 refused\n"
    assert "GONE is unknown" in error
    assert "TRK_EFFORT" not in load(ground.params).values, "the default again needs no keeping"
    assert "PLN_W_YAW" in load(ground.params).values


def test_a_value_changed_on_one_link_is_told_to_every_client(mavlink: Any, ground: Ground) -> None:
    other = mavutil.mavlink_connection(f"udpout:127.0.0.1:{ground.port}", source_system=250)
    other.mav.heartbeat_send(6, 8, 0, 0, 4)
    assert other.wait_heartbeat(timeout=30) is not None
    mavlink.mav.param_set_send(1, 1, b"LND_T_STILL", 0.6, 9)
    for link in (mavlink, other):
        for name in ("LND_T_STILL", "COM_DISARM_LAND"):  # which repeats it
            received = link.recv_match(type="PARAM_VALUE", blocking=True, timeout=2.0)
            assert (received.param_id, received.param_value) == (name, pytest.approx(0.6))
    other.close()


def test_a_vehicle_that_is_not_there_is_one_sentence() -> None:
    with (
        ParameterClient(("127.0.0.1", free_port()), patience_s=0.05) as client,
        pytest.raises(NoAnswer, match=r"nothing came from the vehicle at udp:127\.0\.0\.1:"),
    ):
        client.read_all()
