"""Pages and reports, opened in Chromium: the fixtures of the tests in this folder."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT, TARGET, Run
from playwright.sync_api import Browser, Page

HEIGHT = 900

FMUS = ["BoostPlant", "BoostController"]

REPORTS = ["reproduction", "identification", "tuning", "simulation", "system", "study", "sweep"]

LIVE = "live"

PAGES = [*FMUS, *REPORTS, LIVE]

PICTURES = TARGET / "pages"
"""Which `sheet.py` puts on one sheet."""

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


@pytest.fixture(scope="session")
def files(lab: Run, exported: Path, live: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The pages of the FMUs, a report of each command, and the page that runs them."""
    PICTURES.mkdir(exist_ok=True)
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
    # This strategy fails, so that the report explains cases.
    run("study", *both, "--cases", "4", "--strategy", "by_speed", "--out", folder / "study", status=1)
    sweep = folder / "sweep.toml"
    sweep.write_text(SWEEP.format(scenario=steps.with_name("figure_1.toml")))
    run("sweep", sweep, "--fmus", exported, "--out", folder / "sweep")
    reports = {name: folder / name / "report.html" for name in REPORTS}
    return {**files, **reports, "simulation": plot, "system": system, LIVE: live}


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
