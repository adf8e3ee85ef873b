"""The names that a command line offers are the ones that can be built."""

from __future__ import annotations

from fsw.autopilot.model.body import BODIES
from fsw.autopilot.parameters.control_choice import INNER_LOOPS, KNOWN
from fsw.autopilot.parameters.flight_config import INNERS, ROBUSTNESS_PRESETS
from studies.flight.rival_planners import OPTIMISERS, VARIANTS


def test_every_name_offered_can_be_built_and_none_is_left_out() -> None:
    assert {what: set(names) for what, names in KNOWN.items()} == {
        "controller": set(VARIANTS),
        "tracking": set(INNER_LOOPS),
        "lambda": set(ROBUSTNESS_PRESETS),
        "solver": set(OPTIMISERS),
        "body": set(BODIES),
    }
    # PX4's are flown by a link, not by a name.
    assert {*INNER_LOOPS.values(), "px4"} == set(INNERS)
