"""A table a topic, as comma-separated values."""

from __future__ import annotations

import contextlib
import csv
from pathlib import Path
from typing import Any


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
