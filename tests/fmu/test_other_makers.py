"""`cargo fmu simulate` on FMUs from other tools, by both interfaces.

The Reference-FMUs give their published results and closed forms, OpenModelica's give FMPy's, and what cannot
run is refused with the reason. No package has the Reference-FMUs Resource and Clocks: the templates of these
are tested in tests/fmu/ladder/.
"""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sysconfig
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from scipy.integrate import solve_ivp

from fmu import ROOT, TARGET, csv_lines
from fmu.beside_fmpy import largest_difference
from fmu.test_validate import MODESTPY, OPEN_MODELICA, REFERENCE

PUBLISHED = ROOT / "tests" / "fmu" / "ladder" / "reference"

REFERENCE_FMUS = [
    f"fmi{version}/{model}"
    for version, models in {2: "", 3: "StateSpace"}.items()
    for model in ["BouncingBall", "Dahlquist", "Feedthrough", "Stair", "VanDerPol", *models.split()]
]

TOLERANCE = 1e-8

Simulate = Callable[..., dict[str, np.ndarray]]


def simulate_of_cargo(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [TARGET / "debug" / "cargo-fmu", "fmu", "simulate", *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, env={**os.environ, **environment}
    )


def read(path: Path) -> dict[str, np.ndarray]:
    """The columns of numbers; each element of an array has a separate column."""
    names, *rows = csv.reader(csv_lines(path))
    columns = {}
    for name, values in zip(names, zip(*rows, strict=True), strict=True):
        elements = np.array([value.replace("false", "0").split(" ") for value in values]).T
        for index, element in enumerate(elements, 1):
            column = name if len(elements) == 1 else f"{name}[{index}]"
            try:
                columns[column] = element.astype(float)
            except ValueError:
                assert name in ("String_output", "Binary_output")
    return columns


@pytest.fixture
def simulate(tmp_path: Path) -> Simulate:
    """The record of a run to its end."""

    def run(*arguments: str | Path, **environment: str) -> dict[str, np.ndarray]:
        done = simulate_of_cargo(*arguments, "--out", tmp_path / "out.csv", **environment)
        assert done.returncode == 0, done.stderr
        return read(tmp_path / "out.csv")

    return run


@pytest.mark.parametrize("model", REFERENCE_FMUS)
def test_reference_fmus_give_their_published_results(
    other_makers: Path, simulate: Simulate, model: str
) -> None:
    """To the last bit, in co-simulation: both call the same code at the same times."""
    expected = read(PUBLISHED / f"{model.split('/')[1]}_out.csv")
    times = expected["time"]
    times = ["--step", str(times[1] - times[0]), "--stop-time", str(times[-1])]
    file = other_makers / REFERENCE / f"{model}.fmu"
    found = simulate(file, "--interface", "cs", *(times if "Stair" not in model else []))
    assert len(found["time"]) > 9
    for name in expected.keys() & found.keys():
        assert np.array_equal(found[name], expected[name]), name
    # Those of FMI 2.0 have no outputs of FMI 3.0's types.
    assert len(expected.keys() & found.keys()) > (5 if "Feedthrough" in model else 1)


def bouncing_ball(time: np.ndarray) -> dict[str, np.ndarray]:
    """A ball that falls from 1 m and keeps 0.7 of its speed, until that is below 0.1 m/s."""
    height, speed, begin = 1.0, 0.0, 0.0
    h, v = np.zeros_like(time), np.zeros_like(time)
    while height + speed > 0.0:
        until_ground = (speed + np.sqrt(speed**2 + 2 * 9.81 * height)) / 9.81
        since = time - begin
        flies = (since >= 0) & (since < until_ground)
        h[flies] = height + speed * since[flies] - 9.81 / 2 * since[flies] ** 2
        v[flies] = speed - 9.81 * since[flies]
        height, speed, begin = 0.0, -0.7 * (speed - 9.81 * until_ground), begin + until_ground
        if speed < 0.1:
            break
    return {"h": h, "v": v}


def van_der_pol(time: np.ndarray) -> dict[str, np.ndarray]:
    x0, x1 = solve_ivp(
        lambda _, x: [x[1], (1 - x[0] ** 2) * x[1] - x[0]],
        (0, time[-1]),
        [2, 0],
        method="DOP853",
        t_eval=time,
        rtol=1e-12,
        atol=1e-12,
    ).y
    return {"x0": x0, "x1": x1}


SOLUTIONS: dict[str, Callable[[np.ndarray], dict[str, np.ndarray]]] = {
    "BouncingBall": bouncing_ball,
    "Dahlquist": lambda time: {"x": np.exp(-time)},
    "Feedthrough": lambda time: {"Float64_continuous_output": 0 * time, "Enumeration_output": 1 + 0 * time},
    "Stair": lambda time: {"counter": 1 + np.floor(time)},
    # The identity matrix.
    "StateSpace": lambda time: {f"y[{row}]": row * np.exp(time) for row in (1, 2, 3)},
    "VanDerPol": van_der_pol,
}


IN_HUNDRED_STEPS = f"--interface me --tolerance {TOLERANCE!r} --stop-time 3 --step 0.03".split()


@pytest.mark.parametrize("model", REFERENCE_FMUS)
def test_reference_fmus_are_solved_by_model_exchange(
    other_makers: Path, simulate: Simulate, model: str
) -> None:
    """With directional derivatives, state events and time events."""
    file = other_makers / REFERENCE / f"{model}.fmu"
    found = simulate(file, *IN_HUNDRED_STEPS, "--no-events")
    time = found["time"]
    expected = SOLUTIONS[model.split("/")[1]](time)
    for name, column in expected.items():
        # A step's error is below the tolerance, relative to a state and 1; the errors of 100 steps add up. A
        # bounce of the ball keeps the errors of time and speed, and there its speed may be either one.
        error = np.abs(found[name] - column) / (1 + np.abs(column))
        assert error.max() < 100 * TOLERANCE, (name, time[error.argmax()])


@pytest.mark.parametrize("version", [2, 3])
def test_texts_are_recorded(other_makers: Path, tmp_path: Path, version: int) -> None:
    file, out = other_makers / REFERENCE / f"fmi{version}" / "Feedthrough.fmu", tmp_path / "out.csv"
    text = 'Größe, "groß"'
    arguments = ["--set", f"String_input={text}", "--record", "Strin*_output", "--stop-time", "1"]
    assert simulate_of_cargo(file, *arguments, "--step", "0.5", "--out", out).returncode == 0
    names, *rows = csv.reader(csv_lines(out))
    assert names == ["time", "String_output"]
    assert [row[1] for row in rows] == [text] * 3


@pytest.mark.parametrize("model", ["BouncingBall", "Stair"])
@pytest.mark.parametrize("version", [2, 3])
def test_events_of_reference_fmus_are_recorded_as_fmpy_does(
    other_makers: Path, simulate: Simulate, version: int, model: str
) -> None:
    """Row by row: before and after state events, and time events at communication points and between."""
    file = other_makers / REFERENCE / f"fmi{version}" / f"{model}.fmu"
    found = simulate(file, *IN_HUNDRED_STEPS)
    expected = simulate_fmu(
        file,
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=TOLERANCE,
        stop_time=3.0,
        step_size=0.03,
        output_interval=0.03,
        record_events=True,
    )
    assert len(expected) > 101
    for name in expected.dtype.names:
        # 1000 times both tolerances: CVode's errors add up over its steps.
        assert np.allclose(found[name], expected[name], rtol=1000 * TOLERANCE, atol=1000 * TOLERANCE), name


@pytest.mark.parametrize("model", ["BouncingBall", "Stair"])
def test_events_of_co_simulation_are_recorded_as_fmpy_does(
    other_makers: Path, simulate: Simulate, model: str
) -> None:
    """Row by row, to the last bit: both call the same code at the same times, as the FMU returns early from a
    step for each event. Without Event Mode it tells none."""
    file = other_makers / REFERENCE / "fmi3" / f"{model}.fmu"
    step = 0.2 if model == "Stair" else 0.01
    arguments = [file, "--step", repr(step), "--stop-time", "3"]
    found = simulate(*arguments, "--event-mode")
    expected = simulate_fmu(
        file,
        fmi_type="CoSimulation",
        stop_time=3.0,
        output_interval=step,
        set_stop_time=False,
        use_event_mode=True,
        early_return_allowed=True,
    )
    points = round(3 / step) + 1
    assert len(expected) > points + 2
    for name in expected.dtype.names:
        assert np.array_equal(found[name], expected[name]), name
    assert len(simulate(*arguments)["time"]) == points


@pytest.mark.parametrize("model", ["MassSpringSystem", "Mass_Damper", "ramp"])
def test_open_modelica_is_solved_by_model_exchange(
    other_makers: Path, simulate: Simulate, model: str
) -> None:
    """As FMPy solves it with CVode."""
    file = other_makers / OPEN_MODELICA / "linux" / f"{model}.fmu"
    found = simulate(file, "--interface", "me", "--tolerance", "1e-9", "--stop-time", "2", "--step", "0.02")
    expected = simulate_fmu(
        file,
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=1e-9,
        stop_time=2.0,
        step_size=0.02,
        output_interval=0.02,
    )
    names = expected.dtype.names[1:]
    assert names
    assert any(np.ptp(expected[name]) > 0.1 for name in names)
    for name in names:
        # FMPy records an event's time twice.
        column = np.interp(found["time"], expected["time"], expected[name])
        # 1000 times both tolerances: CVode's errors add up over its steps.
        assert np.allclose(found[name], column, rtol=1e-6, atol=1e-6), name


@pytest.mark.parametrize(
    "file",
    [f"{REFERENCE}/{model}" for model in REFERENCE_FMUS if not model.endswith("StateSpace")]
    + [f"{OPEN_MODELICA}/linux/{model}" for model in ["add", "MassSpringSubSystem1", "MassSpringSubSystem2"]]
    + [f"{OPEN_MODELICA}/linux/{model}" for model in ["MassSpringSystem", "ramp"]],
)
def test_model_exchange_agrees_with_fmpy(other_makers: Path, tmp_path: Path, file: str) -> None:
    """Within 1e-9, where both solve to 1e-12: a thousand times that, as in the tests above."""
    step = 0.5 if "Stair" in file else 0.1
    fmu = other_makers / f"{file}.fmu"
    assert largest_difference(fmu, tmp_path, step=step, tolerance=1e-12) < 1e-9


def test_a_system_of_open_modelica_is_linearized_by_differences(other_makers: Path, tmp_path: Path) -> None:
    """Two masses of 1 kg between three springs of 1 N/m move at 1 rad/s together and at sqrt(3) rad/s against
    each other. The FMU has no directional derivatives."""
    file, out = other_makers / OPEN_MODELICA / "linux" / "MassSpringSystem.fmu", tmp_path / "linear.json"
    subprocess.run([TARGET / "debug" / "cargo-fmu", "linearize", file, "--out", out], check=True)
    [fmu] = json.loads(out.read_text())["fmus"]
    assert not fmu["is_exact"]
    fast = 3**0.5
    # Differences of linear equations have no error but rounding: 1e-16 over steps of 6e-6.
    assert np.array(fmu["poles"]) == pytest.approx(
        np.array([[0, -1], [0, 1], [0, -fast], [0, fast]]), abs=1e-9
    )


def test_python_fmu_3_runs_with_its_library(other_makers: Path, simulate: Simulate) -> None:
    """Its output grows by its step's number.

    At the end of the process PythonFMU3 counts down in a block it has freed. The allocator's cache keeps
    such a block, and the count does no harm there.
    """
    libraries = sysconfig.get_config_vars("LIBDIR", "INSTSONAME")
    environment = {
        "LD_PRELOAD": "/".join(libraries),
        "PYTHONPATH": sysconfig.get_path("purelib"),
        "GLIBC_TUNABLES": "glibc.malloc.tcache_count=65535",
    }
    file = other_makers / OPEN_MODELICA / "linux" / "FMU3Model.fmu"
    found = simulate(file, "--stop-time", "3", "--step", "1", **environment)
    assert found["output"].tolist() == [3, 4, 5, 6]


@pytest.mark.parametrize(
    ("file", "arguments", "reason"),
    [
        (f"{MODESTPY}/Simple2R1C_linux64.fmu", [], "its library cannot be loaded: "),
        (f"{MODESTPY}/Simple2R1C_win64.fmu", [], "linux64/Simple2R1C.so: it is not for this platform"),
        (
            f"{OPEN_MODELICA}/linux/FMU3Model.fmu",
            ["--interface", "me"],
            "it is not for Model Exchange, only for co-simulation",
        ),
        (f"{OPEN_MODELICA}/linux/FMU3Model.fmu", [], "FMUs of PythonFMU expect Python's library"),
    ],
)
def test_what_cannot_run_is_refused_with_the_reason(
    other_makers: Path, file: str, arguments: list[str], reason: str
) -> None:
    done = simulate_of_cargo(other_makers / file, "--stop-time", "1", *arguments)
    assert done.returncode == 2
    assert reason in done.stderr
