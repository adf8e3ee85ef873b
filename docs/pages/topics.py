"""The topics in docs/reference/flight-log.md."""

from __future__ import annotations

import itertools
import re
from typing import Final

from fsw.log.topics import TOPICS
from messages.ground_truth import TRUTH_TOPICS
from messages.ulog import Field, Topic

BEGIN: Final = "<!-- topics: make pages -->\n"
END: Final = "<!-- end -->"


def reference() -> str:
    """The topics as Markdown: when each is written, what it is, and its fields."""
    return "\n".join(_topic(topic) for topic in (*TOPICS, *TRUTH_TOPICS)) + "\n"


def inserted(page: str) -> str:
    """The page with the table as it should be.

    Raises:
        ValueError: The page has no place for it.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError("the page has no place for the topics")
    return f"{before}{begin}{reference()}{end}{after}"


# The note of the time of a measurement.
_STAMP: Final = "s, of the measurement, on the clock of the tick"
# What the page says once, of every topic that has the mark.
_MARKS: Final = {"; every tick with `LOG_PROFILE` 1": " †", "; none with exact sensors": " ‡"}
# Units and axes that the page says once, of every field without others.
_PLAIN: Final = re.compile(
    r"(m|m/s(\^[234])?|m\^2(/s\^2)?|rad|rad/s(\^2)?|N|N m|s|kg)(, NED)?"
    r"|\[w, x, y, z\](, body to NED)?"
)


def _when(topic: Topic) -> str:
    when = topic.when
    for words, mark in _MARKS.items():
        when = when.replace(words, mark)
    return when


def _topic(topic: Topic) -> str:
    """One topic; fields that follow each other with one type and note are in one line."""
    lines = [f"### {topic.name}\n", f"{topic.about} ({_when(topic)}).\n"]
    fields = [field for field in topic.fields if field.note != _STAMP]
    for (type_, note), alike in itertools.groupby(fields, lambda f: (_type(f), _note(f))):
        names = ", ".join(f"`{field.name}`" for field in alike)
        lines.append(f"- {names} {type_}{f': {note}' if note else ''}")
    return "\n".join(lines) + "\n"


def _note(field: Field) -> str:
    """What is to be said of one field beyond what the page says of all."""
    return "" if _PLAIN.fullmatch(field.note) else field.note


def _type(field: Field) -> str:
    return field.declared.split(" ")[0]
