"""The documents a ground station reads, against the rules of the format."""

import json
import re
from typing import Any

from fsw.autopilot.parameters.facts import FACT_BY_NAME
from fsw.autopilot.parameters.metadata import general_document, metadata_crc, parameter_document
from fsw.autopilot.parameters.registry import BY_NAME

# What the format allows of a parameter, and as what.
ALLOWED: dict[str, type | tuple[type, ...]] = {
    "name": str,
    "type": str,
    "shortDesc": str,
    "longDesc": str,
    "units": str,
    "default": (int, float),
    "decimalPlaces": int,
    "min": (int, float),
    "max": (int, float),
    "increment": (int, float),
    "rebootRequired": bool,
    "group": str,
    "category": str,
    "volatile": bool,
    "readOnly": bool,
    "values": list,
}


def test_each_parameter_is_described_as_the_format_wants_it() -> None:
    document = json.loads(parameter_document())
    assert set(document) == {"version", "parameters"}
    assert document["version"] == 1  # what QGroundControl reads
    for described in document["parameters"]:
        for key, value in described.items():
            assert isinstance(value, ALLOWED[key]), key
        assert re.fullmatch(r"[.\-a-zA-Z0-9_{}]{1,16}", described["name"])
        # What the vehicle's file says has none: the document is that of any vehicle.
        numbers = [described[key] for key in ("min", "default", "max") if key in described]
        assert numbers == sorted(numbers)
        if len(numbers) < 3:
            assert callable(FACT_BY_NAME[described["name"]].value)
        if described["type"] == "Int32":
            assert all(isinstance(number, int) for number in numbers)
            assert described["decimalPlaces"] == 0
        else:
            assert described["type"] == "Float"
            assert all(isinstance(number, float) for number in numbers)
        for choice in described.get("values", ()):
            assert set(choice) == {"value", "description"}


def test_every_choice_is_a_value_and_its_default_is_among_them() -> None:
    for described in json.loads(parameter_document())["parameters"]:
        values = [choice["value"] for choice in described.get("values", ())]
        assert not values or described["default"] in values, described["name"]


def test_the_description_says_what_the_table_says() -> None:
    described: dict[str, Any] = {
        entry["name"]: entry for entry in json.loads(parameter_document())["parameters"]
    }
    assert list(described) == sorted([*BY_NAME, *FACT_BY_NAME])
    tilt, entry = BY_NAME["PLN_TILT_MAX"], described["PLN_TILT_MAX"]
    assert (entry["units"], entry["default"]) == ("deg", 18.0)
    assert (entry["min"], entry["max"], entry["shortDesc"]) == (
        tilt.least,
        tilt.most,
        tilt.meaning,
    )


def test_the_general_document_leads_to_the_parameters_and_vouches_for_them() -> None:
    events = ("mftp:///events.json", b"{}")
    general = json.loads(general_document("mftp:///parameters.json", events, "0.1.0"))
    assert general["version"] == 1
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.\d+)?", general["firmwareVersion"])
    entry, other = general["metadataTypes"]
    assert other == {"type": 4, "uri": "mftp:///events.json", "fileCrc": metadata_crc(b"{}")}
    assert entry == {
        "type": 1,
        "uri": "mftp:///parameters.json",
        "fileCrc": metadata_crc(parameter_document()),
    }


def test_the_checksum_is_the_one_of_mavlink_ftp() -> None:
    def bitwise(document: bytes) -> int:
        state = 0
        for byte in document:
            state ^= byte
            for _ in range(8):
                state = state >> 1 ^ (0xEDB88320 if state & 1 else 0)
        return state

    assert metadata_crc(b"123456789") == bitwise(b"123456789") == 0x2DFD2D88
