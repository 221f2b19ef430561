"""The template of a controller, examples/minimal-controller, exported from its own workspace."""

from __future__ import annotations

from collections.abc import Callable
from math import exp
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu

from fmu import ROOT
from fmu.experiments import BOOST_STEPS, BOOST_STEPS_END, Steps, couple, staircase
from fmu.master import Fmu, Instance, Make


@pytest.fixture(scope="module")
def minimal(exported: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    return Fmu(exported / "MinimalController.fmu", tmp_path_factory.mktemp("minimal"))


def test_it_is_valid_and_short(minimal: Fmu) -> None:
    assert validate_fmu(str(minimal.path)) == []
    source = ROOT / "examples" / "minimal-controller" / "src" / "lib.rs"
    code = [line for line in source.read_text().splitlines() if line and not line.startswith("//")]
    assert len(code) <= 60


def test_it_controls_the_plant(plant: Make, minimal: Fmu, make: Callable[[Fmu], Instance]) -> None:
    record = couple(plant(), make(minimal), inputs={"boost_reference": staircase(*BOOST_STEPS)})
    record = record.run(BOOST_STEPS_END)
    steps = Steps(record, BOOST_STEPS, BOOST_STEPS_END)
    print(steps.summary())
    # As in the paper.
    assert max(steps.up) <= 5e3
    assert max(steps.down) <= 1e3
    # Slowest at 125 kPa, where a time constant of 1.04 s and a gain of -3210 Pa/% leave a pole at 0.33 1/s;
    # of a step of 20 kPa that holds for 10 s.
    assert max(steps.end_error) <= 20e3 * exp(-0.33 * 10)
    # The relay of the vacuum pump.
    assert set(record["vacuum_pump"]) == {0.0, 1.0}
