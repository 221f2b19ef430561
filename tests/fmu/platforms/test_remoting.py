"""The library for Windows in FMPy, which runs it in Wine and is coupled with the one for Linux."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import subprocess
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from fmpy.util import add_remoting

from fmu.experiments import BOOST_STEPS, BOOST_STEPS_END, couple, staircase
from fmu.master import Fmu, Instance, Record
from fmu.platforms import NAMES

pytestmark = pytest.mark.platforms


def run(fmus: dict[str, Fmu]) -> Record:
    """The experiment of fig. 13."""
    plant, controller = Instance(fmus["BoostPlant"]), Instance(fmus["BoostController"])
    try:
        inputs = {"boost_reference": staircase(*BOOST_STEPS)}
        return couple(plant, controller, inputs=inputs).run(BOOST_STEPS_END)
    finally:
        plant.free()
        controller.free()


def run_apart(fmus: dict[str, Fmu]) -> Record:
    """The same in a separate process: FMPy's client serves one instance in a process."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=1, mp_context=context) as executor:
        return executor.submit(run, fmus).result(timeout=300)


@pytest.mark.parametrize("remote", NAMES)
def test_fmpy_gets_the_same_numbers_from_windows(
    exported: Path,
    fmus: dict[str, Fmu],
    folder: Path,
    wine: Path,
    remote: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One of the two in Wine: its server has a fixed port, so there is one at a time."""
    monkeypatch.setenv("PATH", f"{wine}:{os.environ['PATH']}")
    fmu = Fmu(exported / f"{remote}.fmu", folder / f"{remote}-remote")
    # FMPy uses the server only without a library for the host.
    shutil.rmtree(fmu.folder / "binaries" / "linux64")
    add_remoting(fmu.folder, "linux64", "win64")
    expected = run_apart(fmus)
    record = run_apart({**fmus, remote: fmu})
    # Frees the port for the next one.
    subprocess.run([wine / "wineserver", "--wait"], check=True, timeout=60)
    assert len(record["time"]) == len(expected["time"])
    for name, column in expected.items():
        assert np.array_equal(record[name], column), name
