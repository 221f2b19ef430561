"""`cargo fmu simulate`: the ladder's FMUs, beside FMPy, and the model of a folder."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import FMUS
from fmpy import read_model_description, simulate_fmu
from fmpy.util import read_csv

COMMAND = FMUS.parents[1] / "debug" / "cargo-fmu"
TEMPLATES = ["Dahlquist", "VanDerPol", "BouncingBall", "StickSlip", "PiController"]
TOLERANCE = 1e-9


def run(*arguments: str | Path, **options: object) -> str:
    done = subprocess.run([COMMAND, *arguments], capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("model", TEMPLATES)
def test_a_record_agrees_with_fmpy(fmu, model: str, tmp_path: Path) -> None:
    experiment = read_model_description(fmu(model)).defaultExperiment
    step, out = float(experiment.stepSize), tmp_path / "record.csv"
    run("simulate", fmu(model), "--tolerance", str(TOLERANCE), "--step", repr(step), "--out", out)
    expected = simulate_fmu(
        fmu(model),
        fmi_type="CoSimulation",
        relative_tolerance=TOLERANCE,
        step_size=step,
        output_interval=step,
    )
    found = read_csv(out)
    assert len(found) == len(expected) > 10
    for name in found.dtype.names[1:]:
        # FMPy's steps differ by the rounding of its times: far less than the tolerance.
        assert np.allclose(found[name], expected[name], rtol=TOLERANCE, atol=TOLERANCE), name


def test_the_summary_says_what_ran_and_where_it_ended(fmu) -> None:
    lines = run("simulate", fmu("Dahlquist"), "--set", "k=2", "--stop-time", "1").splitlines()
    assert lines[0].startswith("Dahlquist: 10 steps of 0.1 s to 1 s, in ")
    # exp(-2)
    assert lines[1].split() == ["x", "1", "to", "0.135"]


def test_inputs_come_from_a_file(fmu, tmp_path: Path) -> None:
    inputs, out = tmp_path / "in.csv", tmp_path / "out.csv"
    inputs.write_text("time,Float64_continuous_input,Int32_input\n0,0,1\n0.5,1,1\n0.5,3,2\n1,4,2\n")
    run("simulate", fmu("Feedthrough"), "--input", inputs, "--stop-time", "1", "--step", "0.25", "--out", out)
    found = read_csv(out)
    # On lines between rows, with the jump at its time, as inputs are set before a step.
    assert found["Float64_continuous_output"].tolist() == [0, 0, 0.5, 3, 3.5]
    assert found["Int32_output"].tolist() == [1, 1, 1, 2, 2]


def test_the_model_of_a_folder_is_exported_and_drawn(tmp_path: Path) -> None:
    environment = {**os.environ, "CARGO_TARGET_DIR": str(FMUS.parents[1].resolve())}
    run("new", "ball", "--template", "bouncing_ball", "--vcs", "none", cwd=tmp_path)
    output = run("simulate", "--plot", "ball.html", cwd=tmp_path / "ball", env=environment)
    assert "ball: 300 steps of 0.01 s to 3 s" in output
    assert "<html" in tmp_path.joinpath("ball", "ball.html").read_text()


def test_a_model_that_asks_for_the_end_is_recorded_until_then(fmu, tmp_path: Path) -> None:
    out = tmp_path / "stair.csv"
    run("simulate", fmu("Stair"), "--stop-time", "20", "--step", "0.25", "--out", out)
    found = read_csv(out)
    assert (found["time"][-1], found["counter"][-1]) == (9, 10)
