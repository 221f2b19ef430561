"""The WebAssembly modules in a browser and in Python, as docs/wasm.md runs them."""

from __future__ import annotations

import base64
import subprocess
import sys
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from fmu import ROOT, TARGET
from fmu.documents import blocks
from fmu.master import Make

pytestmark = pytest.mark.browser

DOCUMENT = (ROOT / "docs" / "wasm.md").read_text()


@pytest.fixture
def boost_pressure(plant: Make) -> float:
    """That of the native library after one second, in Pa."""
    instance = plant()
    slave = instance.slave
    slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    for i in range(80):
        slave.doStep(i / 80, 1 / 80)
    return instance.get("boost_pressure")


def test_python_runs_a_module_as_documented(boost_pressure: float, modules: Path) -> None:
    [code] = blocks(DOCUMENT, "python")
    code = code.replace("target/wasm", str(modules)).replace("target/fmu", str(TARGET / "fmu"))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == (f"{boost_pressure!r} Pa after one second\n", "")


def test_a_browser_runs_a_module_as_documented(
    boost_pressure: float, modules: Path, browser: Browser
) -> None:
    [code] = blocks(DOCUMENT, "js")
    module = base64.b64encode((modules / "BoostPlant.wasm").read_bytes()).decode()
    page = browser.new_page()
    run = "return simulate(Uint8Array.from(atob(text), (byte) => byte.charCodeAt(0)))"
    assert page.evaluate(f"async (text) => {{ {code} {run} }}", module) == boost_pressure
