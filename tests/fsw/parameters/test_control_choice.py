"""The names that a command line offers are the ones that can be built."""

from __future__ import annotations

from fsw.mpc.solvers import SOLVERS
from fsw.parameters.control_choice import KNOWN, tracking_of
from fsw.parameters.flight_config import CONTROLLERS, INNERS, ROBUSTNESS_PRESETS


def test_every_name_offered_can_be_built_and_none_is_left_out() -> None:
    assert {what: set(names) for what, names in KNOWN.items()} == {
        "controller": set(CONTROLLERS),
        "tracking": {tracking_of(inner) for inner in INNERS},
        "lambda": set(ROBUSTNESS_PRESETS),
        "solver": set(SOLVERS),
    }
