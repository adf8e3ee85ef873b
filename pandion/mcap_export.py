"""One MCAP file: a channel a topic, messages as JSON with a schema, and what Foxglove draws."""

from __future__ import annotations

import contextlib
import math
import re
from pathlib import Path
from typing import Any

from mcap.writer import Writer

from command_line.output import json_text
from view.foxglove import schema_text

_TYPES = {bool: "boolean", int: "integer", float: "number", str: "string"}
_LAST_US = ((1 << 64) - 1) // 1000  # it counts nanoseconds
_ELEMENT = re.compile(r"(\w+)\[\d+\]")


class McapSink(contextlib.ExitStack):
    """Writes one file; arrays of a topic are arrays again."""

    def __init__(self, path: Path, facts: dict[str, str]) -> None:
        """Create the file; the facts about the flight become its metadata.

        Raises:
            OSError: It cannot be created.
        """
        super().__init__()
        self._writer = Writer(self.enter_context(path.open("wb")))
        self._writer.start(profile="", library="pandion")
        self._writer.add_metadata("flight", facts)
        self.callback(self._writer.finish)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}

    def add(self, topic: str, t_us: int, names: tuple[str, ...], values: tuple[Any, ...]) -> None:
        """Append a message, and its channel before the first.

        Raises:
            ValueError: MCAP cannot hold the time.
        """
        if topic not in self._channels:
            self._open(topic, topic, _schema(topic, names, values))
        self._write(topic, t_us, _object(names, values))

    def add_drawn(self, topic: str, schema: str, t_us: int, value: dict[str, Any]) -> None:
        """Append a message of one of Foxglove's own types, and its channel before the first.

        Raises:
            ValueError: MCAP cannot hold the time.
        """
        if topic not in self._channels:
            self._open(topic, schema, schema_text(schema))
        self._write(topic, t_us, value)

    def _open(self, topic: str, name: str, schema: dict[str, Any]) -> None:
        if name not in self._schemas:
            data = json_text(schema).encode()
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", data)
        number = self._writer.register_channel(topic, "json", self._schemas[name])
        self._channels[topic] = number

    def _write(self, topic: str, t_us: int, value: dict[str, Any]) -> None:
        if t_us > _LAST_US:
            raise ValueError(f"{topic} has the time {t_us} us, which MCAP cannot hold")
        data = json_text(value).encode()
        self._writer.add_message(self._channels[topic], 1000 * t_us, data, 1000 * t_us)


def _object(names: tuple[str, ...], values: tuple[Any, ...]) -> dict[str, Any]:
    """The record with its arrays; what is no number becomes null, because JSON has no NaN."""
    result: dict[str, Any] = {}
    for name, value in zip(names, values, strict=True):
        if isinstance(value, float) and not math.isfinite(value):
            value = None
        element = _ELEMENT.fullmatch(name)
        if element is None:
            result[name] = value
        else:
            result.setdefault(element[1], []).append(value)
    return result


def _schema(topic: str, names: tuple[str, ...], values: tuple[Any, ...]) -> dict[str, Any]:
    properties: dict[str, Any] = {}
    for name, value in zip(names, values, strict=True):
        kind: dict[str, Any] = {"type": _TYPES[type(value)]}
        if kind["type"] == "number":
            kind = {"type": ["number", "null"]}
        element = _ELEMENT.fullmatch(name)
        if element is None:
            properties[name] = kind
        else:
            properties[element[1]] = {"type": "array", "items": kind}
    return {"title": topic, "type": "object", "properties": properties}
