"""A command with several actions, each with options of its own."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any

from command_line.options import read
from command_line.output import print_error
from command_line.parser import COULD_NOT_START, Parser, unknown_name

Actions = Mapping[str, tuple[type[Any], Callable[..., int], str]]
"""By name: the options' class, what does it, and its line in the help."""


def read_action(
    prog: str, usage: str, purpose: str, actions: Actions, argv: list[str]
) -> int | tuple[Any, Callable[..., int]]:
    """The options and the function of the action that ``argv`` names.

    The exit code instead where that asks for help, or names none of the ``actions``.
    """
    if "_ARGCOMPLETE" in os.environ:
        _complete(actions, argv)
    if not argv or argv[0] in ("-h", "--help"):
        width = 2 + max(map(len, actions))
        rows = (f"  {name:{width}}{what}" for name, (_, _, what) in actions.items())
        print("\n".join((f"usage: {prog} ACTION {usage}", "", purpose, "", "actions:", *rows, "")))
        print(f"`{prog} ACTION --help` prints the options of an action.")
        return 0
    if argv[0] not in actions:
        print_error(prog, unknown_name("action", argv[0], actions))
        return COULD_NOT_START
    kind, act, what = actions[argv[0]]
    return read(kind, f"{prog} {argv[0]}", what, argv[1:]), act


def _complete(actions: Actions, argv: list[str]) -> None:
    """Answer a shell that is at the action; the parser of an action completes the rest."""
    if argv:
        os.environ["_ARGCOMPLETE"] = "3"  # the program's name has three words
        return
    parser = Parser("pandion", "")
    parser.add_argument("action", choices=list(actions))
    parser.read(argv)
