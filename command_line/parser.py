"""An argument parser whose errors are one sentence with the nearest known name."""

from __future__ import annotations

import argparse
import difflib
import os
import re
from collections.abc import Iterable
from typing import NoReturn

from command_line.output import print_error

COULD_NOT_START = 2  # exit code
_IN_OUR_WORDS = {
    "^argument ": "",
    "ignored explicit argument (.*)$": r"takes no value; \1 was given",
    "expected one argument$": "a value must follow it",
    "^the following arguments are required: (.*)$": r"\1 must be given",
}
_MAX_NAMES = 40  # in a sentence; a vehicle has 200 parameters


class Parser(argparse.ArgumentParser):
    """Options in full only; the first unknown one is named."""

    def __init__(self, prog: str, description: str) -> None:
        super().__init__(prog=prog, description=description, allow_abbrev=False)

    def read(self, argv: list[str] | None) -> argparse.Namespace:
        """Parse or exit with code 2; a shell that completes a line gets its answer instead."""
        if "_ARGCOMPLETE" in os.environ:
            import argcomplete

            argcomplete.autocomplete(self)
        arguments, unknown = self.parse_known_args(argv)
        if unknown:
            first = next((word for word in unknown if word.startswith("-")), unknown[0])
            if not first.startswith("-"):
                self.error(f"'{first}' is one word too many; --help shows what is expected")
            self.error(unknown_name("option", first.partition("=")[0], self._option_names()))
        return arguments

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one sentence and exit with code 2."""
        for said, ours in _IN_OUR_WORDS.items():
            message = re.sub(said, ours, message)
        print_error(self.prog, message)
        raise SystemExit(COULD_NOT_START)

    def _option_names(self) -> list[str]:
        shown = (action for action in self._actions if action.help != argparse.SUPPRESS)
        return [name for action in shown for name in action.option_strings]


def unknown_name(what: str, name: str, known: Iterable[str]) -> str:
    """A sentence about a name that does not exist."""
    # Dashes, which all options have in common, make any two of them alike.
    names = {one.lstrip("-"): one for one in known}
    nearest = difflib.get_close_matches(name.lstrip("-"), names, n=1, cutoff=0.51)
    if nearest:
        hint = f"did you mean {names[nearest[0]]}?"
    elif len(names) > _MAX_NAMES:
        hint = f"none of the {len(names)} that there are is like it"
    else:
        hint = f"known: {', '.join(names.values())}"
    return f"unknown {what} {name}; {hint}"
