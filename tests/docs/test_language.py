"""Pages use the field's terms: words that readers could not search for stay out."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.docs.fences import DOCS, PAGES, ROOT, named, without_fences

# Each word, and what to write instead.
PLAIN = {
    r"\bset-points?\b": "setpoint",
    r"\bleast margins?\b": "minimum margin",
    r"\bverdicts?\b": "result",
    r"\bwhoever\b": "name the reader or the program",
    r"\bnobody\b": "name what does not happen",
    r"\bsomebody\b": "name it",
    r"\b(is|are|was|were) told\b": "reported, configured",
    r"\bnursery\b": "fork server",
    r"\bhalves\b": "processes, or simulator and flight software",
    r"\bstands? still\b": "pauses, or is suspended",
    r"\bhowever long\b": "for any time",
    r"\bhears?\b": "receives",
}
# Their texts come from the code; the changelog names the words that were replaced.
GENERATED = {DOCS / "reference" / name for name in ("parameters.md", "messages.md")}
EXEMPT = {*GENERATED, ROOT / "CHANGELOG.md", ROOT / "messages" / "README.md"}


@pytest.mark.parametrize("page", [p for p in PAGES if p not in EXEMPT], ids=named)
def test_a_page_uses_plain_words(page: Path) -> None:
    text = re.sub(r"`[^`]*`|<!--.*?-->", "", without_fences(page), flags=re.S)
    found = {
        match.group(): instead
        for word, instead in PLAIN.items()
        for match in re.finditer(word, text, re.IGNORECASE)
    }
    assert found == {}
