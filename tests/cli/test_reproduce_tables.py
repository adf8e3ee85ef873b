"""Tables of `pandion reproduce` fit 100 columns, and nothing of them is cut."""

from __future__ import annotations

import io
from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from pandion.reproduce import KEYS, WIDTH, _show, blocks
from studies.paper import summary
from studies.paper.settings import Report, Table

HEADERS = ("case", "controller", *summary.HEADERS, "c_s", "c_e", "paper", "paper TE m", "paper c_s")
ROW = (
    "II", "hc like-for-like", "20/20 (one flight)", "0.84–1.00", "+141.3", "20/20", "45.2, 60.1",
    "0.0731", "0.1559", "0.2304", "✓", "0.0716", "0.1234",
)  # fmt: skip


def test_the_widest_table_fits_and_is_whole() -> None:
    stream = io.StringIO()
    table = Table("Case II, with disturbance", HEADERS, (ROW, ROW))
    _show(Report("Table IV", [], (table,)), stream)
    lines = stream.getvalue().splitlines()
    assert max(map(len, lines)) <= WIDTH
    words = Counter(stream.getvalue().split())
    wanted = Counter(word for text in (*HEADERS, *ROW, *ROW) for word in text.split())
    assert wanted <= words, wanted - words


def test_the_caption_of_a_narrow_table_stays_one_line() -> None:
    stream, caption = io.StringIO(), "Minimum TE of any safe controller [m], in brackets"
    _show(Report("Table IV", [], (Table(caption, ("case", "TE m"), (("I", "0.1"),)),)), stream)
    assert stream.getvalue().splitlines()[0].rstrip() == caption


WORDS = st.text(st.characters(categories=["L", "N"]), min_size=0, max_size=20)


@given(st.integers(1, 20).flatmap(
    lambda n: st.lists(st.tuples(*[WORDS] * n), min_size=1, max_size=4)
))  # fmt: skip
def test_blocks_hold_every_column_once_beside_its_names(lines: list[tuple[str, ...]]) -> None:
    found = blocks(lines, WIDTH)
    names = [line[:KEYS] for line in lines]
    assert all([line[:KEYS] for line in block] == names for block in found)
    joined = [tuple(cell for block in found for cell in block[k][KEYS:]) for k in range(len(lines))]
    assert joined == [line[KEYS:] for line in lines]
