"""The plant in Model Exchange: which settings of FMPy run, and with which error.

    PYTHONPATH=tests target/venv/bin/python -m fmu.solver_settings

runs a step of the duty that drives the rod against its stop with each setting, and writes the tables into
docs/masters.md. The reference is the FMU in co-simulation, at the least tolerance that it takes.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from ctypes import c_double
from pathlib import Path
from typing import NamedTuple

import numpy as np
from fmpy import simulate_fmu
from scipy.integrate import BDF, Radau

from fmu import ROOT, TARGET
from fmu.exchange import Exchange
from fmu.master import Fmu
from fmu.recorded import KINKS, OUTPUTS, Stopping

PAGE = ROOT / "docs" / "masters.md"
BEGIN = "<!-- The tables of tests/fmu/solver_settings.py begin here. -->\n"
END = "<!-- They end here. -->\n"

STEP, STOP = 3.0, 5.0
"""When the duty steps, and the end, in s."""
DUTIES = 60.0, 80.0
"""In %: the higher one opens the wastegate to its stop."""
TIGHT = 1e-8


class Setting(NamedTuple):
    """What FMPy is told."""

    solver: str
    tolerance: float | None
    interval: float
    """Between outputs, in s."""

    def __str__(self) -> str:
        tolerance = "" if self.tolerance is None else f"{self.tolerance:g}"
        return f"{self.solver} | {tolerance} | {self.interval:g} s"


SETTINGS = [
    *(Setting("CVode", tolerance, 0.1) for tolerance in (1e-4, 1e-6, 1e-8)),
    *(Setting("CVode", tolerance, 0.0125) for tolerance in (1e-4, 1e-6, 1e-8)),
    *(Setting("Euler", None, interval) for interval in (0.0125, 1e-3, 1e-4)),
]


def simulate(fmu: Fmu, interface: str, setting: Setting) -> np.ndarray:
    """The outputs each 0.1 s, in percent of full scale."""
    names = fmu.named("input")
    inputs = np.zeros(4, dtype=[("time", float), *((name, float) for name in names)])
    for name in names:
        inputs[name] = float(fmu.variables[name].start)
    # Two rows at one time are a jump, which FMPy makes an event.
    inputs["time"] = 0.0, STEP, STEP, STOP
    inputs["hp_wastegate_pwm"] = np.repeat(DUTIES, 2)
    outputs = {name: OUTPUTS[name] for name in fmu.named("output") if name in OUTPUTS}
    result = simulate_fmu(
        fmu.folder,
        model_description=fmu.description,
        fmi_type=interface,
        solver=setting.solver,
        relative_tolerance=setting.tolerance,
        output_interval=setting.interval,
        step_size=setting.interval,
        stop_time=STOP,
        input=inputs,
        output=list(outputs),
    )
    times = np.arange(1, round(10 * STOP) + 1) / 10
    rows = np.abs(result["time"] - times[:, None]).argmin(axis=1)
    assert np.abs(result["time"][rows] - times).max() < 1e-9
    return np.array([100.0 * result[name][rows] / scale for name, scale in outputs.items()])


def outcome(fmu: Fmu, setting: Setting, expected: np.ndarray) -> float | str:
    """The largest error in percent of full scale, or how it fails."""
    try:
        found = simulate(fmu, "ModelExchange", setting)
    except RuntimeError as error:  # Of CVode.
        time = float(re.search(r"At t = (\S+), mxstep steps taken", str(error))[1])
        return f"fails at {time:.0f} s, where 500 steps are used up"
    except Exception as error:  # Of FMPy, in no class of its own.
        if "fmi2GetDerivatives failed with status 2 (discard)" not in str(error):
            raise
        return "fails: the states leave the model's range"
    return float(np.abs(found - expected).max())


def outcomes(fmu: Fmu) -> dict[str, float | str]:
    """What each setting gives."""
    expected = simulate(fmu, "CoSimulation", Setting("", TIGHT, 0.0125))
    return {str(setting): outcome(fmu, setting, expected) for setting in SETTINGS}


def after_the_step(fmu: Fmu, kinks: str) -> Exchange:
    """The plant just after the step of the duty, with a solver that stops at kinks of the equations."""
    plant = Stopping(fmu, TIGHT, KINKS[kinks])
    plant.begin({"hp_wastegate_pwm": DUTIES[0]})
    plant.slave.exitInitializationMode()
    plant.go().advance(STEP)
    plant.event(lambda: plant.set({"hp_wastegate_pwm": DUTIES[1]}))
    plant.calls["derivatives"] = 0
    return plant


def by_cvode(plant: Exchange, end: float) -> None:
    """Integrates to a time with FMPy's CVode."""
    plant.advance(end)


def by_scipy(method: Callable) -> Callable[[Exchange, float], None]:
    """Integrates to a time with a solver of SciPy, with CVode's tolerances."""

    def integrate(plant: Exchange, end: float) -> None:
        solver, size = plant.solver, plant.states
        buffer = (c_double * size)()

        def derivatives(time: float, states: np.ndarray) -> np.ndarray:
            plant.slave.setTime(time)
            buffer[:] = states.tolist()
            solver.set_x(buffer, size)
            solver.get_dx(buffer, size)
            return np.array(buffer)

        solver.get_x(buffer, size)
        states = np.array(buffer)
        solver.get_nominals(buffer, size)
        scipy = method(derivatives, plant.time, states, end, rtol=TIGHT, atol=TIGHT * np.array(buffer))
        while scipy.status == "running":
            scipy.step()
        assert scipy.status == "finished"

    return integrate


SOLVERS: dict[str, tuple[str, Callable[[Exchange, float], None]]] = {
    "CVode": ("none", by_cvode),
    "CVode, stopped at each kink": ("all", by_cvode),
    "SciPy's BDF": ("none", by_scipy(BDF)),
    "SciPy's Radau": ("none", by_scipy(Radau)),
}
"""At which kinks they stop, and how they integrate."""


def evaluations(fmu: Fmu) -> dict[str, int]:
    """How often solvers evaluate the derivatives in the 0.1 s after the step, also for Jacobians."""
    counts = {}
    for name, (kinks, integrate) in SOLVERS.items():
        plant = after_the_step(fmu, kinks)
        integrate(plant, STEP + 0.1)
        counts[name] = plant.calls["derivatives"]
        plant.free()
    return counts


def tables(fmu: Fmu) -> str:
    """Both tables in Markdown."""
    errors = {
        setting: found if isinstance(found, str) else f"{found:.1g} %"
        for setting, found in outcomes(fmu).items()
    }
    both = {
        "| solver | tolerance | output interval | error, of full scale |\n|---|---|---|---|\n": errors,
        f"| at the tolerance {TIGHT:g} | evaluations |\n|---|---|\n": evaluations(fmu),
    }
    return "\n".join(
        header + "".join(f"| {name} | {value} |\n" for name, value in table.items())
        for header, table in both.items()
    )


def documented() -> dict[str, str]:
    """The last column of the page's tables, by what stands before it."""
    text = PAGE.read_text().split(BEGIN)[1].split(END)[0]
    rows = (line.strip("| ").rpartition(" | ") for line in text.splitlines() if line)
    return {name: value for name, _, value in rows}


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        text = tables(Fmu(TARGET / "both" / "BoostPlant.fmu", Path(folder)))
    before, rest = PAGE.read_text().split(BEGIN)
    _, after = rest.split(END)
    PAGE.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}")
