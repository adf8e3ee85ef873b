"""Inputs that fuzzing kept: every reader still takes or refuses each of them."""

from __future__ import annotations

from contextlib import ExitStack

import pytest

from tests.fuzz.fuzz import PACKAGES, kept
from tests.fuzz.targets import SET_UPS, seeds

MOST = 200  # of a reader, spread over all of them: the rest is for ``make fuzz``
OF_SLOW_ONES = {"log-pages": 20, "replay": 40, "results": 60}  # a tenth of a second each


def test_every_reader_has_a_function_and_packages() -> None:
    assert SET_UPS.keys() == PACKAGES.keys()


@pytest.mark.drawn(6)
@pytest.mark.requirement("REQ-LINK-6", "REQ-LINK-9")
@pytest.mark.parametrize("name", SET_UPS)
def test_no_input_that_was_kept_is_a_finding(name: str) -> None:
    inputs = [*seeds(name), *kept(name)]
    with ExitStack() as stack:
        attempt = SET_UPS[name](stack)
        for data in inputs[:: 1 + len(inputs) // OF_SLOW_ONES.get(name, MOST)]:
            attempt(data)
