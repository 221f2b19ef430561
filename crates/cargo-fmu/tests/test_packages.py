"""`cargo fmu new` and `export`: what is written exports, and runs as its README says, in folders with spaces,
alone and in a workspace."""

import contextlib
import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import fmpy
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssv
from fmpy.validation import validate_fmu

REPOSITORY = Path(__file__).parents[3]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", REPOSITORY / "target"))
# Where cargo finds `cargo fmu`, and the shell `fmpy`.
PROGRAMS = [TARGET / "debug", Path(sys.executable).parent]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("first FMUs")


def run(folder, *command, **variables):
    """What a command prints in a folder."""
    environment = {**os.environ, "PATH": os.pathsep.join([*map(str, PROGRAMS), os.environ["PATH"]])}
    environment.pop("CARGO_TARGET_DIR", None)
    environment |= {name: str(value) for name, value in variables.items()}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def lag(folder):
    """A package of its own, made and exported as its README says."""
    run(folder, "cargo", "fmu", "new", "lag", "--vcs", "none")
    package = folder / "lag"
    (block,) = re.findall(r"```console\n(.*?)```", (package / "README.md").read_text(), re.DOTALL)
    # There is no display: the same line writes a file.
    assert "--show-plot" in block
    run(package, "bash", "-e", "-c", block.replace("--show-plot", "--output-file result.csv"))
    return package


def test_the_lines_of_the_readme_run(lag):
    header, *_, last = (lag / "result.csv").read_text().splitlines()
    assert header == '"time","voltage","lagged_voltage"'
    # 5 s are ten time constants of a step by 1 V: 4.5e-5 are left.
    assert float(last.split(",")[2]) == pytest.approx(1.0, abs=1e-4)


def lines_of(package):
    """How many lines a package has that are not blank, without its tests."""
    files = ["Cargo.toml", "build.rs", "model.json", "src/lib.rs"]
    texts = [(package / file).read_text().split("#[cfg(test)]")[0] for file in files]
    return sum(bool(line.strip()) for text in texts for line in text.splitlines())


def test_the_package_is_complete(lag):
    fmu = lag / "target/fmu/lag.fmu"
    assert validate_fmu(fmu) == []
    assert "0 errors" in run(lag, "cargo", "fmu", "validate", str(fmu))
    manifest = (lag / "Cargo.toml").read_text()
    assert 'path = "' in manifest  # this repository's crates: nothing is published where this is tested
    assert lines_of(lag) <= 45


def test_equations_give_derivatives(lag):
    with instance(lag / "target/fmu/lag.fmu") as fmu:
        # d/dt of the lagged voltage is (voltage - lagged voltage)/0.5 s: value references in the order of declaration.
        assert fmu.getDirectionalDerivative([4], [1, 3], [1.0, 0.0]) == [2.0]
        assert fmu.getDirectionalDerivative([4], [1, 3], [0.0, 1.0]) == [-2.0]


def test_a_serialized_state_goes_on_to_the_same_bits(lag):
    def go_on(fmu, begin):
        for step in range(3):
            fmu.doStep(begin + step * 0.25, 0.25)
        return fmu.getReal([3])

    with instance(lag / "target/fmu/lag.fmu") as fmu, instance(lag / "target/fmu/lag.fmu") as other:
        fmu.doStep(0.0, 0.7)
        state = fmu.getFMUState()
        data = fmu.serializeFMUState(state)
        values = go_on(fmu, 0.7)
        fmu.setFMUState(state)
        assert go_on(fmu, 0.7) == values
        other.setFMUState(other.deSerializeFMUstate(data))
        assert go_on(other, 0.7) == values


@contextlib.contextmanager
def instance(file):
    """An instance of an FMU after its initialization."""
    folder = fmpy.extract(str(file))
    description = fmpy.read_model_description(folder)
    fmu = fmpy.instantiate_fmu(folder, description, "CoSimulation")
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    yield fmu
    fmu.freeInstance()
    shutil.rmtree(folder, ignore_errors=True)


VAN_DER_POL_VARIABLES = """{
  "default_experiment": {"stop_time": 20, "step_size": 0.1},
  "variables": [
    {"name": "mu", "causality": "parameter", "unit": "1", "start": 1},
    {"name": "x0", "causality": "output", "unit": "1", "start": 2, "derivative": {"unit": "1"}},
    {"name": "x1", "causality": "output", "unit": "1", "start": 0, "derivative": {"unit": "1"}}
  ]
}
"""
VAN_DER_POL = """
use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct VanDerPol);

impl Equations for VanDerPol {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, _time: T, variables: &mut Variables<T>) {
        let Variables { parameters, states, derivatives, .. } = variables;
        derivatives.x0 = states.x1;
        derivatives.x1 = parameters.mu * (-states.x0 * states.x0 + 1.0) * states.x1 - states.x0;
    }
}
"""


def test_van_der_pol_is_a_package_of_forty_lines(lag, folder):
    run(folder, "cargo", "fmu", "new", "van-der-pol", "--vcs", "none")
    package = folder / "van-der-pol"
    (package / "model.json").write_text(VAN_DER_POL_VARIABLES)
    (package / "src/lib.rs").write_text(VAN_DER_POL)
    assert lines_of(package) <= 40
    run(package, "cargo", "fmu", "export", CARGO_TARGET_DIR=lag / "target")
    fmu = lag / "target/fmu/van_der_pol.fmu"
    assert validate_fmu(fmu) == []
    # The solution at 20 s in solutions.csv of the integrator's tests; a hundred tolerances, as there.
    for tolerance in (1e-4, 1e-8):
        result = fmpy.simulate_fmu(fmu, relative_tolerance=tolerance)
        assert result["time"][-1] == pytest.approx(20.0)
        assert result["x0"][-1] == pytest.approx(2.008149762175, abs=300 * tolerance)
        assert result["x1"][-1] == pytest.approx(-0.0425088752731, abs=100 * tolerance)


def test_a_parameter_set_is_bound(lag):
    run(lag, "cargo", "fmu", "parameters", "target/fmu/lag.fmu")
    parameters = (lag / "lag.ssv").read_text()
    (lag / "lag.ssv").write_text(parameters.replace('value="0.5"', 'value="2"'))
    run(lag, "cargo", "fmu", "export", "--parameters", "lag.ssv")
    with ZipFile(lag / "target/fmu/lag.ssp") as package:
        (component,) = ElementTree.fromstring(package.read("SystemStructure.ssd")).findall(".//{*}Component")
        (binding,) = component.findall(".//{*}ParameterBinding")
        bound = ElementTree.fromstring(package.read(binding.attrib["source"]))
    (parameter,) = bound.findall(".//{*}Parameter")
    assert (parameter.attrib["name"], [float(value.attrib["value"]) for value in parameter]) == ("time_constant", [2.0])
    # FMPy leaves start values and bindings to its caller, and hands on an input after the first step, in which it is 0.
    parameter_set = read_ssv(lag / "lag.ssv")
    for parameter in parameter_set.parameters:
        parameter.name = f"lag_instance.{parameter.name}"
    result = simulate_ssp(
        lag / "target/fmu/lag.ssp",
        stop_time=2.05,
        step_size=0.1,
        parameter_set=parameter_set,
        input={"voltage": lambda time: 1.0},
    )
    # One time constant of 2 s; the step response of a lag, to the default tolerance in each of 20 steps.
    assert result["lagged_voltage"][-1] == pytest.approx(1 - math.exp(-1), abs=20e-6)


def interfaces_of(fmu):
    return [element.tag for element in read_description(fmu) if element.tag in ("ModelExchange", "CoSimulation")]


def read_description(fmu):
    with ZipFile(fmu) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


def test_the_interfaces_are_those_of_the_option_or_the_environment(lag):
    export = ["cargo", "fmu", "export", "--out", "faces"]
    fmu = lag / "faces/lag.fmu"
    for arguments, variables, expected in [
        (["--interfaces", "cs,me"], {}, ["ModelExchange", "CoSimulation"]),
        (["--interfaces", "me"], {"FMU_INTERFACES": "cs"}, ["ModelExchange"]),
        ([], {"FMU_INTERFACES": "me"}, ["ModelExchange"]),
        ([], {}, ["CoSimulation"]),
    ]:
        run(lag, *export, *arguments, **variables)
        assert interfaces_of(fmu) == expected
        assert "0 errors" in run(lag, "cargo", "fmu", "validate", str(fmu))
        shown = run(lag, "cargo", "fmu", "info", str(fmu))
        assert [line.split()[0] for line in shown.splitlines() if "modelIdentifier=" in line] == expected
        for interface in expected:
            result = fmpy.simulate_fmu(fmu, fmi_type=interface, stop_time=5, start_values={"voltage": 1.0})
            # 5 s are ten time constants of a step by 1 V: 4.5e-5 are left.
            assert result["lagged_voltage"][-1] == pytest.approx(1.0, abs=1e-4)
    refused = subprocess.run(
        [TARGET / "debug/cargo-fmu", "export"],
        cwd=lag,
        env={**os.environ, "FMU_INTERFACES": "both"},
        capture_output=True,
        text=True,
    )
    assert refused.returncode == 2
    assert "FMU_INTERFACES: 'both' is not one of cs, me and cs,me" in refused.stderr


def test_resources_are_packed(lag, folder):
    package = folder / "with resources"
    shutil.copytree(lag, package, ignore=shutil.ignore_patterns("target"))
    (package / "tables/curves").mkdir(parents=True)
    (package / "tables/notes.txt").write_text("made up")
    (package / "tables/curves/gain.csv").write_text("0,1\n")
    model = package / "model.json"
    model.write_text(model.read_text().replace("{", '{"resources": "tables",', 1))
    run(package, "cargo", "fmu", "export", CARGO_TARGET_DIR=lag / "target")
    with ZipFile(lag / "target/fmu/lag.fmu") as archive:
        assert [name for name in archive.namelist() if name.startswith("resources/")] == [
            "resources/curves/gain.csv",
            "resources/notes.txt",
        ]
        assert archive.read("resources/curves/gain.csv") == b"0,1\n"


def test_the_other_templates_export_from_a_workspace(lag, folder):
    workspace = folder / "a workspace"
    workspace.mkdir()
    (workspace / "Cargo.toml").write_text('[workspace]\nresolver = "3"\nmembers = []\n')
    kinds = {"sampled": "pi-controller", "algebraic": "resistor"}
    for template, name in kinds.items():
        run(workspace, "cargo", "fmu", "new", name, "--template", template)
    built = {"CARGO_TARGET_DIR": lag / "target"}
    run(workspace, "cargo", "test", **built)
    run(workspace, "cargo", "fmu", "export", "--out", "all", **built)
    run(workspace / "resistor", "cargo", "fmu", "export", "-p", "resistor", "--out", "one", **built)
    assert sorted(file.name for file in (workspace / "all").iterdir()) == ["pi_controller.fmu", "resistor.fmu"]
    assert [file.name for file in (workspace / "resistor/one").iterdir()] == ["resistor.fmu"]
    for fmu in (workspace / "all").iterdir():
        assert validate_fmu(fmu) == []
        run(workspace, "cargo", "fmu", "validate", str(fmu))
    result = fmpy.simulate_fmu(workspace / "all/resistor.fmu", output=["power"], start_values={"voltage": 10.0})
    assert result["power"][-1] == pytest.approx(2.0, rel=1e-15)
    result = fmpy.simulate_fmu(workspace / "all/pi_controller.fmu", output=["command"])
    # Proportional 0.5 V, and after 49 samples of 0.1 s as much for each second of integral time.
    assert result["command"][-1] == pytest.approx(0.5 + 0.5 * 4.9, rel=1e-12)
