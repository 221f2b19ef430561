"""The libraries that FMPy compiles of the FMUs' sources compute what the native ones do, to the last bit, and
take the states that those serialize."""

from __future__ import annotations

import zipfile
from collections.abc import Callable

import numpy as np
import pytest
from conftest import TARGET
from experiments import BOOST_STEPS, BOOST_STEPS_END, couple_running, scenario, staircase
from master import Fmu, Instance, Master, Reals
from recorded import INPUTS, OUTPUTS, STATES, STEP, Recording

NAMES = ["BoostPlant", "BoostController"]

LARGEST = 1_000_000
"""Bytes of a file of the sources."""


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Fmu]:
    """The FMUs with the libraries of their sources, extracted."""
    folder = TARGET / "compiled" / "fmu"
    assert folder.is_dir(), f"{folder} is missing: bash tests/run rest compiles them"
    return {name: Fmu(folder / f"{name}.fmu", tmp_path_factory.mktemp(name)) for name in NAMES}


Make = Callable[[Fmu], Instance]


def runs(make: Make, fmus: dict[str, Fmu], name: str, signal: str, end: float) -> np.ndarray:
    """All outputs in the experiment of a figure that changes one signal."""
    steps = BOOST_STEPS if name == "figure_13" else scenario(name)["inputs"][signal]["steps"]
    instances = [make(fmus[model]) for model in NAMES]
    record = couple_running(*instances, inputs={signal: staircase(*steps)}).run(end)
    return np.stack(list(record.values()))


@pytest.mark.parametrize(
    ("name", "signal", "end"),
    [("figure_13", "boost_reference", BOOST_STEPS_END), ("figure_14", "supply_voltage", 42.0)],
)
def test_figures(
    make: Make, fmus: dict[str, Fmu], compiled: dict[str, Fmu], name: str, signal: str, end: float
):
    native, sources = (runs(make, which, name, signal, end) for which in (fmus, compiled))
    assert native.shape == sources.shape == (1 + 20, round(end * 80) + 1)
    assert (native.view(np.uint64) == sources.view(np.uint64)).all()


def test_the_recorded_experiment(make: Make, fmus: dict[str, Fmu], compiled: dict[str, Fmu]) -> None:
    recording = Recording.read()

    def values(fmu: Fmu) -> np.ndarray:
        plant = make(fmu)
        recording.begin(plant)
        inputs, values = Reals(plant, INPUTS), Reals(plant, [*STATES, *OUTPUTS])
        rows = []
        for number, row in enumerate(recording.inputs):
            inputs.set(row)
            plant.slave.doStep(number * STEP, STEP)
            rows.append(values.get().copy())
        return np.array(rows)

    native, sources = values(fmus["BoostPlant"]), values(compiled["BoostPlant"])
    assert native.shape == recording.states_and_outputs.shape
    assert (native.view(np.uint64) == sources.view(np.uint64)).all()


@pytest.mark.parametrize("name", NAMES)
def test_states_pass_from_one_library_to_the_other(
    make: Make, fmus: dict[str, Fmu], compiled: dict[str, Fmu], name: str
) -> None:
    """The bytes are the same, and either continues from them as the other does."""
    saved, went_on = [], []
    libraries = [fmus[name], compiled[name]]
    for fmu in libraries:
        instance = make(fmu).start({})
        master = Master([instance], STEP, clock=lambda step: step * STEP)
        master.run(1.0)
        state = instance.slave.getFMUstate()
        saved.append(instance.slave.serializeFMUstate(state))
        instance.slave.freeFMUstate(state)
        went_on.append(np.stack(list(master.run(2.0).values())))
    assert saved[0] == saved[1]
    assert (went_on[0] == went_on[1]).all()
    for fmu, bytes_of_the_other in zip(libraries, reversed(saved), strict=True):
        instance = make(fmu).start({})
        state = instance.slave.deSerializeFMUstate(bytes_of_the_other)
        instance.slave.setFMUstate(state)
        instance.slave.freeFMUstate(state)
        record = Master([instance], STEP, clock=lambda step: (80 + step) * STEP).run(2.0)
        assert (np.stack(list(record.values())) == went_on[0]).all()


@pytest.mark.parametrize("name", NAMES)
def test_files_are_of_bearable_length(name: str) -> None:
    with zipfile.ZipFile(TARGET / "sources" / "fmu" / f"{name}.fmu") as archive:
        files = {file.filename: file.file_size for file in archive.infolist()}
    sources = {file: size for file, size in files.items() if file.startswith("sources/")}
    assert {"sources/fmi2.c", "sources/README.txt"} <= set(sources)
    assert max(sources.values()) <= LARGEST
    assert any(file.startswith("binaries/") for file in files)
