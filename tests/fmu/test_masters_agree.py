"""In Fig. 13 the FMUs compute the models' results, to the last bit, in FMPy and with a master in C."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from fmpy import platform

from fmu import TARGET
from fmu.c_loop import FLAGS, SOURCE, run_loop
from fmu.experiments import BOOST_STEPS, BOOST_STEPS_END, couple, staircase
from fmu.master import Fmu, Make

pytestmark = pytest.mark.quick


def test_every_number_is_the_models(
    plant: Make, controller: Make, plant_fmu: Fmu, controller_fmu: Fmu, tmp_path: Path
) -> None:
    """All outputs of both after each step, compared as 64-bit patterns. The models' come from the Rust test
    of Fig. 13, which compares them with the figure."""
    file = TARGET / "tmp" / "figure_13.txt"
    assert file.is_file(), "run the Rust tests first: cargo test --all-features"
    rows = [bytes.fromhex(line) for line in file.read_text().splitlines()]
    models = np.array([np.frombuffer(row, ">u8") for row in rows])

    program = tmp_path / "loop"
    subprocess.run([os.environ.get("CC", "cc"), *FLAGS, SOURCE, "-o", program, "-ldl"], check=True)
    in_c = run_loop([str(program)], platform, controller_fmu, plant_fmu)

    inputs = {"boost_reference": staircase(*BOOST_STEPS)}
    record = couple(plant(), controller(), inputs=inputs).run(BOOST_STEPS_END)
    names = [*controller_fmu.named("output"), *plant_fmu.named("output")]
    # FMPy's record starts before the first step.
    in_python = np.stack([record[name][1:] for name in names], axis=1)
    for fmus in (in_c, in_python):
        assert fmus.shape == models.shape == (124 * 80, 20)
        different = fmus.view(np.uint64) != models
        assert not different.any(), f"first in step {np.argmax(different.any(axis=1))}"
