"""Text from files, links and command lines, made safe to print."""

from __future__ import annotations


def printable(text: str) -> str:
    r"""The text in one line, with escapes (``\x1b``, ``\n``) in place of control characters.

    A name in a file or on a link may carry a terminal's escape sequences, a line break that forges
    another line, marks that reverse what follows, or bytes that are no UTF-8.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
