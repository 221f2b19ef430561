"""The FMUs' pages and the laboratory's reports in Chromium: on telephones and screens, by day and night."""

from __future__ import annotations

import html
import itertools
import shutil
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib
import pytest
from conftest import ROOT, TARGET, Run
from fontTools.ttLib import TTFont
from playwright.sync_api import Browser, Page

WIDTHS = [360, 390, 1100, 1366, 1536, 1920, 2560]
"""Of telephones and screens, in CSS pixels."""

HEIGHT = 900

LONGEST = 4000
"""Pixels of a page that its picture shows."""

FMUS = ["BoostPlant", "BoostController"]

REPORTS = ["reproduction", "identification", "tuning", "simulation", "system", "study", "sweep"]

LIVE = "live"

LINEAR = "linearization"

PAGES = [*FMUS, *REPORTS, LINEAR, LIVE]

LARGEST = 6e6
"""Bytes of a report."""

PICTURES = TARGET / "pages"

SWEEP = """
scenario = "{scenario}"
[grid]
"plant:valve.time_constant" = {{ from = 0.008, to = 0.08, points = 4 }}
"plant:tank.volume" = [1e-3, 2e-3]
[measures]
least = {{ minimum = "actuator_pressure" }}
most = {{ maximum = "hp_wastegate_position" }}
"""
"""Of two parameters."""

PAPER = 688
"""CSS pixels between the margins of A4."""

INSPECT = (Path(__file__).parent / "inspect.js").read_text()


@pytest.fixture(scope="session")
def files(lab: Run, exported: Path, live: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The pages of the FMUs, a report of each command, and the page that runs them."""
    folder = tmp_path_factory.mktemp("pages")
    files = {}
    for name in FMUS:
        files[name] = folder / f"{name}.html"
        with zipfile.ZipFile(exported / f"{name}.fmu") as archive:
            files[name].write_bytes(archive.read("documentation/index.html"))

    def run(*arguments: str | Path, status: int = 0) -> None:
        done = lab(*arguments)
        assert (done.returncode, done.stderr) == (status, "")

    plant = ["--plant", exported / "BoostPlant.fmu"]
    both = [*plant, "--controller", exported / "BoostController.fmu"]
    steps = ROOT / "crates" / "boost-lab" / "scenarios" / "figure_13.toml"
    bench, plot = folder / "bench.csv", folder / "steps.html"
    run("reproduce", "--fmus", exported, "--out", folder / "reproduction")
    run("simulate", ROOT / "examples" / "actuator_bench.toml", "--fmus", exported, "--out", bench)
    run("identify", "actuator", bench, *plant, "--out", folder / "identification")
    run("tune", *both, "--out", folder / "tuning")
    run("simulate", steps, "--fmus", exported, "--out", folder, "--plot", plot)
    system = folder / "system.html"
    pumping = ["--set", "boost_reference=150 kPa", "--stop-time", "60"]
    run("simulate", exported / "Boost.ssp", *pumping, "--out", folder, "--plot", system)
    linear = folder / f"{LINEAR}.html"
    loop = ["--at", "24", "--path", "hp_wastegate_pwm,boost_pressure", "--loop", "controller:boost_pressure"]
    run("linearize", steps, "--fmus", exported, *loop, "--plot", linear)
    # This strategy fails, so that the report explains cases.
    run("study", *both, "--cases", "4", "--strategy", "by_speed", "--out", folder / "study", status=1)
    sweep = folder / "sweep.toml"
    sweep.write_text(SWEEP.format(scenario=steps.with_name("figure_1.toml")))
    run("sweep", sweep, "--fmus", exported, "--out", folder / "sweep")
    reports = {name: folder / name / "report.html" for name in REPORTS}
    return {**files, **reports, "simulation": plot, "system": system, LINEAR: linear, LIVE: live}


@dataclass
class Visit:
    """A page as it was opened, and what was found at each width."""

    page: Page
    messages: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    found: dict[int, dict[str, Any]] = field(default_factory=dict)

    def open(self, file: Path) -> None:
        self.page.on("console", lambda message: self.messages.append(message.text))
        self.page.on("pageerror", lambda error: self.messages.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(file.as_uri())
        # The figures' script says when it has drawn them.
        self.page.wait_for_function(
            "!document.querySelector('.panel') || document.documentElement.dataset.drawn"
        )

    def at(self, width: int) -> Page:
        """The page in a window of a width."""
        self.page.set_viewport_size({"width": width, "height": HEIGHT})
        # The plots follow the window's size a little later.
        self.page.wait_for_function(
            "[...document.querySelectorAll('.plot')].every("
            "(plot) => Math.abs(plot.clientWidth - plot._fullLayout.width) < 2)"
        )
        return self.page


@pytest.fixture
def opened(browser: Browser, files: dict[str, Path]) -> Iterator[Callable[..., Page]]:
    """Opens a page in a window."""
    contexts = []

    def open_page(name: str, width: int) -> Page:
        contexts.append(browser.new_context(viewport={"width": width, "height": HEIGHT}))
        visit = Visit(contexts[-1].new_page())
        visit.open(files[name])
        return visit.page

    yield open_page
    for context in contexts:
        context.close()


@pytest.fixture(scope="module", params=itertools.product(PAGES, ["light", "dark"]), ids="-".join)
def visit(request: pytest.FixtureRequest, browser: Browser, files: dict[str, Path]) -> Iterator[Visit]:
    """Each page by day and by night, inspected and pictured at each width."""
    name, scheme = request.param
    context = browser.new_context(color_scheme=scheme, viewport={"width": WIDTHS[0], "height": HEIGHT})
    visit = Visit(context.new_page())
    visit.open(files[name])
    # From then on the browser marks what has the focus.
    visit.page.keyboard.press("Tab")
    for width in WIDTHS:
        page = visit.at(width)
        visit.found[width] = page.evaluate(INSPECT)
        page.evaluate("scrollTo(0, 0)")
        length = page.evaluate("document.documentElement.scrollHeight")
        clip = {"x": 0, "y": 0, "width": width, "height": min(length, LONGEST)}
        picture = PICTURES / f"{name}-{scheme}-{width}.jpeg"
        page.screenshot(path=picture, type="jpeg", quality=70, full_page=True, clip=clip)
    yield visit
    context.close()


@pytest.fixture(scope="session", autouse=True)
def sheet(browser: Browser) -> Iterator[None]:
    """Puts all pictures on a sheet."""
    shutil.rmtree(PICTURES, ignore_errors=True)
    PICTURES.mkdir()
    yield
    rows = []
    for name in PAGES:
        pictures = [
            f'<td><img src="{name}-{scheme}-{width}.jpeg" style="width:{60 + width // 6}px"></td>'
            for width in WIDTHS
            for scheme in ["light", "dark"]
        ]
        rows.append(f"<tr><th>{html.escape(name)}</th>{''.join(pictures)}</tr>")
    formulas = [
        f'<td colspan="{len(WIDTHS)}"><img src="{name}-formulas.png" style="width:900px"></td>'
        for name in FMUS
    ]
    rows.append(f"<tr><th>without a font of mathematics</th>{''.join(formulas)}</tr>")
    document = PICTURES / "sheet.html"
    style = "td { vertical-align: top } img { max-height: 900px; object-fit: cover; object-position: top }"
    document.write_text(f"<!DOCTYPE html><style>{style}</style><table>{''.join(rows)}</table>")
    page = browser.new_page(viewport={"width": 2400, "height": 1000})
    page.goto(document.as_uri())
    page.screenshot(path=PICTURES / "sheet.png", full_page=True)


def assert_none(visit: Visit, rule: str) -> None:
    """Nothing was found against a rule, at no width."""
    found = {width: found[rule] for width, found in visit.found.items() if found[rule]}
    assert not found
    # The inspection saw the page.
    assert all(found["texts"] > 20 and found["controls"] > 3 for found in visit.found.values())


def test_nothing_overflows(visit: Visit) -> None:
    assert {width: found["overflow"] for width, found in visit.found.items()} == dict.fromkeys(WIDTHS, 0)


def test_nothing_is_wider_than_its_window(visit: Visit) -> None:
    assert_none(visit, "wide")


def test_no_number_is_broken(visit: Visit) -> None:
    assert_none(visit, "split")


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
    assert found["count"] > (100 if name in FMUS else 1) or name in ["simulation", "system"]


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
    page.wait_for_function(
        "[...document.querySelectorAll('.plot')].every((plot) => plot._fullLayout.width > 200"
        " && Math.abs(plot.clientWidth - plot._fullLayout.width) < 2)"
    )


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


def test_names_break_between_words(visit: Visit) -> None:
    assert_none(visit, "broken")


@pytest.mark.parametrize("name", REPORTS)
def test_report_is_of_moderate_size(files: dict[str, Path], name: str) -> None:
    assert files[name].stat().st_size < LARGEST


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
    page.wait_for_function("document.querySelector('nav [aria-current]')")
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
    page.wait_for_function("document.querySelector('nav li:last-child a[aria-current]')")


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
    """`Pa/%3` and `mm2`, on the page and in a report."""
    page = opened("BoostPlant", 1280)
    coefficients = page.locator("[id='valve.pressure_coefficient'] .unit sup")
    assert coefficients.all_text_contents() == ["3", "2"]
    assert page.locator("[id='valve.tank_area'] .start sup").text_content() == "2"
    raised = opened("identification", 1280).locator("td:has-text('Pa/%') sup")
    assert raised.all_text_contents() == ["3", "2"]


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
    page.wait_for_function(f"{shown}.includes(false)")
    page.keyboard.press("Space")
    page.wait_for_function(f"!{shown}.includes(false)")

    page.locator(".plot").first.locator("[data-title='Zoom in']").focus()
    page.keyboard.press("Enter")
    page.wait_for_function(f"JSON.stringify({ranges}) != '{str(whole).replace(' ', '')}'")
    page.wait_for_function(f"new Set({ranges}.map(String)).size == 1")
    page.locator(".plot").last.locator("[data-title='Reset axes']").focus()
    page.keyboard.press("Enter")
    page.wait_for_function(f"JSON.stringify({ranges}) == '{str(whole).replace(' ', '')}'")


def test_figures_follow_the_colour_scheme_and_keep_what_is_switched_off(opened: Callable[..., Page]) -> None:
    page = opened("simulation", 1280)
    drawn = "document.querySelector('.plot .main-svg text').style.fill"
    day = page.evaluate(drawn)
    page.locator(".legend input").first.uncheck()
    page.emulate_media(color_scheme="dark")
    page.wait_for_function(f"{drawn} != '{day}'")
    assert page.evaluate("document.querySelector('.plot').data[0].visible") is False


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
