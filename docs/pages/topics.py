"""The table of topics in docs/reference/flight-log.md."""

from __future__ import annotations

import itertools
from typing import Final

from fsw.log.topics import TOPICS
from messages.ground_truth import TRUTH_TOPICS
from messages.ulog import Field, Topic

BEGIN: Final = "<!-- topics: make pages -->\n"
END: Final = "<!-- end -->"


def reference() -> str:
    """The topics as Markdown: a table of them, then the fields of each."""
    rows = ["| topic | written | content |", "|---|---|---|"]
    every = (*TOPICS, *TRUTH_TOPICS)
    rows += [f"| [`{t.name}`](#{t.name}) | {_when(t)} | {t.about} |" for t in every]
    return "\n".join(rows) + "\n\n" + "\n".join(_fields(topic) for topic in every) + "\n"


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


# What the page says once, of every topic that has the mark.
_MARKS: Final = {"; every tick with `LOG_PROFILE` 1": " †", "; none with exact sensors": " ‡"}


def _when(topic: Topic) -> str:
    when = topic.when
    for words, mark in _MARKS.items():
        when = when.replace(words, mark)
    return when


def _fields(topic: Topic) -> str:
    """The fields of a topic: those that follow each other with one type and note in one row."""
    rows = [f"### {topic.name}\n", "| field | type | |", "|---|---|---|"]
    for (type_, note), alike in itertools.groupby(topic.fields, lambda f: (_type(f), f.note)):
        rows.append(f"| {', '.join(f'`{field.name}`' for field in alike)} | {type_} | {note} |")
    return "\n".join(rows) + "\n"


def _type(field: Field) -> str:
    return field.declared.split(" ")[0]
