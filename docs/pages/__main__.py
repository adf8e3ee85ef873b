"""Write the generated pages again: ``make pages``, or ``python -m docs.pages``."""

from __future__ import annotations

from pathlib import Path

from docs.pages import failsafes, messages, parameters, sensors, topics

REFERENCE = Path(__file__).parents[1] / "reference"


def main() -> None:
    """Write all five."""
    log, sensing = REFERENCE / "flight-log.md", REFERENCE / "sensors.md"
    pages = {
        log: topics.inserted(log.read_text(encoding="utf-8")),
        sensing: sensors.inserted(sensing.read_text(encoding="utf-8")),
        REFERENCE / "messages.md": messages.reference(messages.traffic()),
        REFERENCE / "parameters.md": parameters.reference(),
        REFERENCE / "failsafes.md": failsafes.reference(),
    }
    for page, text in pages.items():
        page.write_text(text, encoding="utf-8")
        print(f"wrote {page.name}")


main()
