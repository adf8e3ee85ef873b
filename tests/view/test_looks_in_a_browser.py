"""Pages on a phone, in the dark and on paper, in a real browser; `make test-long` runs it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from command_line.html_page import document, table
from docs.figures.browser import LETTER_IN, Page, page
from docs.figures.pages import DESKTOP_PX, PHONE_PX
from docs.figures.view import shown_in_browser
from pandion.report import write_report
from tests.view import flights
from tests.view.browsing import IN_A_BROWSER

pytestmark = IN_A_BROWSER
DRAWN = "document.body && document.body.dataset.drawn"
# Pairs of texts of a figure that lie over each other: numbers of events, and what legends say.
OVERLAPS = """(() => {
  const found = [];
  for (const chart of document.querySelectorAll('.chart')) {
    const boxes = [...chart.querySelectorAll('.annotation, .legendtext')].filter(
      one => one.style.visibility !== 'hidden').map(one => one.getBoundingClientRect());
    boxes.forEach((a, k) => boxes.slice(k + 1).forEach(b => {
      if (a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1 &&
          b.top < a.bottom - 1) found.push(chart.id);
    }));
  }
  return found;
})()"""


@pytest.fixture(scope="module", params=[False, True], ids=["light", "dark"])
def on_a_phone(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Page]:
    folder = tmp_path_factory.mktemp("flown")
    report = write_report([flights.write_flight(folder / "flown")], folder / "report.html")
    with page(*PHONE_PX, phone=True, dark=request.param) as browser:
        browser.open(report.as_uri())
        browser.wait_for(DRAWN, 120.0)
        yield browser


def value_of_background(browser: Page) -> str:
    return str(browser.value("getComputedStyle(document.body).backgroundColor"))


def test_a_report_on_a_phone_is_as_wide_as_it_and_keeps_its_axes(on_a_phone: Page) -> None:
    assert on_a_phone.value("document.documentElement.scrollWidth") == PHONE_PX[0]
    assert on_a_phone.value(OVERLAPS) == []
    height = on_a_phone.value("document.getElementById('margins')._fullLayout._size.h")
    assert height > 180.0, "the legend has taken the axes' room"


def test_no_table_of_a_report_is_cut_on_a_screen(tmp_path: Path) -> None:
    report = write_report([flights.write_flight(tmp_path / "flown")], tmp_path / "report.html")
    with page(*DESKTOP_PX) as browser:
        browser.open(report.as_uri())
        browser.wait_for(DRAWN, 120.0)
        cut = "[...document.querySelectorAll('table')].filter(e => e.scrollWidth > e.clientWidth)"
        assert browser.value(f"{cut}.length") == 0


def test_a_number_of_the_table_of_events_is_not_cut_in_two(on_a_phone: Page) -> None:
    lines = on_a_phone.value(
        "[...document.querySelectorAll('table.events td:nth-child(-n+3)')].map(cell => {"
        "const text = document.createRange(); text.selectNodeContents(cell);"
        "return text.getClientRects().length; })"
    )
    assert set(lines) == {1}


def test_what_is_printed_has_no_dark_colours_and_the_width_of_paper(
    on_a_phone: Page, tmp_path: Path
) -> None:
    on_a_phone.value(
        "window.addEventListener('beforeprint', () => { window.printed = "
        "[...document.querySelectorAll('.chart')].map(e => e._fullLayout.paper_bgcolor + ' ' + "
        "Math.round((e.style.zoom || 1) * e._fullLayout.width)) })"
    )
    on_a_phone.print_to(tmp_path / "page.pdf", LETTER_IN)
    printed = on_a_phone.value("window.printed")
    assert printed
    assert set(printed) == {"#fff 680"}


def test_every_page_fits_a_phone_and_is_dark_where_that_is_asked_for(tmp_path: Path) -> None:
    rows = [["a word or two"] * 13]
    file = tmp_path / "page.html"
    file.write_text(document("wide", [table(["word"] * 13, rows)]), encoding="utf-8")
    with page(*PHONE_PX, phone=True, dark=True) as browser:
        browser.open(file.as_uri())
        browser.wait_for("document.readyState === 'complete'")
        assert browser.value("document.documentElement.scrollWidth") == PHONE_PX[0]
        assert value_of_background(browser) == "rgb(13, 17, 23)"


def test_a_flight_on_a_dark_phone_has_its_panel_below_the_scene(tmp_path: Path) -> None:
    flown = flights.write_flight(tmp_path / "flown")
    with shown_in_browser(flown, *PHONE_PX, phone=True, dark=True) as (browser, _, _):
        scheme = browser.value("document.documentElement.dataset.mantineColorScheme")
        assert scheme == "dark"
        left, top, right = browser.value(
            "(() => { const e = document.querySelector('[data-pandion=now]')"
            ".closest('.mantine-Paper-root').getBoundingClientRect();"
            "return [e.left, e.top, e.right]; })()"
        )
        assert (left, right) == (0, PHONE_PX[0])
        assert top > 0.5 * PHONE_PX[1]
