"""Write the generated pages again: ``make pages``, or ``python -m docs.pages``."""

from __future__ import annotations

import sys
from pathlib import Path

from docs.pages import failsafes, messages, parameters, requirements, safety_manual, sensors, topics

REFERENCE = Path(__file__).parents[1] / "reference"


def main() -> None:
    """Write all of them."""
    log, sensing = REFERENCE / "flight-log.md", REFERENCE / "sensors.md"
    manual = REFERENCE / "safety-manual.md"
    wrong = requirements.problems(requirements.load(), requirements.shown_by_tests())
    if wrong:
        sys.exit("docs/reference/requirements.toml:\n" + "\n".join(wrong))
    pages = {
        log: topics.inserted(log.read_text(encoding="utf-8")),
        sensing: sensors.inserted(sensing.read_text(encoding="utf-8")),
        REFERENCE / "messages.md": messages.reference(messages.traffic()),
        REFERENCE / "parameters.md": parameters.reference(),
        REFERENCE / "failsafes.md": failsafes.reference(),
        manual: safety_manual.inserted(manual.read_text(encoding="utf-8")),
        REFERENCE / "requirements-traceability.csv": safety_manual.traceability(
            requirements.load(), requirements.shown_by_tests()
        ),
    }
    for page, text in pages.items():
        page.write_text(text, encoding="utf-8")
        print(f"wrote {page.name}")


main()
