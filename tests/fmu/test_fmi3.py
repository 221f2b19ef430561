"""Both FMUs as FMI 3.0: valid, and in co-simulation with the results of FMI 2.0, to the last bit."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy import __file__ as fmpy_file
from fmpy.validation import validate_fmu

from fmu import ROOT, TARGET, Run, documents, test_masters
from fmu.experiments import BOOST_STEPS, BOOST_STEPS_END, SCENARIOS, couple, staircase
from fmu.master import Fmu, Instance, Master, Reals, Value
from fmu.recorded import INPUTS, OUTPUTS, STATES, STEP, Recording

New = Callable[[Fmu], Instance]
Exports = dict[tuple[str, int], Fmu]
"""FMUs by their names and versions."""

NAMES = ["BoostPlant", "BoostController"]
BOTH = pytest.mark.parametrize("name", NAMES)
VERSIONS = {2: TARGET / "both", 3: TARGET / "both" / "fmi3"}


@pytest.fixture(scope="module")
def exports(tmp_path_factory: pytest.TempPathFactory) -> Exports:
    """Both FMUs in both versions of FMI, extracted."""

    def extracted(name: str, version: int) -> Fmu:
        path = VERSIONS[version] / f"{name}.fmu"
        assert path.is_file(), f"{path} is missing: bash tests/run rest exports it"
        return Fmu(path, tmp_path_factory.mktemp(f"{name}{version}"))

    return {(name, version): extracted(name, version) for name in NAMES for version in VERSIONS}


@BOTH
def test_fmpy_finds_no_problem(exports: Exports, name: str) -> None:
    assert validate_fmu(exports[name, 3].path) == []


@BOTH
def test_terminals_and_variables_are_those_of_fmi_2(exports: Exports, name: str) -> None:
    """All but elements of arrays, with the same value references."""
    terminals = "terminalsAndIcons/terminalsAndIcons.xml"
    of_fmi2, of_fmi3 = ((exports[name, version].folder / terminals).read_bytes() for version in VERSIONS)
    assert of_fmi3 == of_fmi2
    of_fmi2, of_fmi3 = (
        {
            variable: (declared.valueReference, declared.causality, declared.variability, declared.unit)
            for variable, declared in exports[name, version].variables.items()
        }
        for version in VERSIONS
    )
    elements = of_fmi2.keys() - of_fmi3.keys()
    assert all(
        of_fmi3[variable] == declared for variable, declared in of_fmi2.items() if variable not in elements
    )
    assert of_fmi3.keys() - of_fmi2.keys() == {element.partition("[")[0] for element in elements}


@BOTH
def test_icons_are_in_their_folder(exports: Exports, name: str) -> None:
    """FMI 3.0.2, section 2.5.1: a PNG, and the drawing that it was made from."""
    folder = exports[name, 3].folder
    source = ROOT / "modelDescription" / "icons" / name.removeprefix("Boost").lower()
    for kind in ("png", "svg"):
        found = (folder / "terminalsAndIcons" / f"icon.{kind}").read_bytes()
        assert found == source.with_suffix(f".{kind}").read_bytes()
    assert not (folder / "model.png").exists()


@BOTH
def test_library_defines_the_standards_functions_only(exports: Exports, name: str) -> None:
    header = (Path(fmpy_file).parent / "c-code" / "fmi3Functions.h").read_text()
    functions = re.findall(r"^FMI3_Export \w+ +(\w+);", header, re.MULTILINE)
    command = ["nm", "-D", "--defined-only", exports[name, 3].library]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert len(functions) == 75
    assert sorted(line.split()[-1] for line in lines) == sorted(functions)


@BOTH
def test_library_is_not_much_larger_than_that_of_fmi_2(exports: Exports, name: str) -> None:
    """It has 75 functions instead of 44, over the same variables: an array is one in both. The plant's
    equations are compiled once more, for adjoint derivatives."""
    of_fmi2, of_fmi3 = (exports[name, version].library.stat().st_size for version in VERSIONS)
    print(f"\n{name}: FMI 2.0 {of_fmi2 / 1e3:.0f} kB, FMI 3.0 {of_fmi3 / 1e3:.0f} kB", end="")
    assert of_fmi3 < (1.6 if name == "BoostPlant" else 1.3) * of_fmi2


def equal(found: np.ndarray, expected: np.ndarray) -> bool:
    """Whether numbers are the same 64-bit patterns."""
    return bool((found.view(np.uint64) == expected.view(np.uint64)).all())


def test_fig_13_is_that_of_fmi_2(make: New, exports: Exports) -> None:
    """The closed loop of two FMUs of FMI 3.0, and of one of each version: all outputs of both after each
    step."""
    inputs = {"boost_reference": staircase(*BOOST_STEPS)}

    def outputs(plant: int, controller: int) -> np.ndarray:
        instances = [
            make(exports[name, version]) for name, version in zip(NAMES, (plant, controller), strict=True)
        ]
        record = couple(*instances, inputs=inputs).run(BOOST_STEPS_END)
        return np.stack(list(record.values()), axis=1)

    expected = outputs(2, 2)
    assert expected.shape == (124 * 80 + 1, 1 + 20)
    assert (np.ptp(expected, axis=0) > 0).sum() > 15, "most of them move"
    for plant, controller in ((3, 3), (3, 2), (2, 3)):
        assert equal(outputs(plant, controller), expected), f"plant {plant}, controller {controller}"


def test_the_recorded_experiment_is_that_of_fmi_2(make: New, exports: Exports) -> None:
    """Every number of the plant after each interval, arrays apart."""
    recording = Recording.read()
    plants = [make(exports["BoostPlant", version]) for version in VERSIONS]
    names = [
        name
        for name, variable in exports["BoostPlant", 3].variables.items()
        if variable.type == "Float64"
        and not variable.dimensions
        and name in exports["BoostPlant", 2].variables
    ]
    assert {*STATES, *OUTPUTS, *exports["BoostPlant", 2].named("output")} < set(names)
    for plant in plants:
        recording.begin(plant)
    numbers = [Reals(plant, names) for plant in plants]
    driven = [Reals(plant, INPUTS) for plant in plants]
    for index, inputs in enumerate(recording.inputs):
        for plant, reals in zip(plants, driven, strict=True):
            reals.set(inputs)
            plant.slave.doStep(index * STEP, STEP)
        assert equal(*(reals.get() for reals in numbers)), f"after interval {index}"


def test_parameters_and_arrays(make: New, exports: Exports) -> None:
    """Values that importers set: an array's are those that FMI 2.0 has as single variables."""
    scale = np.linspace(0.9, 1.1, 16 * 7)
    outputs = []
    for version in VERSIONS:
        fmu = exports["BoostController", version]
        controller = make(fmu)
        values: dict[str, Value] = {"strategy": "by_speed", "compensate_voltage": False, "lambda": 0.2}
        feedforward = [
            f"schedule.feedforward[{row + 1},{column + 1}]" for row in range(16) for column in range(7)
        ]
        if version == 2:
            table = np.array([float(fmu.variables[name].start) for name in feedforward])
            values |= dict(zip(feedforward, map(float, scale * table), strict=True))
        else:
            array = fmu.variables["schedule.feedforward"]
            assert [dimension.start for dimension in array.dimensions] == [16, 7]
            controller.slave.setFloat64(
                [array.valueReference], list(scale * np.array(array.start.split(), float))
            )
        outputs.append(drive(controller.start(values)))
    assert equal(*outputs)


def drive(controller: Instance) -> np.ndarray:
    """Steps with changing inputs; all outputs after each step."""
    inputs = Reals(controller, ["engine_speed", "boost_reference", "boost_pressure"])
    outputs = Reals(controller, controller.fmu.named("output"))
    result = []
    for index in range(100):
        inputs.set([1500.0 + 10.0 * index, 150e3, 120e3 + 300.0 * index])
        controller.slave.doStep(index * STEP, STEP)
        result.append(outputs.get().copy())
    return np.array(result)


def test_a_tool_connects_the_terminals_in_one_stroke(make: New, exports: Exports, tmp_path: Path) -> None:
    """fmucontainer packs both into an FMU; its only link is that of the terminals. Both versions couple at
    will."""
    given = {
        "engine_speed": 1500.0,
        "boostplant.engine_speed": 1500.0,
        "boost_reference": 150e3,
        "supply_voltage": 12.0,
        "throttle": 1.0,
        "boostplant.ambient_pressure": 101325.0,
        "boostplant.ambient_temperature": 298.0,
    }
    records = {}
    for plant, controller in ((2, 2), (3, 3), (3, 2), (2, 3)):
        folder = tmp_path / f"{plant}{controller}"
        folder.mkdir()
        for name, version in zip(NAMES, (plant, controller), strict=True):
            (folder / f"{name}.fmu").symlink_to(exports[name, version].path)
        (folder / "boost.csv").write_text(
            "rule;from_fmu;from_port;to_fmu;to_port\n"
            "FMU;BoostController.fmu;;;\n"
            "FMU;BoostPlant.fmu;;;\n"
            "LINK;BoostController.fmu;boost;BoostPlant.fmu;boost\n"
        )
        command = [
            Path(sys.executable).with_name("fmucontainer"),
            "-container",
            f"boost.csv:{STEP}",
            "-no-auto-link",
        ]
        done = subprocess.run(
            [*command, "-sequential", "-fmu-directory", folder], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        container = Fmu(folder / "boost.fmu", folder / "container")
        inputs = set(container.named("input"))
        assert given.keys() <= inputs
        assert not inputs & {"boost_pressure", "hp_wastegate_pwm", "boostplant.hp_wastegate_pwm"}
        records[plant, controller] = record = Master([make(container).start(given)], STEP).run(10.0)
        # With the throttle open it is the boost pressure less the throttle's losses.
        assert (
            0.9 * given["boost_reference"] < record["intake_manifold_pressure"][-1] < given["boost_reference"]
        )
    for versions, record in records.items():
        for name, column in record.items():
            assert equal(column, records[2, 2][name]), (versions, name)


@pytest.mark.parametrize("versions", [(3, 3), (3, 2), (2, 3)], ids=str)
def test_ecos_couples_both_versions(
    make: New, exports: Exports, tmp_path: Path, versions: tuple[int, int]
) -> None:
    """Boost pressure and duty after each step of Fig. 13 are those of the tests' master with the same order
    of steps."""
    folder = tmp_path / "fmus"
    folder.mkdir()
    for name, version in zip(NAMES, versions, strict=True):
        (folder / f"{name}.fmu").symlink_to(exports[name, version].path)
    clone = documents.clone(folder, tmp_path / "clone")
    (clone / "run.py").write_text(test_masters.RUN)
    documents.run("python run.py examples/masters/with_ecos.py rows.json", clone, **test_masters.LIBRARIES)
    rows = np.array(json.loads((clone / "rows.json").read_text()))

    instances = [make(exports[name, version]) for name, version in zip(NAMES, versions, strict=True)]
    record = test_masters.both_at_once(*instances).run(BOOST_STEPS_END)
    expected = np.stack([record["boost_pressure"][1:], record["hp_wastegate_pwm"][1:]], axis=1)
    assert rows.shape == expected.shape
    assert equal(rows, expected)


FIGURE_13 = SCENARIOS / "figure_13.toml"


def test_cargo_fmu_couples_both_versions(cargo_fmu: Run, exports: Exports, tmp_path: Path) -> None:
    """Fig. 13 by `simulate`: the same record, byte by byte, whatever versions plant and controller have."""
    records = {}
    for plant, controller in ((2, 2), (3, 3), (3, 2), (2, 3)):
        fmus = [
            f"--fmu={name}={exports[model, version].path}"
            for name, model, version in (("plant", NAMES[0], plant), ("controller", NAMES[1], controller))
        ]
        out = tmp_path / f"{plant}{controller}.csv"
        done = cargo_fmu("simulate", FIGURE_13, *fmus, "--out", out)
        assert done.returncode == 0, done.stderr
        records[plant, controller] = out.read_bytes()
    assert len(records[2, 2].splitlines()) > 124 * 80
    for versions, record in records.items():
        assert record == records[2, 2], versions


def test_check_and_ssp_take_both_versions(
    boost_fmu: Run, cargo_fmu: Run, exports: Exports, tmp_path: Path
) -> None:
    """A system of both has the same results, byte by byte; its structure differs in nothing."""
    systems = {}
    for versions in ((2, 2), (3, 3), (3, 2)):
        paths = [exports[name, version].path for name, version in zip(NAMES, versions, strict=True)]
        for role, path in zip(("plant", "controller"), paths, strict=True):
            done = boost_fmu("check", path, "--as", role, folder=tmp_path)
            assert done.returncode == 0, done.stdout
        out = tmp_path / f"{versions[0]}{versions[1]}.ssp"
        done = boost_fmu("ssp", "--plant", paths[0], "--controller", paths[1], "--out", out, folder=tmp_path)
        assert done.returncode == 0, done.stderr
        done = cargo_fmu("simulate", out, "--out", out.with_suffix(".csv"))
        assert done.returncode == 0, done.stderr
        with zipfile.ZipFile(out) as archive:
            structure = archive.read("SystemStructure.ssd")
            assert archive.read("resources/BoostPlant.fmu") == paths[0].read_bytes()
        systems[versions] = structure, out.with_suffix(".csv").read_bytes()
    for versions, system in systems.items():
        assert system == systems[2, 2], versions
    # Each export writes its own.
    for version, folder in ((2, TARGET / "both"), (3, TARGET / "both" / "fmi3")):
        written = tmp_path / f"{version}{version}.ssp"
        assert (folder / "Boost.ssp").read_bytes() == written.read_bytes()
