"""Options declared once: a field of a dataclass carries name, help, parser and default.

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Options:
        scenario: str = option("SCENARIO", "name or path of a .toml file", default="walls")
        seed: int = option("--seed N", "root of all randomness", whole(), default=0)
        links: LinkChoice = group(LinkChoice)

``read`` makes such a value of the words of a command line, ``as_words`` makes words of the value.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from command_line.output import print_error
from command_line.parser import Parser
from command_line.values import one_of, output_file, path

Kind = TypeVar("Kind")


class ContradictionError(ValueError):
    """Options that do not go together, in one sentence; a dataclass of options raises it."""


class OneOf:
    """Options of which only one may be given; a declaration names this object."""

    def __init__(self, *, required: bool = False) -> None:
        self.required = required


@dataclass(frozen=True, slots=True)
class Option:
    """One option or positional argument; ``field`` puts it into a dataclass."""

    spec: str  # "--seed N", "SCENARIO", "NAME ..."; without a value's name it is a switch
    help: str
    parse: Callable[[str], Any] = str
    default: Any = None
    text: Callable[[Any], str] | None = None  # the opposite of ``parse``; None: str
    off: str = ""  # of a switch: the option that says the opposite
    old: str = ""  # the option's name until the last release
    one_of: OneOf | None = None
    required: bool = False  # there is no default
    repeated: bool = False  # may be given again: the value is a tuple of all

    def field(self) -> Any:
        """A field of a dataclass that holds the option's value."""
        metadata = {"option": self}
        if self.required:
            return dataclasses.field(metadata=metadata)
        return dataclasses.field(default=self.default, metadata=metadata)

    @property
    def flag(self) -> str:
        """The first word of what a user writes."""
        return self.spec.partition(" ")[0]

    @property
    def positional(self) -> bool:
        """Known by its place, not by a name."""
        return not self.spec.startswith("-")

    def words(self, value: Any) -> list[str]:
        """The words of a command line that give this value."""
        if value == self.default:
            return []
        if self.repeated:
            return [f"{self.flag}={(self.text or str)(one)}" for one in value]
        if isinstance(value, bool):
            return [self.flag if value else self.off]
        text = (self.text or (repr if isinstance(value, float) else str))(value)
        return [text] if self.positional else [f"{self.flag}={text}"]

    def declare(self, name: str, parser: Parser, groups: dict[OneOf, Any]) -> None:
        """Add it to a parser, to be read into ``name``."""
        into: Any = parser
        if self.one_of is not None:
            if self.one_of not in groups:
                groups[self.one_of] = parser.add_mutually_exclusive_group(
                    required=self.one_of.required
                )
            into = groups[self.one_of]
        flag, _, value = self.spec.partition(" ")
        action = self._added(name, parser, into, flag, value)
        if (names := getattr(self.parse, "names", None)) is not None:
            action.completer = lambda **_: names

    def _added(self, name: str, parser: Parser, into: Any, flag: str, value: str) -> Any:
        if self.positional:
            many: dict[str, Any] = (
                {"nargs": "+"} if value else {} if self.required else {"nargs": "?"}
            )
            return parser.add_argument(name, metavar=flag, **self._valued(), **many)
        if value:
            more: dict[str, Any] = {"action": _Collect} if self.repeated else {}
            more |= {"required": True} if self.required else {}
            action = into.add_argument(flag, dest=name, metavar=value, **self._valued(), **more)
            if self.old:
                self._declare_old(into, name, nargs=None, type=self._parsed)
            return action
        if self.off:
            into = parser.add_mutually_exclusive_group()
            into.add_argument(
                self.off,
                dest=name,
                action="store_false",
                default=self.default,
                help=f"the opposite of {flag} (default)",
            )
        action = into.add_argument(
            flag, dest=name, action="store_true", default=self.default, help=self._help()
        )
        if self.old:
            self._declare_old(into, name, nargs=0)
        return action

    def _valued(self) -> dict[str, Any]:
        return {"type": self._parsed, "default": self.default, "help": self._help()}

    def _parsed(self, text: str) -> Any:
        try:
            return path(text) if self.parse is Path else self.parse(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    def _help(self) -> str:
        text = self.help
        obvious = (
            self.repeated
            or self.default is None
            or isinstance(self.default, bool)
            or self.default == ""
        )
        if not obvious and "(default" not in text:
            shown = f"{self.default:g}" if isinstance(self.default, float) else self.default
            text += f" (default {self.text(shown) if self.text else shown})"
        return text.replace("%", "%%")

    def _declare_old(self, into: Any, name: str, **more: Any) -> None:
        new = self.flag

        class Renamed(argparse.Action):
            def __call__(
                self, parser: Any, namespace: Any, values: Any, option_string: str | None = None
            ) -> None:
                print_error(
                    parser.prog,
                    f"{option_string} is now {new}; "
                    "the old name will be removed in the next release",
                )
                setattr(namespace, name, True if self.nargs == 0 else values)

        into.add_argument(
            self.old,
            dest=name,
            action=Renamed,
            default=argparse.SUPPRESS,
            help=argparse.SUPPRESS,
            **more,
        )


class _Collect(argparse.Action):
    """Takes in one more value of an option that may be given again."""

    def __call__(
        self, parser: Any, namespace: Any, values: Any, option_string: str | None = None
    ) -> None:
        setattr(namespace, self.dest, (*getattr(namespace, self.dest), values))


def option(spec: str, help: str, parse: Callable[[str], Any] = str, **more: Any) -> Any:
    """A field with an option of its own; see :class:`Option`."""
    return Option(spec, help, parse, **more).field()


def declared(one: Option) -> Any:
    """A field with an option that several dataclasses share."""
    return one.field()


def switch(spec: str, help: str, **more: Any) -> Any:
    """A field that is False unless the option is given."""
    return Option(spec, help, default=False, **more).field()


def group(kind: type[Any]) -> Any:
    """A field that holds a dataclass with options of its own."""
    return dataclasses.field(default_factory=kind, metadata={"group": kind})


def json_file(what: str) -> Any:
    """The field for ``--json FILE``, to which a program writes ``what``."""
    text = f"write {what} as JSON to FILE; - for standard output"
    return Option("--json FILE", text, output_file).field()


def events() -> Any:
    """The field for ``--events text|json``: how a process reports on standard output."""
    text = "how to report on standard output: text for people, json for programs"
    return Option("--events HOW", text, one_of("way to report", "text", "json"), "text").field()


def read(kind: type[Kind], prog: str, description: str, argv: list[str] | None) -> Kind:
    """The options of a command line; an unusable one ends the program with code 2."""
    parser = Parser(prog, description)
    groups: dict[OneOf, Any] = {}
    for name, one in _options(kind):
        one.declare(name, parser, groups)
    values = vars(parser.read(argv))
    try:
        return _build(kind, values)
    except ContradictionError as error:
        parser.error(str(error))


def as_words(value: Any) -> list[str]:
    """The words of a command line that ``read`` makes this value of; defaults are left out."""
    words: list[str] = []
    for field in dataclasses.fields(value):
        held = getattr(value, field.name)
        if "group" in field.metadata:
            words += as_words(held)
        elif "option" in field.metadata:
            words += field.metadata["option"].words(held)
    return words


def _options(kind: Any) -> Iterator[tuple[str, Option]]:
    for field in dataclasses.fields(kind):
        if "group" in field.metadata:
            yield from _options(field.metadata["group"])
        elif "option" in field.metadata:
            yield field.name, field.metadata["option"]


def _build(kind: type[Kind], values: dict[str, Any]) -> Kind:
    made: Any = kind
    return made(  # type: ignore[no-any-return]
        **{
            field.name: _build(field.metadata["group"], values)
            if "group" in field.metadata
            else values[field.name]
            for field in dataclasses.fields(made)
            if field.metadata
        }
    )
