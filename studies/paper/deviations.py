"""Where what is flown here differs from the paper: the sentences of ``deviations.toml``."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from command_line.bounded_toml import toml_table


def deviations(*topics: str) -> tuple[str, ...]:
    """The sentences about some plants and studies, each with its reason."""
    return tuple(sentence for topic in topics for sentence in _sentences()[topic])


@cache
def _sentences() -> dict[str, list[str]]:
    return toml_table(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
