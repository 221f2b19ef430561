"""The exporter's packages, which the registry accepts, and `cargo fmu new` and `export`: what is written
exports, and runs as its README says, in folders with spaces, alone and in a workspace."""

import contextlib
import json
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
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssv
from fmpy.validation import validate_fmu

from fmu import ROOT, TARGET

pytestmark = pytest.mark.release

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
def decay(folder):
    """A package of its own, made and exported as its README says."""
    run(folder, "cargo", "fmu", "new", "decay", "--vcs", "none")
    package = folder / "decay"
    (block,) = re.findall(r"```console\n(.*?)```", (package / "README.md").read_text(), re.DOTALL)
    run(package, "bash", "-e", "-c", block)
    return package


def test_the_lines_of_the_readme_run(decay):
    assert "plotly" in (decay / "target/decay.html").read_text()
    run(decay, "cargo", "fmu", "simulate", "target/fmu/decay.fmu", "--out", "result.csv")
    header, *_, last = (decay / "result.csv").read_text().splitlines()
    assert header == "time,x"
    # To the default tolerance of 1e-6 in each of 100 steps.
    assert float(last.split(",")[1]) == pytest.approx(math.exp(-10), abs=1e-4)


def test_the_package_is_complete(decay):
    fmu = decay / "target/fmu/decay.fmu"
    assert validate_fmu(fmu) == []
    assert "0 errors" in run(decay, "cargo", "fmu", "validate", str(fmu))
    manifest = (decay / "Cargo.toml").read_text()
    assert 'path = "' in manifest  # this repository's crates: nothing is published where this is tested


def test_tests_and_trials_share_what_they_compile(decay):
    """The README's first two lines."""
    crates = [file.name.split("-")[0] for file in (decay / "target/debug/deps").glob("*.rlib")]
    assert len(crates) > 10
    # The build script needs one with other features than the library.
    assert {name for name in crates if crates.count(name) > 1} == {"libfmu_terms"}


def test_equations_give_derivatives(decay):
    with instance(decay / "target/fmu/decay.fmu") as fmu:
        # der(x) = -k x: value references in the order of declaration.
        assert fmu.getDirectionalDerivative([2], [1], [1.0]) == [-1.0]


def test_a_serialized_state_goes_on_to_the_same_bits(decay):
    def go_on(fmu, begin):
        for step in range(3):
            fmu.doStep(begin + step * 0.25, 0.25)
        return fmu.getReal([1])

    with instance(decay / "target/fmu/decay.fmu") as fmu, instance(decay / "target/fmu/decay.fmu") as other:
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


def test_a_parameter_set_is_bound(decay):
    run(decay, "cargo", "fmu", "parameters", "target/fmu/decay.fmu")
    parameters = (decay / "decay.ssv").read_text()
    (decay / "decay.ssv").write_text(parameters.replace('value="1.0"', 'value="2"'))
    run(decay, "cargo", "fmu", "export", "--parameters", "decay.ssv", "--fmi", "2,3")
    for folder in ["target/fmu", "target/fmu/fmi3"]:
        with ZipFile(decay / folder / "decay.ssp") as package:
            structure = ElementTree.fromstring(package.read("SystemStructure.ssd"))
            (component,) = structure.findall(".//{*}Component")
            (binding,) = component.findall(".//{*}ParameterBinding")
            bound = ElementTree.fromstring(package.read(binding.attrib["source"]))
            assert package.read("resources/decay.fmu") == (decay / folder / "decay.fmu").read_bytes()
        (parameter,) = bound.findall(".//{*}Parameter")
        values = [float(value.attrib["value"]) for value in parameter]
        assert (parameter.attrib["name"], values) == ("k", [2.0])
    # FMPy leaves start values and bindings to its caller.
    parameter_set = read_ssv(decay / "decay.ssv")
    for parameter in parameter_set.parameters:
        parameter.name = f"decay_instance.{parameter.name}"
    result = simulate_ssp(
        decay / "target/fmu/decay.ssp",
        stop_time=1.0,
        step_size=0.1,
        parameter_set=parameter_set,
    )
    # In a row of FMPy's there are the time before a step and the values after it; to the default tolerance in
    # each of ten steps.
    assert result["x"] == pytest.approx(np.exp(-2 * (result["time"] + 0.1)), abs=11e-6)


def interfaces_of(fmu):
    return [
        element.tag for element in read_description(fmu) if element.tag in ("ModelExchange", "CoSimulation")
    ]


def read_description(fmu):
    with ZipFile(fmu) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


def test_the_interfaces_are_those_of_the_option_or_the_environment(decay):
    export = ["cargo", "fmu", "export", "--out", "faces"]
    fmu = decay / "faces/decay.fmu"
    for arguments, variables, expected in [
        (["--interfaces", "cs,me"], {}, ["ModelExchange", "CoSimulation"]),
        (["--interfaces", "me"], {"FMU_INTERFACES": "cs"}, ["ModelExchange"]),
        ([], {"FMU_INTERFACES": "me"}, ["ModelExchange"]),
        ([], {}, ["CoSimulation"]),
    ]:
        run(decay, *export, *arguments, **variables)
        assert interfaces_of(fmu) == expected
        assert "0 errors" in run(decay, "cargo", "fmu", "validate", str(fmu))
        shown = run(decay, "cargo", "fmu", "info", str(fmu))
        assert [line.split()[0] for line in shown.splitlines() if "modelIdentifier=" in line] == expected
        for interface in expected:
            result = fmpy.simulate_fmu(fmu, fmi_type=interface, stop_time=5, start_values={"k": 2.0})
            # To 1e-6 in each of some hundred steps.
            assert result["x"][-1] == pytest.approx(math.exp(-10), abs=1e-4)
    refused = subprocess.run(
        [TARGET / "debug/cargo-fmu", "export"],
        cwd=decay,
        env={**os.environ, "FMU_INTERFACES": "both"},
        capture_output=True,
        text=True,
    )
    assert refused.returncode == 2
    assert "FMU_INTERFACES: 'both' is not one of cs, me, cs,me and se" in refused.stderr


def test_the_version_of_fmi_is_that_of_the_option_or_the_environment(decay):
    out = decay / "versions"
    export = ["cargo", "fmu", "export", "--out", str(out)]
    files = [out / "decay.fmu", out / "fmi3/decay.fmu"]
    for arguments, variables, expected in [
        (["--fmi", "3"], {}, files[1:]),
        (["--fmi", "2"], {"FMU_FMI_VERSION": "3"}, files[:1]),
        ([], {"FMU_FMI_VERSION": "3"}, files[1:]),
        (["--fmi", "3,2"], {}, files),
        (["--fmi", "2,3", "--interfaces", "cs,me"], {}, files),
    ]:
        shutil.rmtree(out, ignore_errors=True)
        run(decay, *export, *arguments, **variables)
        assert sorted(out.rglob("*.fmu")) == sorted(expected)
        for file in expected:
            version = "3.0" if file.parent.name == "fmi3" else "2.0"
            assert read_description(file).attrib["fmiVersion"] == version
            assert validate_fmu(file) == []
            assert "0 errors" in run(decay, "cargo", "fmu", "validate", str(file))
            assert version in run(decay, "cargo", "fmu", "info", str(file))
    # The same bits in both.
    for interface in ("CoSimulation", "ModelExchange"):
        old, new = (fmpy.simulate_fmu(file, fmi_type=interface, stop_time=5) for file in files)
        assert old["x"].tolist() == new["x"].tolist()
    refused = subprocess.run(
        [TARGET / "debug/cargo-fmu", "export", "--fmi", "1"], cwd=decay, capture_output=True, text=True
    )
    assert refused.returncode == 2
    assert "invalid value '1' for '--fmi <VERSION>'" in refused.stderr


def test_resources_are_packed(decay, folder):
    package = folder / "with resources"
    shutil.copytree(decay, package, ignore=shutil.ignore_patterns("target"))
    (package / "tables/curves").mkdir(parents=True)
    (package / "tables/notes.txt").write_text("made up")
    (package / "tables/curves/gain.csv").write_text("0,1\n")
    model = package / "model.json"
    model.write_text(model.read_text().replace("{", '{"resources": "tables",', 1))
    run(package, "cargo", "fmu", "export", CARGO_TARGET_DIR=decay / "target")
    with ZipFile(decay / "target/fmu/decay.fmu") as archive:
        assert [name for name in archive.namelist() if name.startswith("resources/")] == [
            "resources/curves/gain.csv",
            "resources/notes.txt",
        ]
        assert archive.read("resources/curves/gain.csv") == b"0,1\n"


def test_an_export_compiles_no_generator(decay):
    """The command generates in place of the build script, and the same."""
    compiled = {file.name.split("-")[0] for file in (decay / "target/fmu-library/deps").glob("*.rlib")}
    assert "libfmu_export" in compiled
    assert "libfmu_export_build" not in compiled
    # Other tests have exported others into this folder.
    run(decay, "cargo", "fmu", "export")
    # Those of FMI 2.0 for co-simulation, as the script generates without a choice.
    of_command = decay / "target/fmu-generated/2-cs-double/decay"
    (of_script,) = (decay / "target/debug/build").glob("*/out/decay")
    names = sorted(file.name for file in of_script.iterdir())
    assert names == ["index.html", "modelDescription.xml", "variables.rs"]
    assert sorted(file.name for file in of_command.iterdir()) == names
    for name in names:
        assert (of_command / name).read_bytes() == (of_script / name).read_bytes(), name


def failure(package, target):
    """What an export that fails says after its first line."""
    done = subprocess.run(
        [TARGET / "debug/cargo-fmu", "export"],
        cwd=package,
        env={**os.environ, "CARGO_TARGET_DIR": str(target)},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (2, "")
    begin, *lines = done.stderr.splitlines()
    assert begin.startswith("Compiling decay for ")
    return [line for line in lines if not line.startswith("   Compiling ")]


FAILED = (
    f"error: nothing was exported: cargo could not build the models for {fmpy.platform}; "
    "see its messages above"
)


def test_a_wrong_declaration_is_told_once(decay, folder):
    package = folder / "wrong declaration"
    shutil.copytree(decay, package, ignore=shutil.ignore_patterns("target"))
    model = package / "model.json"
    model.write_text(model.read_text().replace('"unit": "1"', '"unit": "furlong"'))
    for _ in range(2):
        *findings, last = failure(package, decay / "target")
        assert findings
        assert len(set(findings)) == len(findings)
        for finding in findings:
            assert re.match(
                r"error: decay@0\.1\.0: model\.json:\d+: \S+: .* 'furlong' is not known$", finding
            )
        assert last == (
            "error: nothing was exported: the declaration of decay is rejected; see the messages above"
        )


def test_other_failures_are_told_as_cargo_tells_them(decay, folder):
    package = folder / "wrong code"
    shutil.copytree(decay, package, ignore=shutil.ignore_patterns("target"))
    script = package / "build.rs"
    of_model = script.read_text()
    script.write_text('fn main() { panic!("no table") }')
    lines = failure(package, decay / "target")
    assert "error: failed to run custom build command for `decay" in lines[0]
    assert any("no table" in line for line in lines)
    assert lines[-1] == FAILED
    script.write_text(of_model)
    with (package / "src/lib.rs").open("a") as source:
        source.write("const WRONG: f64 = true;\n")
    lines = failure(package, decay / "target")
    assert lines[0] == "error[E0308]: mismatched types"
    assert lines[-1] == FAILED


def make_workspace(folder, templates):
    """A workspace with packages of these names from templates."""
    folder.mkdir()
    (folder / "Cargo.toml").write_text('[workspace]\nresolver = "3"\nmembers = []\n')
    for name, template in templates.items():
        run(folder, "cargo", "fmu", "new", name, "--template", template)


def test_a_workspace_exports_all_or_one(decay, folder):
    """What its models need: FMI 2.0 does not have all that the second declares."""
    workspace = folder / "a workspace"
    make_workspace(workspace, {"ball": "bouncing_ball", "all-types": "feedthrough_3"})
    built = {"CARGO_TARGET_DIR": decay / "target"}
    run(workspace, "cargo", "fmu", "export", "--out", "all", **built)
    run(workspace / "ball", "cargo", "fmu", "export", "-p", "ball", "--out", "one", **built)
    fmus = sorted((workspace / "all").rglob("*.fmu"))
    assert fmus == [workspace / "all/ball.fmu", workspace / "all/fmi3/all_types.fmu"]
    assert [file.name for file in (workspace / "ball/one").iterdir()] == ["ball.fmu"]
    for fmu in fmus:
        assert validate_fmu(fmu) == []
        run(workspace, "cargo", "fmu", "validate", str(fmu))


def metadata(folder):
    """The packages of a workspace as cargo reads their manifests."""
    return json.loads(run(folder, "cargo", "metadata", "--no-deps", "--format-version", "1"))["packages"]


LICENSES = {"MIT", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause"}
"""Those of these packages, by their SPDX identifiers."""

WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9_+-]{0,19}")
"""A keyword."""


def refused(package):
    """What the registry refuses in a manifest, and `cargo package` does not (The Cargo Book, "Publishing on
    crates.io", "The Manifest Format" and "Specifying Dependencies")."""
    missing = [key for key in ("description", "license") if not package[key]]
    terms = set(re.findall(r"[^\s()]+", package["license"] or "")) - {"AND", "OR"}
    addresses = [package[key] or "https://" for key in ("documentation", "homepage", "repository")]
    words = package["keywords"]
    dependencies = [
        dependency["name"]
        for dependency in package["dependencies"]
        # A dependency of the tests by its path alone is left out of what is published.
        if not (dependency["kind"] == "dev" and dependency.get("path"))
        and (dependency["req"] == "*" or not (dependency.get("path") or is_of_registry(dependency)))
    ]
    return [
        *missing,
        *sorted(terms - LICENSES),
        *(address for address in addresses if not address.startswith(("https://", "http://"))),
        *(word for word in words if not WORD.fullmatch(word)),
        *(["keywords"] if len(words) > 5 else []),
        *(["categories"] if len(package["categories"]) > 5 else []),
        *dependencies,
    ]


def is_of_registry(dependency):
    return dependency["source"] == "registry+https://github.com/rust-lang/crates.io-index"


def test_the_registry_accepts_the_packages():
    packages = [package for package in metadata(ROOT) if package["publish"] is None]
    (exporter,) = re.findall(r"^exporter=\(([^)]*)\)$", (ROOT / "tests/steps").read_text(), re.MULTILINE)
    assert sorted(package["name"] for package in packages) == sorted(exporter.split())
    assert {package["name"]: refused(package) for package in packages if refused(package)} == {}


def test_what_the_registry_refuses_is_found(folder):
    """By the names of what is wrong."""
    package = folder / "refused"
    (package / "src").mkdir(parents=True)
    (package / "src/lib.rs").write_text("")
    (package / "Cargo.toml").write_text(
        """
        [package]
        name = "refused"
        license = "MIT OR Mine"
        keywords = ["fmi", "two words", "a", "b", "c", "d"]
        categories = ["a", "b", "c", "d", "e", "f"]
        repository = "ssh://nowhere"
        [dependencies]
        any = "*"
        here = { path = "here" }
        git = { git = "https://nowhere", version = "1" }
        ours = { path = "ours", version = "1" }
        theirs = "1"
        [dev-dependencies]
        tested = { path = "tested" }
        tests = "*"
        """
    )
    (found,) = metadata(package)
    assert refused(found) == [
        "description",
        "Mine",
        "ssh://nowhere",
        "two words",
        "keywords",
        "categories",
        "any",
        "git",
        "here",
        "tests",
    ]


def test_all_pages_install_the_command_alike():
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("crates/*/README.md")]
    lines = {
        line.partition("#")[0].strip()
        for page in pages
        for line in page.read_text().splitlines()
        if line.startswith("cargo install ")
    }
    assert lines == {"cargo install --path crates/cargo-fmu"}
