"""What an option's word may be, for the benchmarks alone."""

from __future__ import annotations

from argparse import ArgumentTypeError
from collections.abc import Callable


def several(parse: Callable[[str], int], example: str) -> Callable[[str], tuple[int, ...]]:
    """Numbers with commas between them."""

    def parse_all(text: str) -> tuple[int, ...]:
        try:
            return tuple(parse(part) for part in text.split(","))
        except ArgumentTypeError as error:
            raise ArgumentTypeError(f"{error}; several are written as {example}") from None

    return parse_all
