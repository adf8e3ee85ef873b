"""``pandion completion``, and what answers a shell that completes a command line."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass

import argcomplete
from argcomplete.lexers import split_line
from argcomplete.shell_integration import shellcode

from command_line.options import option, read
from command_line.parser import Parser
from command_line.values import one_of

SHELLS = ("bash", "zsh", "fish")


@dataclass(frozen=True, slots=True, kw_only=True)
class CompletionOptions:
    """One shell."""

    shell: str = option("SHELL", ", ".join(SHELLS), one_of("shell", *SHELLS), required=True)


def main(argv: list[str]) -> int:
    """Print what a shell reads when it starts; returns the exit code."""
    what = 'Let a shell complete verbs and options: eval "$(pandion completion bash)".'
    options = read(CompletionOptions, "pandion completion", what, argv)
    # In zsh the script is for bash's emulation, which argcomplete switches on.
    print(shellcode(["pandion"], shell=options.shell), end="")
    return 0


def complete(verbs: Iterable[str]) -> list[str]:
    """Answer a shell that is at the verb, and exit; else the words up to where it is.

    The options of a verb are completed by its own parser, in ``Parser.read``.
    """
    line, point = os.environ["COMP_LINE"], int(os.environ["COMP_POINT"])
    _, _, _, words, _ = split_line(line, point)
    if len(words) >= 2:
        # The verb is part of the program's name, as ``python script`` would be.
        os.environ["_ARGCOMPLETE"] = "2"
        return words[1:]
    parser = Parser("pandion", "")
    parser.add_argument("verb", choices=list(verbs))
    argcomplete.autocomplete(parser, always_complete_options=False)
    raise SystemExit(0)
