"""Fig. 13 by two masters: that of these tests on FMPy, and one in C, which shares no code with it."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
from c_loop import FLAGS, SOURCE, run_loop
from conftest import Make
from experiments import BOOST_STEPS, BOOST_STEPS_END, ON_TOLERANCE, Steps, couple, staircase
from fmpy import platform
from master import Fmu


def test_every_number_is_the_same(
    plant: Make, controller: Make, plant_fmu: Fmu, controller_fmu: Fmu, tmp_path: Path
) -> None:
    """All outputs of both after each step, compared as 64-bit patterns; and it is the paper's experiment."""
    program = tmp_path / "loop"
    subprocess.run([os.environ.get("CC", "cc"), *FLAGS, SOURCE, "-o", program, "-ldl"], check=True)
    in_c = run_loop([str(program)], platform, controller_fmu, plant_fmu)

    inputs = {"boost_reference": staircase(*BOOST_STEPS)}
    record = couple(plant(), controller(), inputs=inputs).run(BOOST_STEPS_END)
    names = [*controller_fmu.named("output"), *plant_fmu.named("output")]
    # FMPy's record begins before the first step.
    in_python = np.stack([record[name][1:] for name in names], axis=1)
    assert in_c.shape == in_python.shape
    assert np.array_equal(in_c.view(np.uint64), in_python.view(np.uint64))

    # The limits of the reference solution, as in test_boost_steps.py.
    steps = Steps(record, BOOST_STEPS, BOOST_STEPS_END)
    assert max(steps.up) <= 530 + ON_TOLERANCE
    assert max(steps.down) <= 420 + ON_TOLERANCE
