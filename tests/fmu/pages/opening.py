"""The fixtures of the tests of pages: all of them, and how one is opened."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from fmu import ROOT, Run
from fmu.conftest import Once
from fmu.pages.visit import FMUS, HEIGHT, LINEAR, LIVE, PICTURES, Visit

SWEEP = """
scenario = "{scenario}"
[grid]
"plant:valve.time_constant" = {{ from = 0.008, to = 0.08, points = 4, spacing = "logarithmic" }}
"plant:tank.volume" = [1e-3, 2e-3]
[measures]
least = {{ minimum = "actuator_pressure" }}
most = {{ maximum = "hp_wastegate_position" }}
"""
"""Of two parameters."""


@pytest.fixture(scope="session")
def files(
    once: Once, lab: Run, cargo_fmu: Run, exported: Path, reproduction: Path, tuned: Path, live: Path
) -> dict[str, Path]:
    """The pages of the FMUs, a report of each command, and the page that runs them."""
    PICTURES.mkdir(exist_ok=True)
    folder = once("pages", lambda folder: write_pages(lab, cargo_fmu, exported, folder))
    pages = {name: folder / f"{name}.html" for name in [*FMUS, "simulation", "comparison", "system", LINEAR]}
    reports = {name: folder / name / "report.html" for name in ["identification", "study", "sweep"]}
    of_others = {"reproduction": reproduction / "report.html", "tuning": tuned / "report.html", LIVE: live}
    return {**pages, **reports, **of_others}


def write_pages(lab: Run, cargo_fmu: Run, exported: Path, folder: Path) -> None:
    """Writes those that no other test takes."""
    for name in FMUS:
        with zipfile.ZipFile(exported / f"{name}.fmu") as archive:
            (folder / f"{name}.html").write_bytes(archive.read("documentation/index.html"))

    def run(command: Run, *arguments: str | Path, status: int = 0) -> None:
        done = command(*arguments)
        assert (done.returncode, done.stderr) == (status, "")

    plant = ["--plant", exported / "BoostPlant.fmu"]
    both = [*plant, "--controller", exported / "BoostController.fmu"]
    steps = ROOT / "boost" / "lab" / "scenarios" / "figure_13.toml"
    bench = folder / "bench.csv"
    run(cargo_fmu, "simulate", ROOT / "examples" / "actuator_bench.toml", "--fmus", exported, "--out", bench)
    run(lab, "identify", "actuator", bench, *plant, "--out", folder / "identification")
    run(
        cargo_fmu,
        "simulate",
        steps,
        "--fmus",
        exported,
        "--out",
        folder,
        "--plot",
        folder / "simulation.html",
    )
    other, page = folder / "other.csv", folder / "comparison.html"
    larger = ["--set", "plant:tank.volume=2 l", "--out", other]
    run(cargo_fmu, "simulate", steps, "--fmus", exported, *larger)
    run(cargo_fmu, "compare", folder / "figure_13.csv", other, "--plot", page)
    pumping = ["--set", "boost_reference=150 kPa", "--stop-time", "60", "--plot", folder / "system.html"]
    run(cargo_fmu, "simulate", exported / "Boost.ssp", "--out", folder, *pumping)
    loop = ["--at", "24", "--path", "hp_wastegate_pwm,boost_pressure", "--loop", "controller:boost_pressure"]
    run(cargo_fmu, "linearize", steps, "--fmus", exported, *loop, "--plot", folder / f"{LINEAR}.html")
    # This strategy fails, so that the report explains cases.
    run(lab, "study", *both, "--cases", "4", "--strategy", "by_speed", "--out", folder / "study", status=1)
    sweep = folder / "sweep.toml"
    sweep.write_text(SWEEP.format(scenario=steps.with_name("figure_1.toml")))
    run(cargo_fmu, "sweep", sweep, "--fmus", exported, "--out", folder / "sweep")


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
