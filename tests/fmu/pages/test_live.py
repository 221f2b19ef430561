"""The page that runs both FMUs in a browser: its controls, and its experiments against the laboratory's."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page

from fmu import ROOT, TARGET, Run
from fmu.pages.picture import take
from fmu.pages.waiting import wait_for
from fmu.report import Report

pytestmark = pytest.mark.browser

SCENARIOS = ROOT / "boost" / "lab" / "scenarios"

PICTURES = TARGET / "live"


LARGEST_PICTURE = 150e3
"""Bytes of the picture in the documents."""

LARGEST_PAGE = 4e6
"""Bytes."""

SIZES = [(390, 844), (1100, 768), (1366, 768), (1536, 864), (1920, 1080), (2560, 1440)]
"""Of windows: a telephone, and usual screens."""


def visit(browser: Browser, live: Path, messages: list[str], settings: str = "", **options: object) -> Page:
    """Opens the page, with settings in its address; its console and errors go to a list."""
    page = browser.new_context(viewport={"width": 1280, "height": 900}, **options).new_page()
    page.on("console", lambda message: messages.append(message.text))
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.goto(live.as_uri() + settings)
    wait_for(page, "globalThis.live?.run")
    return page


@pytest.fixture
def opened(browser: Browser, live: Path) -> Iterator[Page]:
    """The page, its loop running."""
    messages: list[str] = []
    page = visit(browser, live, messages)
    yield page
    page.context.close()
    assert messages == []


@pytest.fixture(scope="module")
def still(browser: Browser, live: Path) -> Iterator[Page]:
    """The page where less motion is asked for: it waits to be run."""
    messages: list[str] = []
    page = visit(browser, live, messages, reduced_motion="reduce")
    assert page.evaluate("live.run.now") == 0
    assert "reduced motion" in page.locator("#status").text_content()
    yield page
    page.context.close()
    assert messages == []


@pytest.fixture
def paused(still: Page) -> Page:
    """The page with its defaults, its loop at the start."""
    still.set_viewport_size({"width": 1280, "height": 900})
    still.locator("#defaults").click()
    restart(still)
    assert still.evaluate("live.run.now") == 0
    return still


def restart(page: Page) -> None:
    """Restarts the loop, and waits for it."""
    page.evaluate("live.run.isOld = true")
    page.locator("#reset").click()
    wait_for(page, "live.run && !live.run.isOld")


def run(page: Page, steps: int) -> None:
    """Steps the loop of a page that is paused."""
    page.evaluate("(steps) => { for (let i = 0; i < steps; i += 1) live.run.step(); }", steps)


def wait_for_drawing(page: Page) -> None:
    """Until all plots show the loop's present; the engine and the values are drawn in the same frame."""
    wait_for(
        page,
        "[...document.querySelectorAll('.plot')]"
        ".every(({ data }) => data[0].x.at(-1) === live.run.time.at(-1))",
    )


def value(page: Page, name: str) -> float:
    """The last recorded value."""
    return page.evaluate("(name) => live.run.columns.get(name).at(-1)", name)


MEASURE = (Path(__file__).parent / "measure.js").read_text()

DRIVES = ["boost_reference", "engine_speed", "supply_voltage", "throttle"]


def measured(page: Page, width: int, height: int) -> dict[str, Any]:
    """What is in the first view of a window, and what does not fit it."""
    page.set_viewport_size({"width": width, "height": height})
    # The plots follow the window's size a little later.
    wait_for(
        page,
        "[...document.querySelectorAll('.plot')].every("
        "(plot) => Math.abs(plot.clientWidth - plot._fullLayout.width) < 2)",
    )
    page.evaluate("scrollTo(0, 0)")
    found = page.evaluate(MEASURE)
    assert found["texts"] > 150
    return found


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_fits_its_window(paused: Page, width: int, height: int) -> None:
    """No element is wider, no number breaks, and no text of the drawing lies over another or over the edge of
    a part, after some seconds with both cursors."""
    run(paused, 400)
    for index, time in enumerate(["1", "4.2625"]):
        paused.locator("#cursors input").nth(index).fill(time)
        paused.locator("#cursors input").nth(index).press("Enter")
    wait_for_drawing(paused)
    wait_for(
        paused, "[...document.querySelectorAll('.plot')].every(({ layout }) => layout.shapes?.length === 2)"
    )
    found = measured(paused, width, height)
    paused.screenshot(path=PICTURES / f"loop-{width}.png")
    # There is something to measure: some twenty texts in the narrowest window.
    assert found["drawn"] > 10
    assert (found["wide"], found["broken"], found["crossing"]) == ([], [], [])
    for index in range(2):
        paused.locator("#cursors input").nth(index).fill("")
        paused.locator("#cursors input").nth(index).press("Enter")


def test_slider_and_answer_are_in_one_view(paused: Page) -> None:
    """On a telephone boost's slider and plot, on screens what drives and the plots of boost and duty, from
    1366 pixels on the engine, too; wider windows show more plots."""
    found = {size[0]: measured(paused, *size) for size in SIZES}
    assert "boost_reference" in found[390]["others"]
    assert "Boost pressure" in found[390]["plots"]
    for width in [1100, 1366, 1536, 1920, 2560]:
        assert {"Boost pressure", "HP wastegate PWM"} <= set(found[width]["plots"]), width
        assert set(DRIVES) <= set(found[width]["others"]), width
        assert width == 1100 or "engine" in found[width]["others"], width
    ticks = [text for text in paused.locator(".xtick").all_text_contents() if text]
    assert ticks != []
    assert all(text.endswith(" s") for text in ticks)
    counts = [len(found[width]["plots"]) for width in [1366, 1920, 2560]]
    assert counts[0] < counts[1] < counts[2]


def test_page_is_of_moderate_size(live: Path) -> None:
    assert live.stat().st_size < LARGEST_PAGE


SLIDERS = [
    ("boost_reference", "boost_pressure"),
    ("engine_speed", "air_mass_flow"),
    ("throttle", "engine_torque"),
    ("supply_voltage", "hp_wastegate_pwm"),
    ("ambient_pressure", "air_mass_flow"),
]


def test_sliders_act(paused: Page) -> None:
    """From the least to the greatest of each, by keyboard; what follows changes by a tenth at least."""
    for slider, follows in SLIDERS:
        values = []
        begin = paused.locator(f"#{slider}").input_value()
        for key in ("Home", "End"):
            paused.locator(f"#{slider}").press(key)
            run(paused, 400)
            values.append(value(paused, follows))
        assert max(values) > 1.1 * min(values), slider
        # The field beside it has the same value.
        field = paused.locator(f".control:has(#{slider}) input[type=number]")
        assert field.input_value() == paused.locator(f"#{slider}").input_value()
        paused.locator(f"#{slider}").fill(begin)


def response(page: Page) -> float:
    """Boost pressure (Pa) 0.5 s after a step of its reference from 125 to 135 kPa."""
    run(page, 80)
    page.locator("#boost_reference").fill("135")
    run(page, 40)
    return value(page, "boost_pressure")


def test_reference_lambda_acts_and_stays_after_reset(paused: Page) -> None:
    quick = response(paused)
    paused.locator("#reference_lambda").press("End")
    paused.locator("#boost_reference").fill("125")
    paused.locator("#reset").click()
    wait_for(paused, "live.run?.now === 0")
    # 1.2 s in place of 0.48 s, in two lags of which the second has 0.16 s: after 0.5 s 28 % of the step, in
    # place of 62 %; half of the difference, since delays take of both.
    assert response(paused) < quick - 1.8e3


def test_compensation_acts(paused: Page) -> None:
    paused.locator("#supply_voltage").fill("10")
    run(paused, 80)
    compensated = value(paused, "hp_wastegate_pwm")
    paused.locator("#compensate_voltage").press("Space")
    run(paused, 1)
    # 12 V over 10 V.
    assert compensated / value(paused, "hp_wastegate_pwm") == pytest.approx(1.2, rel=0.02)


def test_each_plant_restarts_and_differs(paused: Page) -> None:
    assert value(paused, "boost_reference") == 125e3
    plants = [option.get_attribute("value") for option in paused.locator("#plant option").all()]
    assert len(plants) == 1 + len(
        [file for file in ROOT.glob("parameters/*.ssv") if "paper" not in file.stem]
    )
    begins = set()
    for plant in plants:
        if plant == plants[0]:
            restart(paused)
        else:
            paused.evaluate("live.run.isOld = true")
            paused.locator("#plant").select_option(plant)
            wait_for(paused, "live.run && !live.run.isOld")
        paused.locator("#boost_reference").fill("150")
        run(paused, 80)
        begins.add(paused.evaluate("live.run.columns.get('hp_turbo_speed').join()"))
        paused.locator("#boost_reference").fill("125")
    assert len(begins) == len(plants)


def test_field_takes_what_the_fmu_declares(paused: Page) -> None:
    """A value outside, and a cleared field, are refused where they are typed."""
    control = paused.locator(".control:has(#supply_voltage)")
    field, note = control.locator("input[type=number]"), control.locator("small")
    assert [field.get_attribute(limit) for limit in ("min", "max")] == ["0", "32"]
    field.fill("5")
    field.press("Enter")
    for refused in ["50", "-1", ""]:
        field.fill(refused)
        field.press("Enter")
        assert (field.input_value(), field.get_attribute("aria-invalid")) == ("5", "true"), refused
        assert "outside 0 to 32 V" in note.text_content()
        assert note.bounding_box()["height"] > 10
        run(paused, 1)
        assert value(paused, "supply_voltage") == 5
    field.fill("6")
    field.press("Enter")
    assert field.get_attribute("aria-invalid") == "false"
    run(paused, 1)
    assert value(paused, "supply_voltage") == 6


def test_temperature_faults_and_strategy_act(paused: Page) -> None:
    warm = paused.locator("#ambient_temperature").input_value()
    paused.locator("#ambient_temperature").press("Home")
    run(paused, 400)
    assert value(paused, "ambient_temperature") == 248.15
    cold = value(paused, "air_mass_flow")
    restart(paused)
    assert paused.evaluate("live.run.signals.get('ambient_temperature').constant") == 248.15
    paused.locator("#ambient_temperature").fill(warm)
    run(paused, 400)
    assert value(paused, "air_mass_flow") < 0.98 * cold

    paused.get_by_text("Faults", exact=True).click()
    paused.locator("[id='fault.wastegate_stuck']").check()
    paused.locator("[id='fault.wastegate_stuck_position']").press("End")
    run(paused, 1)
    assert value(paused, "hp_wastegate_position") == 1
    restart(paused)
    run(paused, 1)
    assert value(paused, "hp_wastegate_position") == 1
    paused.locator("[id='fault.wastegate_stuck']").uncheck()
    run(paused, 1)
    assert value(paused, "hp_wastegate_position") < 1
    paused.get_by_text("Faults", exact=True).click()

    # At 2800 rpm one strategy shares the stages, the other bypasses none yet.
    openings = set()
    paused.locator(".control:has(#engine_speed) input[type=number]").fill("2800")
    paused.keyboard.press("Enter")
    for strategy in ["split_range", "by_speed"]:
        paused.evaluate("live.run.isOld = true")
        paused.locator("#strategy").select_option(strategy)
        if strategy == "split_range":
            restart(paused)
        wait_for(paused, "live.run && !live.run.isOld")
        run(paused, 400)
        openings.add(value(paused, "lp_wastegate"))
    assert len(openings) == 2


def test_address_has_the_settings(browser: Browser, live: Path, paused: Page) -> None:
    """What is changed, as it is displayed; a page that is opened there has them."""
    assert paused.evaluate("location.hash") == ""
    paused.locator("#boost_reference").fill("150")
    paused.locator("#compensate_voltage").uncheck()
    paused.locator("#strategy").select_option("by_speed")
    paused.locator("#pace").select_option("10")
    paused.locator(".control:has(#ambient_temperature) input[type=number]").fill("-10")
    paused.keyboard.press("Enter")
    address = paused.evaluate("location.hash")
    names = [
        "boost_reference=150",
        "strategy=by_speed",
        "ambient_temperature=-10",
        "compensate_voltage=off",
        "pace=10",
    ]
    assert sorted(address[1:].split("&")) == sorted(names)
    messages: list[str] = []
    other = visit(browser, live, messages, f"{address}&throttle=7&nothing=1", reduced_motion="reduce")
    run(other, 1)
    assert [value(other, name) for name in ("boost_reference", "ambient_temperature")] == [150e3, 263.15]
    # A value outside, which is said, and an unknown name change nothing.
    assert value(other, "throttle") == 1
    assert "Kept: 7 is outside" in (other.locator("#throttle-note").text_content() or "")
    assert other.evaluate(
        "[pace, strategy, compensate_voltage.checked].map((each) => each.value ?? each)"
    ) == [
        "10",
        "by_speed",
        False,
    ]
    # Another address in an open page replaces the settings, and a pace that is no choice is ignored.
    other.evaluate("location.hash = '#engine_speed=2000&pace=0'")
    wait_for(other, "live.run.signals.get('engine_speed').constant === 2000")
    assert [other.locator(name).input_value() for name in ("#boost_reference", "#pace")] == ["125", "1"]
    other.context.close()
    assert messages == []


def test_cursors_show_values_and_their_difference(paused: Page) -> None:
    """By fields and by clicks."""
    run(paused, 80)
    paused.locator("#boost_reference").fill("150")
    run(paused, 240)
    wait_for(paused, "document.querySelector('.plot').data[0].x.at(-1) > 3.9")
    a, b = paused.locator("#cursors input").all()
    for field, time in [(a, "0.5"), (b, "2")]:
        field.fill(time)
        field.press("Enter")
    shown = paused.locator(".legend output").first
    assert shown.text_content() == "A\u00a0125, B\u00a0150, Δ\u00a025\u00a0kPa"
    assert paused.locator("#cursors output").text_content() == "Δ 1.5 s"
    rows = paused.evaluate(
        "[0.5, 2].map((time) => live.run.columns.get('engine_torque')[Math.round(time * 80)])"
    )
    torque = paused.locator(".legend label:has-text('Engine torque') output").text_content()
    numbers = [
        float(text.strip("ABΔ\u00a0 ").replace("\u2212", "-"))
        for text in torque.removesuffix("\u00a0N·m").split(",")
    ]
    assert numbers == pytest.approx([*rows, rows[1] - rows[0]], rel=1e-3)
    # A click moves the nearer one.
    wait_for(paused, "document.querySelector('.plot').layout.shapes?.length === 2")
    box = paused.locator(".plot .nsewdrag").first.bounding_box()
    place = box["x"] + box["width"] * 3 / 40, box["y"] + box["height"] / 2
    paused.mouse.move(*place)
    # plotly places a click by the point that it has found under the pointer.
    wait_for(paused, "document.querySelector('.plot')._hoverdata?.length > 0")
    paused.mouse.click(*place)
    wait_for(paused, "document.querySelectorAll('#cursors input')[1].value > 2.5")
    assert a.input_value() == "0.5"
    for field in (a, b):
        field.fill("")
        field.press("Enter")
    assert shown.text_content() == ""
    paused.mouse.move(0, 0)


def test_hold_keeps_a_run_under_the_next(paused: Page) -> None:
    run(paused, 80)
    held = paused.evaluate("live.run.columns.get('boost_pressure').slice(0, 81)")
    paused.locator("#hold").click()
    paused.locator("#boost_reference").fill("160")
    restart(paused)
    run(paused, 80)
    wait_for(paused, "document.querySelector('.plot').data[1].x.length === 81")
    lines = paused.evaluate(
        "document.querySelector('.plot').data.map(({ y, line, opacity }) => [y, line.width, opacity])"
    )
    assert len(lines) == 4
    assert [1e3 * each for each in lines[3][0]] == pytest.approx(held)
    assert lines[1][0] != lines[3][0]
    assert (lines[3][1:], lines[1][1] > 1) == ([1, 0.5], True)
    assert paused.locator("#hold").get_attribute("aria-pressed") == "true"
    paused.locator("#hold").click()
    restart(paused)
    assert paused.evaluate("document.querySelector('.plot').data.length") == 2


def test_warning_and_refusal_of_an_fmu_are_told(paused: Page) -> None:
    """A tank that cannot fill, and a value that is not a number."""
    paused.evaluate("live.run.instance('plant').setValue('fault.pump_dead', true)")
    assert not paused.locator("#warnings").is_visible()
    run(paused, 8000)
    warnings = paused.locator("#warnings li").all_text_contents()
    assert any("The controller warns: " in warning for warning in warnings)
    assert paused.locator("#status").text_content() in warnings[-1]
    message = paused.evaluate(
        """() => {
          try {
            live.run.instance("plant").setValue("engine_speed", NaN);
          } catch (failure) {
            return failure.message;
          }
        }"""
    )
    assert message == "The plant stopped. fmi2SetReal: NaN for the variable engine_speed"


def test_runs_by_keyboard_and_says_so(paused: Page) -> None:
    """It runs, pauses, steps and restarts."""
    button = paused.locator("#run")
    button.press("Enter")
    wait_for(paused, "live.run.now > 0.5")
    assert paused.locator("#status").text_content() == "Running."
    button.press("Enter")
    now = paused.evaluate("live.run.now")
    paused.locator("#step").press("Space")
    assert paused.evaluate("live.run.now") == pytest.approx(now + 0.0125)
    assert "Stepped" in paused.locator("#status").text_content()
    # Two digits are shown.
    shown = float(paused.locator("#clock").text_content().split()[0])
    assert shown == pytest.approx(now + 0.0125, abs=0.005 + 1e-9)
    paused.locator("#reset").press("Enter")
    wait_for(paused, "live.run?.now === 0")


def test_pace_is_kept(browser: Browser, live: Path) -> None:
    """On a clock of the test's, which frames follow without delay."""
    page = browser.new_page()
    page.clock.install(time=datetime(2026, 1, 1))
    page.goto(live.as_uri())
    wait_for(page, "globalThis.live?.run")
    page.clock.pause_at(datetime(2026, 1, 1, 1))
    for pace in [0.1, 1, 10]:
        page.locator("#pace").select_option(str(pace))
        before = page.evaluate("live.run.now")
        page.clock.run_for(1000)
        # What the last frame of 16 ms was for may be less, and a step of 12.5 ms more.
        gone = page.evaluate("live.run.now") - before
        assert gone == pytest.approx(pace, abs=0.0125 + 0.016 * pace)
    page.close()


def test_plots_follow_zoom_and_colours(opened: Page) -> None:
    opened.locator("#pace").select_option("50")
    wait_for(opened, "live.run.now > 60")
    ranges = "[...document.querySelectorAll('.plot')].map((plot) => plot.layout.xaxis.range.map(Math.round))"
    # The plots are drawn one after the other.
    wait_for(opened, f"{ranges}.every((range) => range[0] > 0)")
    # The one under the cursor stands still.
    opened.locator(".plot").first.hover()
    held = opened.evaluate(ranges)
    wait_for(opened, f"{ranges}[1][0] > {held[1][0]}")
    assert opened.evaluate(ranges)[0] == held[0]
    opened.mouse.move(0, 0)
    wait_for(opened, f"{ranges}[0][0] > {held[0][0]}")
    opened.locator(".plot").first.locator("[data-title='Zoom in']").press("Enter")
    wait_for(opened, f"new Set({ranges}.map(String)).size === 1")
    zoomed = opened.evaluate(ranges)
    # Drawn again as the loop goes on.
    opened.evaluate(
        """() => {
          globalThis.drawn = new Set();
          document.querySelectorAll(".plot").forEach((plot) =>
            plot.on("plotly_afterplot", () => drawn.add(plot)));
        }"""
    )
    wait_for(opened, "drawn.size === document.querySelectorAll('.plot').length")
    assert opened.evaluate(ranges) == zoomed
    opened.locator(".plot").last.locator("[data-title='Reset axes']").press("Enter")
    wait_for(opened, f"{ranges}.every((range) => range[0] > {zoomed[0][0]})")
    opened.locator("#run").click()
    opened.emulate_media(color_scheme="dark")
    wait_for(opened, "document.querySelector('.plot').data[0].line.color === '#dfe5ec'")
    wait_for(
        opened,
        "[...document.querySelectorAll('.plot')].every((plot) => plot.data.every(({ x }) => x.length > 100))",
    )


def test_drawing_shows_the_plant(paused: Page) -> None:
    run(paused, 80)
    shown = paused.locator("[data-value=boost_pressure]")
    expected = f"{value(paused, 'boost_pressure') / 1e3:.1f} kPa"
    wait_for(paused, f"document.querySelector('[data-value=boost_pressure]').textContent === '{expected}'")
    opening = (
        "getComputedStyle(document.querySelector('.plate[data-opening=hp_wastegate_position]')).transform"
    )
    before = paused.evaluate(opening)
    paused.locator("#boost_reference").press("End")
    run(paused, 40)
    wait_for(paused, f"{opening} !== '{before}'")
    paused.locator(".values summary").press("Enter")
    run(paused, 1)
    wait_for_drawing(paused)
    row = paused.locator("#values tr", has_text="measured boost pressure")
    assert row.locator("td").text_content() == shown.text_content()


CLAIMS = "[...document.querySelectorAll('.claims')].map((table) => table.innerHTML)"

DRAWN = "[...document.querySelectorAll('.plot')].map(({ data, layout }) => ({ data, layout }))"


def assert_same_figure(here: list[dict[str, Any]], laboratory: list[dict[str, Any]]) -> None:
    """The same axes and lines, to what a screen shows: each line's ends, extremes and points."""
    for plot, other in zip(here, laboratory, strict=True):
        axes = [[part["layout"][axis].get("title") for axis in ("xaxis", "yaxis")] for part in (plot, other)]
        texts = [[title and title["text"] for title in part] for part in axes]
        assert texts[0] == texts[1]
        for line, reference in zip(plot["data"], other["data"], strict=True):
            assert line["name"] == reference["name"]
            for axis in "xy":
                ours, theirs = line[axis], reference[axis]
                size = max(map(abs, theirs))
                ends = [[each[0], each[-1], min(each), max(each)] for each in (ours, theirs)]
                assert ends[0] == pytest.approx(ends[1], abs=2e-3 * size), (texts, line["name"], axis)


def test_experiments_give_the_figures_of_the_laboratory(
    opened: Page, reproduction: Path, browser: Browser
) -> None:
    """The paper's figures with all their runs, and the claims with the results of `reproduce`."""
    page = browser.new_page()
    page.goto((reproduction / "report.html").as_uri())
    reported = page.evaluate(CLAIMS)
    page.close()
    assert sum(claims.count("<tr>") for claims in reported) > 30
    plots = iter(Report(reproduction / "report.html").plots)

    opened.locator("#pace").select_option("Infinity")
    for button, expected in zip(opened.locator("#choices button").all(), reported, strict=True):
        button.click()
        opened.wait_for_selector("#results table")
        assert opened.evaluate(CLAIMS) == [expected], button.text_content()
        here = opened.evaluate(DRAWN)
        assert_same_figure(here, [next(plots) for _ in here])
        found = measured(opened, *SIZES[0])
        assert (found["wide"], found["broken"]) == ([], []), button.text_content()
        found = measured(opened, *SIZES[2])
        opened.screenshot(path=PICTURES / f"experiment-{button.text_content().split()[1]}.png")
        assert (found["wide"], found["broken"]) == ([], []), button.text_content()
    assert next(plots, None) is None


def test_an_experiment_sets_pace_and_controls(opened: Page) -> None:
    """Fig. 11 drives from 1000 to 3000 rpm in two runs of 340 s, too long for real time."""
    speed = opened.locator(".control:has(#engine_speed) input[type=number]")
    figure = opened.locator("#choices button", has_text="Fig. 11")
    figure.click()
    wait_for(opened, "live.run?.now > 100 && live.finished.length === 0")
    assert opened.locator("#pace").input_value() == "50"
    assert "run 1 of 2" in opened.locator("#status").text_content()
    opened.wait_for_selector("#results table")
    assert (speed.input_value(), speed.is_disabled()) == ("3000", True)
    # The records stay until Reset.
    assert opened.locator("#run").is_disabled()
    with opened.expect_download() as download:
        opened.locator("#csv").click()
    assert download.value.suggested_filename == "figure_11_run_1.csv"
    opened.locator("#reset").click()
    wait_for(opened, "live.run?.scenario.title === 'Closed loop'")
    assert (speed.input_value(), speed.is_disabled()) == ("1500", False)
    assert opened.locator("#pace").input_value() == "1"
    # A pace that the user chose stays.
    opened.locator("#pace").select_option("5")
    figure.click()
    wait_for(opened, "live.run?.now > 1")
    assert opened.locator("#pace").input_value() == "5"


def test_record_is_that_of_cargo_fmu(opened: Page, cargo_fmu: Run, exported: Path, tmp_path: Path) -> None:
    """To the last bit, with the same names and units."""
    opened.locator("#pace").select_option("Infinity")
    opened.locator("#choices button").first.click()
    opened.wait_for_selector("#results table")
    with opened.expect_download() as download:
        opened.locator("#csv").click()
    saved, recorded = tmp_path / download.value.suggested_filename, tmp_path / "record.csv"
    assert saved.name == "figure_1_run_1.csv"
    download.value.save_as(saved)
    scenario = SCENARIOS / "figure_1.toml"
    assert cargo_fmu("simulate", scenario, "--fmus", exported, "--out", recorded).returncode == 0
    rows, others = (list(csv.reader(file.read_text().splitlines())) for file in (saved, recorded))
    assert rows[:2] == others[:2]
    assert rows[1][rows[0].index("boost_pressure")] == "Pa"
    assert [[float(cell) for cell in row] for row in rows[2:]] == [
        [float(cell) for cell in row] for row in others[2:]
    ]
    assert len(rows) > 600


def test_trap_is_told_and_reset_helps(opened: Page) -> None:
    opened.evaluate(
        """() => {
          const plant = live.run.instance("plant");
          const fmi2DoStep = () => {
            plant.panic = "a panic";
            throw new WebAssembly.RuntimeError("unreachable");
          };
          plant.exports = { ...plant.exports, fmi2DoStep };
        }"""
    )
    opened.locator("#failure").wait_for()
    assert opened.locator("#failure p").text_content() == "The plant stopped. fmi2DoStep: a panic"
    assert opened.locator("#run").text_content() == "Run"
    opened.locator("#failure button").click()
    wait_for(opened, "live.run?.now > 0.2")
    assert not opened.locator("#failure").is_visible()


def test_missing_modules_are_told_with_their_command(lab: Run, exported: Path, tmp_path: Path) -> None:
    missing = tmp_path / "BoostPlant.wasm"
    done = lab("live", "--plant", missing, "--fmus", exported, "--out", tmp_path / "live.html")
    assert done.returncode == 2
    assert str(missing) in done.stderr
    assert "boost-fmu export --wasm" in done.stderr


def test_picture_of_the_documents(browser: Browser, live: Path) -> None:
    picture = PICTURES / "live.png"
    PICTURES.mkdir(exist_ok=True)
    take(browser, live, picture)
    for file in (picture, ROOT / "docs" / "live.png"):
        assert 20e3 < file.stat().st_size < LARGEST_PICTURE
    assert "(live.png)" in (ROOT / "docs" / "laboratory.md").read_text()
