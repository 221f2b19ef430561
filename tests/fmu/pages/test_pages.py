"""How the FMUs' pages and the laboratory's reports look on telephones and screens, by day and by night."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from fmu.pages.visit import HEIGHT, PAGES, PICTURES, REPORTS, Visit
from fmu.report import Report

pytestmark = pytest.mark.browser

pytest_plugins = ["fmu.pages.opening"]

WIDTHS = [360, 390, 1100, 1366, 1536, 1920, 2560]
"""Of telephones and screens, in CSS pixels."""

PICTURED = [360, 1366, 2560]
"""Of these widths, one of a telephone and two of screens, there are pictures to look at. By night, when only
colors are others, pages are inspected at these."""

FITTING = ["comparison", "identification", "study", "sweep"]
"""Whose tables are no matrices, and have short cells."""

LONGEST = 4000
"""Pixels of a page that its picture shows."""

LARGEST = 2.5e6
"""Bytes of a report."""

INSPECT = (Path(__file__).parent / "inspect.js").read_text()


@pytest.fixture(scope="module", params=itertools.product(PAGES, ["light", "dark"]), ids="-".join)
def visit(request: pytest.FixtureRequest, browser: Browser, files: dict[str, Path]) -> Iterator[Visit]:
    """Each page, by day inspected at each width, and by night."""
    name, scheme = request.param
    context = browser.new_context(color_scheme=scheme, viewport={"width": WIDTHS[0], "height": HEIGHT})
    visit = Visit(context.new_page())
    visit.open(files[name])
    # From then on the browser marks what has the focus.
    visit.page.keyboard.press("Tab")
    for width in WIDTHS if scheme == "light" else PICTURED:
        page = visit.at(width)
        visit.found[width] = page.evaluate(INSPECT)
        if width not in PICTURED:
            continue
        page.evaluate("scrollTo(0, 0)")
        length = page.evaluate("document.documentElement.scrollHeight")
        clip = {"x": 0, "y": 0, "width": width, "height": min(length, LONGEST)}
        picture = PICTURES / f"{name}-{scheme}-{width}.jpeg"
        page.screenshot(path=picture, type="jpeg", quality=70, full_page=True, clip=clip)
    yield visit
    context.close()


def assert_none(visit: Visit, rule: str) -> None:
    """Nothing was found against a rule, at no width."""
    found = {width: found[rule] for width, found in visit.found.items() if found[rule]}
    assert not found
    # The inspection saw the page.
    assert len(visit.found) >= len(PICTURED)
    assert all(found["texts"] > 20 and found["controls"] > 3 for found in visit.found.values())


def test_nothing_overflows(visit: Visit) -> None:
    assert_none(visit, "overflow")


def test_nothing_is_wider_than_its_window(visit: Visit) -> None:
    assert_none(visit, "wide")


def test_no_number_is_broken(visit: Visit) -> None:
    assert_none(visit, "split")


def test_nothing_is_reported_on_the_console_or_loaded(visit: Visit) -> None:
    assert visit.messages == []
    assert visit.requests == [visit.page.url]


def test_texts_contrast_with_their_ground(visit: Visit) -> None:
    """4.5:1, what WCAG 2.1 asks of texts (1.4.3)."""
    assert_none(visit, "faint")


def test_texts_are_legible(visit: Visit) -> None:
    """10 pixels at least, also in figures."""
    assert_none(visit, "small")


def test_controls_are_reached_by_keyboard_and_marked(visit: Visit) -> None:
    assert_none(visit, "unreachable")
    assert_none(visit, "unmarked")


def test_cut_lines_show_that_they_scroll(visit: Visit) -> None:
    assert_none(visit, "cut")


def test_cells_contain_their_texts(visit: Visit) -> None:
    assert_none(visit, "clipped")


@pytest.mark.parametrize("visit", [("tuning", "light")], ids="-".join, indirect=True)
def test_maps_are_whole_on_screens(visit: Visit) -> None:
    found = {width: found["scrolled"] for width, found in visit.found.items()}
    assert found[390]
    assert not any(scrolled for width, scrolled in found.items() if width >= 1100), found


@pytest.mark.parametrize("visit", itertools.product(FITTING, ["light"]), ids="-".join, indirect=True)
def test_tables_fit_their_window(visit: Visit) -> None:
    assert_none(visit, "scrolled")


def test_names_break_between_words(visit: Visit) -> None:
    assert_none(visit, "broken")


@pytest.mark.parametrize("name", REPORTS)
def test_report_needs_no_other_file(files: dict[str, Path], name: str) -> None:
    """It fetches nothing, has no name twice, and fits into 2.5 MB."""
    report = Report(files[name])
    assert report.loads == []
    assert "@import" not in report.text
    assert "://" not in report.text.replace("http://www.w3.org/2000/svg", "")
    assert len(report.names) == len(set(report.names))
    assert report.size < LARGEST
