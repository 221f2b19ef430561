"""How pages and reports are used: links, contents, search, keyboard, touch, print."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import matplotlib
import pytest
from fontTools.ttLib import TTFont
from playwright.sync_api import Browser, Page

from fmu.pages.visit import FMUS, HEIGHT, LIVE, PICTURES, REPORTS, Visit
from fmu.pages.waiting import wait_for

pytestmark = pytest.mark.browser

pytest_plugins = ["fmu.pages.opening"]

PAPER = 688
"""CSS pixels between the margins of A4."""


COVERED = """() => {
  const links = [...document.querySelectorAll("a[href^='#']")];
  const ids = links.map((link) => decodeURIComponent(link.getAttribute("href").slice(1)));
  const targets = ids.map((id) => document.getElementById(id));
  const shown = [...new Set(targets)].filter((target) => target?.checkVisibility());
  return { count: shown.length, covered: shown.filter((target) => {
    target.scrollIntoView();
    const { left, top } = target.getBoundingClientRect();
    const found = document.elementFromPoint(left + 2, Math.min(top + 2, innerHeight - 1));
    return !target.contains(found) && !found?.contains(target);
  }).map((target) => target.id) };
}"""


@pytest.mark.parametrize("width", [390, 1100, 1366])
@pytest.mark.parametrize("name", [*FMUS, *REPORTS])
def test_no_target_of_a_link_is_covered(opened: Callable[..., Page], name: str, width: int) -> None:
    """Neither by the contents nor by the filter of variables."""
    found = opened(name, width).evaluate(COVERED)
    assert found["covered"] == []
    assert found["count"] > (100 if name in FMUS else 1) or name in ["simulation", "system", "comparison"]


@pytest.mark.parametrize("width", [1366, 1920, 2560])
def test_plots_fill_the_window(opened: Callable[..., Page], width: int) -> None:
    page = opened("system", width)
    widths = page.evaluate("[...document.querySelectorAll('.plot')].map((plot) => plot._fullLayout.width)")
    # Without the page's margins.
    assert min(widths) > width - 60


def test_states_have_lanes_and_constants_a_text(opened: Callable[..., Page]) -> None:
    page = opened("system", 1366)
    lanes = "[...document.querySelectorAll('.plot')].at(-1).data.map(({ type, name }) => [type, name])"
    assert ["bar", "vacuum_pump"] in page.evaluate(lanes)
    note = page.locator("figure .caption").text_content()
    assert note.startswith("Constant: ")
    assert "ambient_temperature 24.9\u202f\u00b0C" in note
    # Each line has a name, each axis its unit.
    units = page.evaluate(
        "[...document.querySelectorAll('.plot')].map((plot) => plot.layout.yaxis.title?.text)"
    )
    assert {"kPa", "%", "g/s", "°C"} <= set(units)
    assert None not in units[:-1]


@pytest.mark.parametrize("width", [390, 1536, 2560])
@pytest.mark.parametrize("name", [*REPORTS, LIVE])
def test_plots_fit_on_paper(opened: Callable[..., Page], name: str, width: int) -> None:
    """Whatever the window's width; and none is divided between pages."""
    page = opened(name, width)
    # After what the page does before it is printed.
    page.evaluate(
        """addEventListener("beforeprint", () => {
          globalThis.printed = [...document.querySelectorAll(".plot")].map((plot) => plot._fullLayout.width);
        })"""
    )
    page.pdf(path=PICTURES / f"{name}-{width}.pdf", format="A4")
    printed = page.evaluate("printed")
    assert len(printed) > 1
    assert max(printed) <= PAPER < sum(printed)
    page.emulate_media(media="print")
    apart = "[...document.querySelectorAll('.row, .panel')].map((part) => getComputedStyle(part).breakInside)"
    assert set(page.evaluate(apart)) == {"avoid"}
    # The window gets its plots back.
    page.emulate_media(media="screen")
    wait_for(
        page,
        "[...document.querySelectorAll('.plot')].every((plot) => plot._fullLayout.width > 200"
        " && Math.abs(plot.clientWidth - plot._fullLayout.width) < 2)",
    )


@pytest.mark.parametrize("name", ["BoostPlant", "identification"])
def test_contents_fold_on_telephones_and_mark_the_section(opened: Callable[..., Page], name: str) -> None:
    page = opened(name, 360)
    entries = page.locator("nav li a")
    assert not entries.first.is_visible()
    page.locator("nav summary").focus()
    page.keyboard.press("Enter")
    assert entries.first.is_visible()
    # The second section, by keyboard.
    for _ in range(2):
        page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    assert not entries.first.is_visible()
    chosen = entries.nth(1)
    target = chosen.get_attribute("href")
    wait_for(page, "document.querySelector('nav [aria-current]')")
    assert page.url.endswith(target)
    assert page.locator("nav [aria-current]").get_attribute("href") == target
    assert page.locator("nav summary span").text_content() == chosen.text_content()
    # The bar with the contents stands above the section's heading.
    bar, heading = (
        page.locator(part).bounding_box() for part in ("nav summary", f"{target} >> visible=true")
    )
    assert 0 <= bar["y"] < 5
    assert bar["y"] + bar["height"] <= heading["y"] < HEIGHT / 3

    page.set_viewport_size({"width": 1280, "height": HEIGHT})
    assert entries.first.is_visible()
    page.keyboard.press("End")
    wait_for(page, "document.querySelector('nav li:last-child a[aria-current]')")


@pytest.mark.parametrize("name", FMUS)
def test_page_begins_with_figures(opened: Callable[..., Page], name: str) -> None:
    """The diagram and a response, before the facts."""
    page = opened(name, 1280)
    facts = page.locator(".facts").bounding_box()["y"]
    assert [figure.bounding_box()["y"] < facts for figure in page.locator("figure").all()[:2]] == [True, True]


def test_search_counts_and_names_what_is_not_found(opened: Callable[..., Page]) -> None:
    page = opened("BoostPlant", 1280)
    page.locator("#page-filter input").focus()
    page.keyboard.type("tank pressure")
    rows = page.locator("table.variables tr[id] >> visible=true")
    found = rows.count()
    assert 1 < found < 40
    assert page.locator("#page-filter output").text_content().startswith(f"{found} of ")
    page.keyboard.type(" nowhere")
    assert rows.count() == 0
    said = page.locator("#page-filter output")
    assert said.is_visible()
    assert "tank pressure nowhere" in said.text_content()
    assert said.text_content().startswith("None of ")


def test_axes_of_a_sweep_have_display_units(files: dict[str, Path]) -> None:
    """The volume is in m³, its display unit is l."""
    page = files["sweep"].read_text()
    assert "plant:tank.volume (l)" in page
    assert "2 values from 1\u202fl to 2\u202fl" in page


def test_exponents_of_units_are_raised(opened: Callable[..., Page]) -> None:
    """`N/m7` and `mm2`, on the page and in a report."""
    page = opened("BoostPlant", 1280)
    assert page.locator("[id='actuator.spring_hardening'] .unit sup").text_content() == "7"
    assert page.locator("[id='valve.tank_area'] .start sup").text_content() == "2"
    raised = opened("identification", 1280).locator("td:has-text('N/m7') sup")
    assert raised.all_text_contents() == ["7"]


def test_figures_are_served_by_keyboard(opened: Callable[..., Page]) -> None:
    """Lines are switched off, axes zoomed and reset, and linked axes follow."""
    page = opened("simulation", 1280)
    ranges = "[...document.querySelectorAll('.plot')].map((plot) => plot.layout.xaxis.range.map(Math.round))"
    whole = page.evaluate(ranges)
    assert len(whole) > 2
    assert len({tuple(each) for each in whole}) == 1

    box = page.locator(".legend input").first
    shown = "document.querySelector('.plot').data.map((line) => line.visible)"
    box.focus()
    page.keyboard.press("Space")
    wait_for(page, f"{shown}.includes(false)")
    page.keyboard.press("Space")
    wait_for(page, f"!{shown}.includes(false)")

    page.locator(".plot").first.locator("[data-title='Zoom in']").focus()
    page.keyboard.press("Enter")
    wait_for(page, f"JSON.stringify({ranges}) != '{str(whole).replace(' ', '')}'")
    wait_for(page, f"new Set({ranges}.map(String)).size == 1")
    page.locator(".plot").last.locator("[data-title='Reset axes']").focus()
    page.keyboard.press("Enter")
    wait_for(page, f"JSON.stringify({ranges}) == '{str(whole).replace(' ', '')}'")


def test_figures_follow_the_colour_scheme_and_keep_what_is_switched_off(opened: Callable[..., Page]) -> None:
    page = opened("simulation", 1280)
    drawn = "document.querySelector('.plot .main-svg text').style.fill"
    day = page.evaluate(drawn)
    page.locator(".legend input").first.uncheck()
    page.emulate_media(color_scheme="dark")
    wait_for(page, f"{drawn} != '{day}'")
    assert page.evaluate("document.querySelector('.plot').data[0].visible") is False


def test_figures_are_saved_as_png(opened: Callable[..., Page]) -> None:
    page = opened("simulation", 1280)
    with page.expect_download() as download:
        page.locator(".plot").first.locator("[data-title='Download plot as a PNG']").click()
    assert download.value.path().read_bytes().startswith(b"\x89PNG")


TOOLBARS = """() => {
  const isShown = (bar) => bar.checkVisibility({ opacityProperty: true });
  const bars = [...document.querySelectorAll(".modebar")].filter(isShown);
  const covered = bars.flatMap((bar) => {
    const tools = bar.getBoundingClientRect();
    const texts = [...bar.closest(".panel").querySelectorAll(".title, .legend label")];
    return texts.filter((text) => {
      const box = text.getBoundingClientRect();
      return box.bottom > tools.top && box.right > tools.left && box.left < tools.right;
    }).map((text) => text.textContent);
  });
  return { panels: document.querySelectorAll(".panel").length, bars: bars.length, covered };
}"""


@pytest.mark.parametrize("width", [360, 820, 1280])
@pytest.mark.parametrize("name", [*REPORTS, LIVE])
def test_toolbars_cover_no_text_without_a_pointer_that_hovers(
    browser: Browser, files: dict[str, Path], name: str, width: int
) -> None:
    """On touch screens each plot always shows its tools; on paper none does."""
    context = browser.new_context(viewport={"width": width, "height": HEIGHT}, has_touch=True, is_mobile=True)
    visit = Visit(context.new_page())
    visit.open(files[name])
    found = visit.page.evaluate(TOOLBARS)
    assert found["bars"] == found["panels"] > 0
    assert found["covered"] == []
    visit.page.screenshot(path=PICTURES / f"{name}-touch-{width}.jpeg", type="jpeg", quality=70)
    visit.page.emulate_media(media="print")
    assert visit.page.evaluate(TOOLBARS)["bars"] == 0
    context.close()


DEJAVU = [
    Path(matplotlib.get_data_path(), "fonts", "ttf", f"DejaVu{name}.ttf")
    for name in ["Sans", "Sans-Bold", "SansMono", "SansMono-Bold", "Serif", "Serif-Bold"]
]
"""The fonts of Debian's fonts-dejavu-core: none of mathematics."""


@pytest.fixture(scope="session")
def plain(launch: Callable[..., Browser], tmp_path_factory: pytest.TempPathFactory) -> Browser:
    """A browser on a system that has DejaVu alone."""
    folder = tmp_path_factory.mktemp("fonts")
    for font in DEJAVU:
        shutil.copy(font, folder)
    configuration = folder / "fonts.conf"
    configuration.write_text(
        f"<fontconfig><dir>{folder}</dir><cachedir>{folder}/cache</cachedir></fontconfig>"
    )
    return launch(FONTCONFIG_FILE=str(configuration))


BRACKETS = """() => {
  // What stands between an opening bracket and its closing one, in the same row.
  const within = (bracket) => {
    const content = [];
    let depth = 1;
    for (let next = bracket.nextElementSibling; next && depth; next = next.nextElementSibling) {
      depth += { "(": 1, ")": -1 }[next.textContent] ?? 0;
      content.push(next);
    }
    return content;
  };
  const brackets = [...document.querySelectorAll("mo")].filter((mo) => mo.textContent === "(");
  const isTall = (each) => each.matches("mfrac, mtable") || each.querySelector("mfrac, mtable");
  const tall = brackets.filter((mo) => within(mo).some(isTall));
  return { count: brackets.length, tall: tall.map((mo) => mo.parentElement.textContent),
    braces: [...document.querySelectorAll("mo")].filter((mo) => "{}⏟⏞".includes(mo.textContent)).length };
}"""

SUBSCRIPTS = """() => ["x", "p", "T", "Π", "c"].map((base) => {
  const math = document.querySelector("main math").cloneNode();
  math.innerHTML = `<mi>x</mi><msub><mi>${base}</mi><mi>x</mi></msub>`;
  document.querySelector("main").append(math);
  const [before, script] = [math.firstElementChild, math.querySelector("msub").lastElementChild];
  const [one, other] = [before, script].map((element) => element.getBoundingClientRect().bottom);
  return (other - one) / parseFloat(getComputedStyle(before).fontSize);
})"""


@pytest.mark.parametrize("name", FMUS)
def test_formulas_read_well_without_a_font_of_mathematics(
    plain: Browser, files: dict[str, Path], name: str
) -> None:
    page = plain.new_page(viewport={"width": 1280, "height": HEIGHT})
    page.goto(files[name].as_uri())
    # The letters of mathematics in italics, to which browsers change identifiers by default, are in no other
    # font.
    assert page.evaluate("getComputedStyle(document.querySelector('mi')).textTransform") == "none"
    texts = page.locator("math").all_text_contents()
    known = {letter for font in DEJAVU for letter in TTFont(font).getBestCmap()}
    letters = {letter for text in texts for letter in text if not letter.isspace()}
    assert {letter for letter in letters if ord(letter) not in known} == set()
    assert len(texts) > 30

    # Brackets and braces do not grow.
    brackets = page.evaluate(BRACKETS)
    assert brackets["count"] > 20
    assert (brackets["tall"], brackets["braces"]) == ([], 0)

    # Each subscript is a quarter of the font's size lower, whatever its base.
    assert page.evaluate(SUBSCRIPTS) == pytest.approx([0.25] * 5, abs=0.05)

    y = page.locator("#model-elements, #model-schedule").bounding_box()["y"]
    clip = {"x": 0, "y": y, "width": 1280, "height": 2500}
    page.screenshot(path=PICTURES / f"{name}-formulas.png", full_page=True, clip=clip)
