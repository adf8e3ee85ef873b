"""What counts as a violation in a flight of a campaign."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from studies.campaign.flight import CampaignRow

ANY: Final = "any of these"
# A flight that could not be flown counts in each: nothing is known of it that would clear it.
_UNFLOWN: Final = "not flown"
_OBSERVED: Final[dict[str, Callable[[CampaignRow], bool]]] = {
    "contact": lambda row: row.contact,
    "margin below 0": lambda row: row.beyond,
    "a limit broken": lambda row: not row.limits_kept,
    "not completed": lambda row: not row.completed,
}
VIOLATIONS: Final = (*_OBSERVED, _UNFLOWN, ANY)


def violates(row: CampaignRow, name: str) -> bool:
    """Whether a flight counts as a violation of a name; one that was not flown always does."""
    if row.error or row.refused:
        return True
    if name == ANY:
        return any(test(row) for test in _OBSERVED.values())
    return name in _OBSERVED and _OBSERVED[name](row)
