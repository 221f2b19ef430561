"""Model Exchange by `cargo fmu simulate` beside FMPy, with inputs that are constant between points."""

from __future__ import annotations

import csv
import subprocess
from pathlib import Path

import numpy as np
from fmpy import read_model_description, simulate_fmu

from fmu import TARGET, csv_lines

POINTS = 11
TYPES = {"Real": float, "Float64": float, "Float32": np.float32, "Integer": np.int32, "Int32": np.int32}


def largest_difference(fmu: Path, folder: Path, *, step: float, tolerance: float) -> float:
    """The largest difference of an output at a communication point, relative to 1 and the output.

    Both solvers have the tolerance. Where an input jumps, both records have the values after the event.
    """
    variables = [
        v for v in read_model_description(fmu).modelVariables if v.type in TYPES and not v.dimensions
    ]
    inputs = [v for v in variables if v.causality == "input"]
    outputs = [v.name for v in variables if v.causality == "output"]
    times = step * np.arange(POINTS)
    random = np.random.default_rng(3)
    signals = np.zeros(2 * POINTS - 1, [("time", float), *((v.name, TYPES[v.type]) for v in inputs)])
    # Two rows of one time are a jump.
    signals["time"] = np.repeat(times, 2)[1:]
    for variable in inputs:
        signals[variable.name] = np.repeat(random.integers(1, 5, POINTS), 2)[:-1]
    given, out = folder / "signals.csv", folder / "out.csv"
    with given.open("w", newline="") as file:
        csv.writer(file).writerows([signals.dtype.names, *signals.tolist()])
    command = [TARGET / "debug" / "cargo-fmu", "fmu", "simulate", fmu, "--interface", "me", "--no-events"]
    command += ["--step", repr(step), "--stop-time", repr(float(times[-1])), "--tolerance", repr(tolerance)]
    command += ["--input", given] * bool(inputs)
    subprocess.run([*command, "--record", ",".join(outputs), "--out", out], check=True)
    names, *rows = csv.reader(csv_lines(out))
    assert [float(row[0]) for row in rows] == times.tolist()
    expected = simulate_fmu(
        fmu,
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=tolerance,
        stop_time=float(times[-1]),
        step_size=step,
        output_interval=step,
        input=signals if inputs else None,
        output=outputs,
    )
    # Of an event it has rows before and after; its times are k · h as these are, up to the last bit.
    last = np.searchsorted(expected["time"], times + step / 1000, "right") - 1
    assert np.allclose(expected["time"][last], times, rtol=0, atol=step / 1000)
    assert len(names) == len(outputs) + 1
    found = np.array([row[1:] for row in rows], float)
    theirs = np.array([expected[name][last] for name in outputs], float).T
    return float((np.abs(found - theirs) / (1 + np.abs(theirs))).max())
