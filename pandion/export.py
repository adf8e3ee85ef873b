"""``pandion export``: a flight log as CSV or MCAP, and layouts that show it."""

from __future__ import annotations

import contextlib
import csv
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from command_line.options import OneOf, option, read
from command_line.output import print_error, say
from command_line.parser import COULD_NOT_START
from pandion.display import Display

if TYPE_CHECKING:
    from messages.ulog import Topic
    from messages.ulog_reader import UlogFile
    from pandion.mcap_export import McapSink

DONE: Final = 0  # exit code

_SHOWN_RECORDS: Final = 5_000
_TEXTS: Final = "texts"  # the channel of status texts


_TARGET: Final = OneOf(required=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """One export."""

    log: Path = option("LOG", "flight.ulg, or its directory", Path, required=True)
    csv: Path | None = option("--csv DIR", "one file a topic, into DIR", Path, one_of=_TARGET)
    mcap: Path | None = option(
        "--mcap FILE", "one file, messages as JSON and what Foxglove draws", Path, one_of=_TARGET
    )
    layouts: Path | None = option(
        "--layouts DIR", "layouts for PlotJuggler and Foxglove, into DIR", Path, one_of=_TARGET
    )


def main(argv: list[str]) -> int:
    """Export once; returns the exit code."""
    options = read(ExportOptions, "pandion export", "Write a flight log in another format.", argv)
    from messages.ulog_reader import UlogError, open_log

    if options.layouts is not None:
        return _write_layouts(options.layouts)
    path: Path = options.log / "flight.ulg" if options.log.is_dir() else options.log
    try:
        log = open_log(path)
        with contextlib.ExitStack() as stack:
            sink = _sink(options, log, stack)
            display = Display(sys.stdout, lines=0)
            stack.enter_context(display.progress())
            count = _export(log, sink, display)
            if options.mcap is not None and log.is_ours:
                _draw(path, sink)
        if count == 0:
            raise UlogError(f"{path} holds no record")
    except (UlogError, ValueError, OSError) as error:
        print_error("pandion export", error)
        return COULD_NOT_START
    say(f"{count} records of {path} in {options.csv or options.mcap}{_left_out(log)}")
    return DONE


def _left_out(log: UlogFile) -> str:
    """What of a log is not among its records."""
    told = f"; the log {log.cut}" if log.cut else ""
    told += "" if log.whole else f", and its last {log.size - log.at} bytes are left out"
    for kind, count in sorted(log.unknown.items()):
        told += f"; {count} messages of the unknown kind {kind} are left out"
    return told


def _write_layouts(folder: Path) -> int:
    """Write both layouts; returns the exit code."""
    from view.layouts import foxglove_layout, plotjuggler_layout

    made = {
        "pandion.plotjuggler.xml": plotjuggler_layout(),
        "pandion.foxglove.json": foxglove_layout(),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in made.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        print_error("pandion export", error)
        return COULD_NOT_START
    say(f"{', '.join(made)} in {folder}")
    return DONE


def _draw(path: Path, sink: Any) -> None:
    """Add what Foxglove's panels draw."""
    from view.flight_data import read_flight
    from view.foxglove import foxglove_messages

    for shown in foxglove_messages(read_flight(path)):
        sink.add_drawn(shown.topic, shown.schema, round(1e6 * shown.t), shown.value)


class CsvSink(contextlib.ExitStack):
    """Writes ``TOPIC.csv`` files into a directory."""

    def __init__(self, directory: Path) -> None:
        """Make the directory.

        Raises:
            OSError: It cannot be made.
        """
        super().__init__()
        directory.mkdir(parents=True, exist_ok=True)
        self._directory = directory
        self._tables: dict[str, Any] = {}

    def add(self, topic: str, t_us: int, names: tuple[str, ...], values: tuple[Any, ...]) -> None:
        """Append a row, behind a first one with the names."""
        table = self._tables.get(topic)
        if table is None:
            path = self._directory / f"{topic}.csv"
            table = csv.writer(self.enter_context(path.open("w", newline="", encoding="utf-8")))
            table.writerow(names)
            self._tables[topic] = table
        table.writerow(values)


def _sink(options: ExportOptions, log: UlogFile, stack: contextlib.ExitStack) -> CsvSink | McapSink:
    if options.csv is not None:
        return stack.enter_context(CsvSink(options.csv))
    assert options.mcap is not None
    from pandion.mcap_export import McapSink

    facts = {name: str(value) for name, value in log.information.items()}
    return stack.enter_context(McapSink(options.mcap, facts))


def _export(log: UlogFile, sink: CsvSink | McapSink, display: Display) -> int:
    count = 0
    for topic, t_us, names, values in _rows(log):
        sink.add(topic, t_us, names, values)
        count += 1
        if count % _SHOWN_RECORDS == 0:
            display.share("exporting", log.at, log.size)
    return count


def _rows(log: UlogFile) -> Iterator[tuple[str, int, tuple[str, ...], tuple[Any, ...]]]:
    """Topic, time, names and values of each record; a long text is put together again."""
    from messages import ulog
    from messages.ulog_reader import columns, unpacker

    known: dict[int, tuple[Topic, Any, tuple[str, ...]]] = {}
    pieces = ""
    for record in log.records():
        reported = ulog.text_of(record.kind, record.body)
        if reported is not None:
            severity, t_us, text = reported
            yield _TEXTS, t_us, ("timestamp", "severity", "text"), (t_us, severity, text)
        if record.kind != ulog.DATA:
            continue
        if record.number not in known:
            topic = log.topics[record.number]
            known[record.number] = topic, unpacker(topic), columns(topic)
        topic, record_struct, names = known[record.number]
        values: tuple[Any, ...] = tuple(
            _text(value) if isinstance(value, bytes) else value
            for value in record_struct.unpack(record.body)
        )
        if names[-4:] == ("field", "part", "parts", "text"):
            t_us, field, part, parts, text = values
            pieces = (pieces if part else "") + text
            if part + 1 == parts:
                yield topic.name, t_us, ("timestamp", "field", "text"), (t_us, field, pieces)
        else:
            yield topic.name, values[0], names, values


def _text(value: bytes) -> str:
    return value.rstrip(b"\0").decode("utf-8", "replace")
