"""A flight that is over: its log as arrays, its verdict, its page."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from command_line.bounded_json import JsonError, read_json
from command_line.output import json_text
from sitl.result import TruthResult
from sitl.scenario import Scenario
from studies.flight.job import Outcome

_MAX_BYTES: Final = 16 * 1024 * 1024  # of result.json

Columns = Mapping[str, NDArray[Any]]


class Log:
    """A flight's log, by the directory or file it is in.

    ``topics`` are those of docs/reference/flight-log.md.
    """

    def __init__(self, path: Path | str) -> None:
        """See ``load_log``."""
        self._path: Path | None = Path(path)

    @property
    def path(self) -> Path:
        """The log's directory or file.

        Raises:
            FileNotFoundError: The flight was flown without a log.
        """
        if self._path is None:
            raise FileNotFoundError("this flight has no log: fly it with log=True")
        return self._path

    @cached_property
    def _data(self) -> Any:
        from view.flight_data import read_flight

        return read_flight(self.path)

    @cached_property
    def topics(self) -> Mapping[str, Columns]:
        """Records of each topic: ``t`` (n,) [s, since the first record] and a column a field."""
        begin = self._data.begin
        return {
            name: {"t": table.t - begin, **table.columns}
            for name, table in self._data.tables.items()
        }

    @property
    def texts(self) -> list[tuple[float, str]]:
        """Time [s, since the first record] and text of what the vehicle told its operator."""
        return [(one.t - self._data.begin, one.text) for one in self._data.texts]

    @property
    def information(self) -> Mapping[str, str | int]:
        """What the log says about the flight: scenario, seed, controller, revision."""
        found: Mapping[str, str | int] = self._data.information
        return found

    @property
    def parameters(self) -> Mapping[str, float]:
        """Parameters that were flown with, by name."""
        found: Mapping[str, float] = self._data.parameters
        return found

    @cached_property
    def metrics(self) -> Mapping[str, Any]:
        """``result.json`` beside the log; empty where there is none.

        Raises:
            ValueError: It is damaged.
        """
        file = (self.path if self.path.is_dir() else self.path.parent) / "result.json"
        try:
            return read_json(file, _MAX_BYTES)
        except FileNotFoundError:
            return {}
        except JsonError as problem:
            raise ValueError(f"{file} {problem}") from None

    def frame(self, topic: str) -> Any:
        """A topic as a pandas DataFrame with the time [s] as its index.

        A field with several numbers has a column for each: ``p_WB[0]``.

        Raises:
            KeyError: The log has no record of the topic.
            ModuleNotFoundError: pandas is not installed: ``pip install pandas``.
        """
        import pandas as pd  # type: ignore[import-untyped,unused-ignore]

        columns = dict(self.topics[topic])
        t = columns.pop("t")
        flat: dict[str, NDArray[Any]] = {}
        for name, values in columns.items():
            if values.ndim == 1:
                flat[name] = values
            else:
                flat.update({f"{name}[{k}]": values[:, k] for k in range(values.shape[1])})
        return pd.DataFrame(flat, index=pd.Index(np.asarray(t), name="t"))

    def report(self, path: Path | str | None = None) -> Path:
        """Write the flight as one HTML page, beside the log or to ``path``; returns where.

        Raises:
            ModuleNotFoundError: plotly is not installed: ``pip install plotly``.
        """
        from pandion.report import write_report

        return write_report([self.path], None if path is None else Path(path))

    def view(self, port: int = 8080) -> None:
        """Show the flight in the browser at ``port`` [1] until interrupted, as ``pandion view``."""
        from pandion.view import main

        main([str(self.path), f"--port={port}"])

    def save(self, directory: Path | str) -> Path:
        """Copy the flight's files to a directory that does not exist yet; returns it.

        Raises:
            FileExistsError: It exists.
        """
        source = self.path if self.path.is_dir() else self.path.parent
        return Path(shutil.copytree(source, directory))


def load_log(path: Path | str) -> Log:
    """A flight's log: ``flight.ulg``, or the directory it is in, as ``pandion fly`` names it.

    Raises:
        UlogError: It is no log of Pandion, or is damaged.
    """
    log = Log(path)
    _ = log._data
    return log


class Result(Log):
    """What ``pandion.fly`` returns."""

    def __init__(self, verdict: Verdict, folder: TemporaryDirectory[str] | None) -> None:
        """Of a flight whose files are in a folder, None: it has none."""
        self._path = None if folder is None else Path(folder.name)
        self._folder = folder  # removed with this object
        self._verdict = verdict

    @property
    def scenario(self) -> Scenario:
        """What was flown."""
        return self._verdict.scenario

    @property
    def seed(self) -> int:
        """Root of the flight's randomness."""
        return self._verdict.seed

    @property
    def completed(self) -> bool:
        """Whether it was flown to its end, without a violation and within all limits."""
        return self._verdict.truth.completed

    @property
    def reason(self) -> str:
        """How it ended, in a sentence."""
        return self._verdict.truth.end_reason

    @property
    def truth(self) -> TruthResult:
        """The referee's verdict, whole."""
        return self._verdict.truth

    @property
    def margins(self) -> Mapping[str, float]:
        """Least margin [m] of each part from each zone, beyond the required clearance."""
        return self._verdict.truth.margins_m

    @property
    def min_margin(self) -> float | None:
        """The least of them [m]; None without zones."""
        return self._verdict.truth.min_margin_m

    @property
    def tracking_rms(self) -> float | None:
        """Tracking error of the end-effector [m], root of the mean square."""
        return self._verdict.truth.tracking_error_rms_m

    @property
    def row(self) -> Outcome | None:
        """The row of a campaign; None of a flight of two processes."""
        return self._verdict.row

    @property
    def overridden_s(self) -> float:
        """For how long our autopilot flew in place of an own controller [s]."""
        return self._verdict.overridden_s

    @property
    def texts(self) -> list[tuple[float, str]]:
        """Time [s] and text of what the vehicle told its operator, and of overrides."""
        return list(self._verdict.texts) if self._verdict.texts else super().texts

    @cached_property
    def metrics(self) -> Mapping[str, Any]:
        """Everything measured, as in ``result.json``."""
        return self._verdict.metrics

    def __repr__(self) -> str:
        margin = "no zones" if self.min_margin is None else f"{1e3 * self.min_margin:.1f} mm"
        error = "none" if self.tracking_rms is None else f"{1e3 * self.tracking_rms:.1f} mm"
        word = "completed" if self.completed else "NOT completed"
        return (
            f"<{self.scenario.name}, seed {self.seed}: {word}, {self.reason}; minimum margin "
            f"{margin}, tracking RMS {error}>"
        )


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is known of a flight without its log."""

    scenario: Scenario
    seed: int
    truth: TruthResult
    metrics: Mapping[str, Any]
    row: Outcome | None = None
    texts: tuple[tuple[float, str], ...] = ()
    overridden_s: float = 0.0


def write_json(folder: Path, **contents: Mapping[str, Any]) -> None:
    """Write each of the contents to the file of its name in a folder."""
    for stem, content in contents.items():
        text = json_text(content, 2) + "\n"
        (folder / f"{stem}.json").write_text(text, encoding="utf-8")
