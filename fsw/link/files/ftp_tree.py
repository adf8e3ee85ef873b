"""The files that a ground station sees over FTP, as a tree of names; pure.

No path of a client ever reaches the file system: its parts are looked up in this tree, and what is
not in it does not exist. So there is no way out of it, whatever a path is made of.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from fsw.link.files.ftp_message import MAX_DATA, MAX_FILE
from fsw.link.files.served_file import ServedFile

Node: TypeAlias = "ServedFile | Mapping[str, Node]"
Directory: TypeAlias = Mapping[str, Node]


def find(root: Directory, path: bytes) -> Node | None:
    """Look a path up; None if there is nothing of that name."""
    try:
        parts = path.decode().split("/")
    except UnicodeDecodeError:
        return None
    node: Node = root
    for part in parts:
        if part in ("", "."):
            continue
        if not isinstance(node, Mapping) or part not in node:
            return None
        node = node[part]
    return node


def listing(directory: Directory, first: int) -> bytes:
    """Entries from number ``first`` on, as many as fit one message; empty when there are no more.

    An entry is ``D``, name, NUL for a directory; ``F``, name, tab, size, NUL for a file.
    """
    entries = b""
    for name in list(directory)[first:]:
        node = directory[name]
        if isinstance(node, Mapping):
            entry = f"D{name}\0".encode()
        else:
            entry = f"F{name}\t{min(node.size(), MAX_FILE)}\0".encode()
        if len(entries) + len(entry) > MAX_DATA:
            break
        entries += entry
    return entries
