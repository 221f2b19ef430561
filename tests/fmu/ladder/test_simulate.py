"""`cargo fmu simulate`: the ladder's FMUs by both interfaces, against FMPy, closed forms and SciPy, and the
model of a folder."""

from __future__ import annotations

import os
import re
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.util import read_csv
from scipy.integrate import solve_ivp

from fmu.beside_fmpy import largest_difference
from fmu.ladder import FMUS
from fmu.ladder.test_clocks_fmi3 import FOLDER as FMUS_OF_FMI3
from fmu.ladder.test_clocks_fmi3 import PATHS as CLOCKS
from fmu.ladder.test_clocks_fmi3 import theirs

COMMAND = FMUS.parents[1] / "debug" / "cargo-fmu"
TEMPLATES = ["Dahlquist", "VanDerPol", "BouncingBall", "StickSlip", "PiController"]
TOLERANCE = 1e-9


def run(command: str, *arguments: str | Path, **options: object) -> str:
    """Runs a command; records are without units, as FMPy reads them."""
    more = ["--no-units"] if command == "simulate" and "--out" in arguments else []
    done = subprocess.run(
        [COMMAND, command, *arguments, *more], capture_output=True, text=True, check=False, **options
    )
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


# FMPy does not tick clocks of FMI 3.0, as Cascade has them, and its CVode gives up in Furnace. When StickSlip
# sticks depends on roots, which a solver finds to some 1e-9.
@pytest.mark.parametrize(
    "model",
    ["Battery", "BouncingBall", "Dahlquist", "DriveCycle", "Feedthrough", "PiController", "VanDerPol"],
)
def test_model_exchange_agrees_with_fmpy(fmu, model: str, tmp_path: Path) -> None:
    """Within 1e-9, where both solve to 1e-12."""
    assert largest_difference(fmu(model), tmp_path, step=0.1, tolerance=1e-12) < 1e-9


def test_the_summary_says_what_ran_and_where_it_ended(fmu) -> None:
    lines = run("simulate", fmu("Dahlquist"), "--set", "k=2", "--stop-time", "1").splitlines()
    assert re.fullmatch(
        r"Dahlquist: 10 steps of 0\.1 s to 1 s, in \d+ ms; sampled: no events from Dahlquist", lines[0]
    )
    # From 1 to exp(-2).
    assert [line.split() for line in lines[1:]] == [
        ["first", "last", "least", "largest"],
        ["x", "1", "0.135", "0.135", "1"],
    ]


def test_inputs_come_from_a_file(fmu, tmp_path: Path) -> None:
    inputs, out = tmp_path / "in.csv", tmp_path / "out.csv"
    inputs.write_text("time,Float64_continuous_input,Int32_input\n0,0,1\n0.5,1,1\n0.5,3,2\n1,4,2\n")
    run("simulate", fmu("Feedthrough"), "--input", inputs, "--stop-time", "1", "--step", "0.25", "--out", out)
    found = read_csv(out)
    # On lines between rows, with the jump at its time, as inputs are set before a step.
    assert found["Float64_continuous_output"].tolist() == [0, 0, 0.5, 3, 3.5]
    assert found["Int32_output"].tolist() == [1, 1, 1, 2, 2]


def package(template: str, name: str, folder: Path) -> dict[str, object]:
    """A new package, named for one test as tests share the target folder, and options to run in it."""
    run("new", name, "--template", template, "--vcs", "none", cwd=folder)
    environment = {**os.environ, "CARGO_TARGET_DIR": str(FMUS.parents[1].resolve())}
    return {"cwd": folder / name, "env": environment}


# One of each version; `tests/run` exports all of them.
@pytest.mark.parametrize("template", ["bouncing_ball", "state_space"])
def test_the_model_of_a_folder_is_exported_and_drawn(template: str, tmp_path: Path) -> None:
    name = f"my_{template}"
    output = run("simulate", "--plot", "my.html", **package(template, name, tmp_path))
    if template == "bouncing_ball":
        assert "my_bouncing_ball: 300 steps of 0.01 s to 3 s" in output
    assert "<html" in tmp_path.joinpath(name, "my.html").read_text()


def test_a_trial_has_the_results_of_the_optimized_fmu(tmp_path: Path) -> None:
    options = package("stick_slip", "tried", tmp_path)
    (exported,) = (line.split()[0] for line in run("export", **options).splitlines())
    optimized = Path(exported).read_bytes()
    run("simulate", exported, "--out", "optimized.csv", **options)
    run("simulate", "--out", "trial.csv", **options)
    records = [(tmp_path / "tried" / f"{name}.csv").read_bytes() for name in ("optimized", "trial")]
    assert records[0] == records[1]
    assert len(records[0].splitlines()) > 300
    # The trial replaces nothing.
    assert Path(exported).read_bytes() == optimized


def test_a_trial_has_the_interface_and_the_version_by_which_it_runs(tmp_path: Path) -> None:
    """The template is of FMI 2.0."""
    options = package("bouncing_ball", "exchanged", tmp_path)
    arguments = ["--interface", "me", "--fmi", "3", "--out", "record.csv"]
    fmu, _ = run("simulate", *arguments, **options).splitlines()
    description = read_model_description(fmu.split()[0])
    assert description.fmiVersion == "3.0"
    assert description.modelExchange
    assert not description.coSimulation


@pytest.mark.parametrize("interface", ["cs", "me"])
def test_time_based_clocks_tick(interface: str, tmp_path: Path) -> None:
    """The constant one each second, and the countdown from 4 s on; nothing ticks the triggered one."""
    out = tmp_path / "clocks.csv"
    arguments = [CLOCKS["events"], "--interface", interface, "--stop-time", "9", "--out", out]
    run("simulate", *arguments, "--no-events")
    found = read_csv(out)
    rows = theirs()
    assert found["time"].tolist() == [row["time"] for row in rows]
    for name in ("inClock1Ticks", "inClock3Ticks", "output3"):
        assert found[name].tolist() == [row[name] for row in rows], name
    assert np.array_equal(found["totalInClockTicks"], found["inClock1Ticks"] + found["inClock3Ticks"])
    assert not found["inClock2Ticks"].any()
    # Between ticks nothing changes.
    run("simulate", *arguments)
    before_and_after = [row for pair in pairwise(found) for row in pair]
    with_events = read_csv(out)
    assert with_events["time"].tolist() == [0, *(time for time in range(1, 10) for _ in range(2))]
    for name in found.dtype.names[1:]:
        assert with_events[name][1:].tolist() == [row[name] for row in before_and_after], name


def test_scheduled_execution_is_refused_with_the_reason() -> None:
    done = subprocess.run(
        [COMMAND, "simulate", CLOCKS["scheduled"]], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "it is for Scheduled Execution only, which needs a scheduler for its clocks" in done.stderr


def exchanged(fmu: Path, tmp_path: Path, *arguments: str) -> np.ndarray:
    """The record in Model Exchange."""
    out = tmp_path / "exchanged.csv"
    tolerance = ["--tolerance", str(TOLERANCE)]
    run("simulate", fmu, "--interface", "me", *tolerance, *arguments, "--out", out)
    return read_csv(out)


def test_model_exchange_solves_a_decay(fmu, tmp_path: Path) -> None:
    found = exchanged(fmu("Dahlquist"), tmp_path, "--set", "k=2")
    assert len(found) == 101
    # A hundred steps, each within the tolerance.
    assert np.abs(found["x"] - np.exp(-2 * found["time"])).max() < 100 * TOLERANCE


@pytest.mark.parametrize("mu", [1, 1000])
def test_model_exchange_solves_an_oscillator(fmu, tmp_path: Path, mu: int) -> None:
    """Stiff, too: with the FMU's directional derivatives."""
    times = ["--stop-time", str(2 * max(mu, 5)), "--step", str(max(mu, 5) / 50)]
    found = exchanged(fmu("VanDerPol"), tmp_path, "--set", f"mu={mu}", *times)
    expected = solve_ivp(
        lambda _, x: [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]],
        (0, found["time"][-1]),
        [2, 0],
        method="Radau",
        t_eval=found["time"],
        rtol=1e-11,
        atol=1e-11,
    ).y
    # The phase error after a jump of x1 by its thousandfold.
    assert np.allclose(found["x0"], expected[0], atol=1e-5 if mu == 1000 else 1e-6, rtol=0)


def test_model_exchange_finds_the_bounces(fmu, tmp_path: Path) -> None:
    found = exchanged(fmu("BouncingBall"), tmp_path)
    impact = np.sqrt(2 / 9.81)
    # The first three bounces, at which 0.7 of the speed is left.
    ends = impact * np.cumsum([1, 2 * 0.7, 2 * 0.7**2])
    for begin, end, speed in zip([0, *ends[:2]], ends, [0, 0.7, 0.7**2], strict=True):
        rows = found[(found["time"] > begin) & (found["time"] < end)]
        since = rows["time"] - begin
        height = (1 if begin == 0 else 0) + speed * 9.81 * impact * since - 9.81 / 2 * since**2
        assert len(rows) > 40
        assert np.abs(rows["h"] - height).max() < 100 * TOLERANCE
    for end, speed in zip(ends, [1, 0.7, 0.7**2], strict=True):
        before, after = found[np.isclose(found["time"], end, rtol=0, atol=100 * TOLERANCE)]
        assert after["v"] == -0.7 * before["v"]
        assert abs(before["v"] + speed * 9.81 * impact) < 100 * TOLERANCE
    # It lies still after the last one.
    assert found["h"][-1] == found["v"][-1] == 0


def test_model_exchange_sticks_and_slips_as_co_simulation(fmu, tmp_path: Path) -> None:
    """With the same integrator, inside and outside of the FMU."""
    found = exchanged(fmu("StickSlip"), tmp_path, "--no-events")
    out = tmp_path / "co.csv"
    run("simulate", fmu("StickSlip"), "--interface", "cs", "--tolerance", str(TOLERANCE), "--out", out)
    expected = read_csv(out)
    assert np.ptp(expected["force"]) > 1
    for name in expected.dtype.names:
        assert np.allclose(found[name], expected[name], rtol=1e-6, atol=1e-6), name


def test_model_exchange_samples_at_the_start_and_at_communication_points(fmu, tmp_path: Path) -> None:
    """Co-simulation leaves the sample at a step's end to the next step."""
    found = exchanged(fmu("PiController"), tmp_path, "--no-events")
    out = tmp_path / "co.csv"
    run("simulate", fmu("PiController"), "--interface", "cs", "--out", out)
    assert np.array_equal(found["command"][:-1], read_csv(out)["command"][1:])
    assert len(set(found["command"])) == len(found)


def test_arrays_of_states_are_integrated_with_driven_inputs(tmp_path: Path) -> None:
    inputs = tmp_path / "in.csv"
    inputs.write_text("time,u[1],u[2],u[3]\n0,0,1,0\n1,0,1,0\n1,1,1,0\n1.5,1,1,0\n1.5,0,1,1\n2,0,1,1\n")
    times = ["--input", inputs, "--step", "0.1", "--stop-time", "2"]
    fmu = FMUS_OF_FMI3 / "fmu" / "fmi3" / "StateSpace.fmu"
    found = exchanged(fmu, tmp_path, *times)
    out = tmp_path / "co.csv"
    run("simulate", fmu, "--interface", "cs", "--tolerance", str(TOLERANCE), *times, "--out", out)
    expected = read_csv(out)
    # The inputs are constant in each step, in which Model Exchange would follow them. Where they jump, its
    # row has the outputs after the event; that of co-simulation those before the step.
    held = ~np.isin(found["time"], [1, 1.5])
    for name in expected.dtype.names:
        assert np.allclose(found[name][held], expected[name][held], rtol=1e-7), name


def test_a_model_that_asks_for_the_end_is_recorded_until_then(fmu, tmp_path: Path) -> None:
    out = tmp_path / "stair.csv"
    run("simulate", fmu("Stair"), "--stop-time", "20", "--step", "0.25", "--out", out)
    found = read_csv(out)
    assert (found["time"][-1], found["counter"][-1]) == (9, 10)
