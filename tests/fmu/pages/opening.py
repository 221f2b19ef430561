"""The fixtures of the tests of pages: all of them, and how one is opened."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from conftest import ROOT, Run
from playwright.sync_api import Browser, Page
from visit import FMUS, HEIGHT, LINEAR, LIVE, PICTURES, REPORTS, Visit

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
    steps = ROOT / "boost" / "lab" / "scenarios" / "figure_13.toml"
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
