"""`cargo fmu new` and `export`: what is written exports, and runs as its README says, in folders with spaces,
alone and in a workspace."""

import math
import os
import re
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest
from fmpy.ssp.simulation import simulate_ssp
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


def test_the_package_is_complete(lag):
    fmu = lag / "target/fmu/lag.fmu"
    assert validate_fmu(fmu) == []
    assert "0 errors" in run(lag, "cargo", "fmu", "validate", str(fmu))
    manifest = (lag / "Cargo.toml").read_text()
    assert 'path = "' in manifest  # this repository's crates: nothing is published where this is tested
    files = ["Cargo.toml", "build.rs", "model.json", "src/lib.rs"]
    lines = [line for file in files for line in (lag / file).read_text().split("#[cfg(test)]")[0].splitlines()]
    assert len([line for line in lines if line.strip()]) <= 50


def test_a_parameter_set_is_bound(lag):
    run(lag, "cargo", "fmu", "parameters", "target/fmu/lag.fmu")
    parameters = (lag / "lag.ssv").read_text()
    (lag / "lag.ssv").write_text(parameters.replace('value="0.5"', 'value="2"'))
    run(lag, "cargo", "fmu", "export", "--parameters", "lag.ssv")
    result = simulate_ssp(lag / "target/fmu/lag.ssp", stop_time=2.0, step_size=0.1)
    # One time constant of 2 s; the step response of a lag, to the default tolerance in each of 20 steps.
    assert result["lagged_voltage"][-1] == pytest.approx(1 - math.exp(-1), abs=20e-6)


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
