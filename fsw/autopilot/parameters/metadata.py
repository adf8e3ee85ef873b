"""Component metadata: the documents from which a ground station learns names, units and ranges.

A ground station asks for COMPONENT_METADATA, fetches the general document and from there the one
about parameters, both by MAVLink FTP. Format version 1 is what QGroundControl reads.

Source: https://mavlink.io/en/services/component_information.html
"""

from __future__ import annotations

import json
import zlib
from typing import Any, Final

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.parameters.facts import FACTS, GROUP, Fact
from fsw.autopilot.parameters.registry import BY_NAME, PARAMETERS, Choices, Parameter

_VERSION: Final = 1
_PARAMETER_TYPE: Final = 1  # COMP_METADATA_TYPE_PARAMETER
_EVENT_TYPE: Final = 4  # COMP_METADATA_TYPE_EVENTS


def parameter_document() -> bytes:
    """The document about all parameters, as JSON."""
    every = [*map(_described, PARAMETERS), *map(_told, FACTS)]
    every.sort(key=lambda entry: str(entry["name"]))
    return _encoded({"version": _VERSION, "parameters": every})


def general_document(parameter_uri: str, events: tuple[str, bytes], firmware_version: str) -> bytes:
    """The document that says where the others are, as JSON.

    The parameters' is at an address ``mftp://...``, as that of the ``events`` is, which comes with
    its content; the version is three numbers with dots.
    """
    parameters = {
        "type": _PARAMETER_TYPE,
        "uri": parameter_uri,
        "fileCrc": metadata_crc(parameter_document()),
    }
    event_uri, document = events
    explained = {"type": _EVENT_TYPE, "uri": event_uri, "fileCrc": metadata_crc(document)}
    return _encoded(
        {
            "version": _VERSION,
            "vendorName": "Pandion",
            "modelName": "aerial manipulator",
            "firmwareVersion": firmware_version,
            "metadataTypes": [parameters, explained],
        }
    )


def metadata_crc(document: bytes) -> int:
    """CRC-32 as component metadata and MAVLink FTP have it: nothing inverted, unlike zlib's."""
    return zlib.crc32(document, 0xFFFFFFFF) ^ 0xFFFFFFFF


def _described(parameter: Parameter) -> dict[str, Any]:
    default = parameter.default
    return {
        "name": parameter.name,
        "type": _type(default),
        "shortDesc": parameter.meaning,
        "group": parameter.group,
        "category": "Standard",
        "units": parameter.unit,
        "default": default,
        "min": parameter.kept(parameter.least),
        "max": parameter.kept(parameter.most),
        **_form(parameter.choices, _decimals(default, at_least=2)),
    }


def _told(fact: Fact) -> dict[str, Any]:
    if fact.repeats:
        return _described(BY_NAME[fact.repeats]) | {
            "name": fact.name,
            "longDesc": f"Another name: {fact.meaning}",
        }
    value = fact.read({}, AIRFRAME)
    found = {
        "name": fact.name,
        "type": _type(value),
        "shortDesc": fact.label,
        "longDesc": f"Read only: {fact.meaning}",
        "group": GROUP,
        "category": "Standard",
        "units": fact.unit,
        **_form(fact.choices, _decimals(value, at_least=0)),
    }
    return (
        found if callable(fact.value) else found | dict.fromkeys(("default", "min", "max"), value)
    )


def _type(value: float) -> str:
    return "Int32" if isinstance(value, int) else "Float"


def _decimals(value: float, at_least: int) -> int:
    """As many as the value has, six at most."""
    if isinstance(value, int):
        return 0
    return max(at_least, len(f"{value:f}".rstrip("0").partition(".")[2]))


def _form(choices: Choices, decimals: int) -> dict[str, Any]:
    """How a value is shown and chosen."""
    if not choices:
        return {"decimalPlaces": decimals}
    values = [{"value": number, "description": what} for number, what in choices]
    return {"decimalPlaces": 0, "values": values}


def _encoded(document: dict[str, Any]) -> bytes:
    return json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
