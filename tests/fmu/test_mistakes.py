"""What the compiler says of mistakes in models: few lines, of which the first says what to write."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

from fmu import ROOT, TARGET

USE = """use fmu_export::{Context, Equations, Error, Number, Persistent, Sampled, Step, Stepper};
"""

EQUATIONS = """
impl Equations for Motor {
    type Variables = Variables;
    fn evaluate<T: Number>(&self, _: T, variables: Evaluation<'_, T>) {
        variables.derivatives.speed = -variables.states.speed;
    }
}
"""

STEPPER = """
impl Stepper for Motor {
    type Variables = Variables;
    fn step(
        &mut self, _: &mut Variables, _: &Step<'_, Inputs>, _: &mut Context<'_>,
    ) -> Result<(), Error> {
        Ok(())
    }
}
"""

TICKED = """
impl Sampled for Motor {
    type Variables = Variables;
    fn sample(
        &mut self, _: fmu_export::Sample, _: &mut Variables, _: &mut Context<'_>,
    ) -> Result<(), Error> {
        Ok(())
    }
}
"""
SAMPLED = TICKED.replace("Variables;", "Variables;\n    fn period(_: &Variables) -> f64 { 0.1 }", 1)


def with_first(statement: str) -> str:
    """The equations, which begin with a statement."""
    return EQUATIONS.replace("        variables.", f"        {statement}\n        variables.", 1)


MEMORY = "#[derive(Clone, Debug, Default{})]\nstruct Motor {{ {} }}\n"

MISTAKES = {
    # The model, and the beginning of the first line.
    "equations_as_stepper": (
        "fmu!(stepper struct Motor);" + EQUATIONS,
        "`Motor` does not implement `Stepper`: write `fmu!(equations Motor)`",
    ),
    "sampled_as_stepper": (
        "fmu!(stepper struct Motor);" + SAMPLED,
        "`Motor` does not implement `Stepper`: write `fmu!(equations Motor)`",
    ),
    "stepper_as_equations": (
        "fmu!(equations struct Motor);" + STEPPER,
        "`Motor` does not implement `Equations`: write `fmu!(sampled Motor)`",
    ),
    "sampled_as_equations": (
        "fmu!(equations struct Motor);" + SAMPLED,
        "`Motor` does not implement `Equations`: write `fmu!(sampled Motor)`",
    ),
    "equations_as_sampled": (
        "fmu!(sampled struct Motor);" + EQUATIONS,
        "`Motor` does not implement `Sampled`: write `fmu!(equations Motor)`",
    ),
    "nothing_implemented": (
        "fmu!(equations struct Motor);",
        "`Motor` does not implement `Equations`: write `fmu!(sampled Motor)`",
    ),
    "evaluation_changes_a_state": (
        "fmu!(equations struct Motor);" + with_first("variables.states.speed = T::from(0.5);"),
        "cannot assign to `variables.states.speed`, which is behind a `&` reference",
    ),
    "evaluation_changes_an_input": (
        "fmu!(equations struct Motor);" + with_first("variables.inputs.torque = T::from(1.0);"),
        "cannot assign to `variables.inputs.torque`, which is behind a `&` reference",
    ),
    "evaluation_changes_a_parameter": (
        "fmu!(equations struct Motor);" + with_first("variables.parameters.load = T::from(1.0);"),
        "cannot assign to `variables.parameters.load`, which is behind a `&` reference",
    ),
    "another_word": (
        "fmu!(equation struct Motor);" + EQUATIONS,
        "`fmu!(equation struct Motor)` is none of `fmu!(equations NAME)`",
    ),
    "memory_not_derived": (
        "fmu!(equations Motor);" + MEMORY.format("", "turns: u32") + EQUATIONS,
        "`Motor` cannot be saved with a model's state: write `#[derive(Clone, Debug, Default, Persistent)]`",
    ),
    "memory_of_another_type": (
        "fmu!(equations Motor);"
        + MEMORY.format(", Persistent", "turns: std::collections::HashMap<u8, u8>")
        + EQUATIONS,
        "`HashMap<u8, u8>` cannot be saved with a model's state: write `#[derive(",
    ),
}
DECLARATION = {
    "variables": [
        {"name": "speed", "causality": "output", "unit": "rad/s", "start": 1, "derivative": True},
        {"name": "torque", "causality": "input", "unit": "N.m", "start": 0},
        {"name": "load", "causality": "parameter", "unit": "N.m", "start": 0},
    ]
}


def package(folder: Path, build: str) -> None:
    crates = (ROOT / "crates").as_posix()
    folder.joinpath("Cargo.toml").write_text(
        f"""[package]
name = "mistakes"
edition = "2024"

[workspace]

[dependencies]
fmu-export = {{ path = "{crates}/fmu-export" }}

[build-dependencies]
fmu-export-build = {{ path = "{crates}/fmu-export-build" }}
"""
    )
    folder.joinpath("Cargo.lock").write_bytes(ROOT.joinpath("Cargo.lock").read_bytes())
    folder.joinpath("build.rs").write_text(f"fn main() {{ {build} }}\n")


def check(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return cargo("check", folder, *arguments)


def cargo(
    command: str, folder: Path, *arguments: str, variables: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    line = ["cargo", command, "--offline", *arguments]
    environment = {**os.environ, "CARGO_TARGET_DIR": str(TARGET.resolve()), **(variables or {})}
    return subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def errors(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """What the compiler prints of each mistake."""
    folder = tmp_path_factory.mktemp("mistakes")
    package(folder, "".join(f'fmu_export_build::generate("{name}.json"); ' for name in MISTAKES))
    folder.joinpath("examples").mkdir()
    for name, (source, _) in MISTAKES.items():
        declaration = {"model_identifier": name, **DECLARATION}
        folder.joinpath(f"{name}.json").write_text(json.dumps(declaration))
        text = "#![allow(unused)]\n" + USE + "fmu_export::" + source + "\nfn main() {}\n"
        folder.joinpath("examples", f"{name}.rs").write_text(text)
    result = check(folder, "--examples", "--keep-going", "--message-format=json")
    printed: dict[str, list[str]] = {name: [] for name in MISTAKES}
    for line in result.stdout.splitlines():
        message = json.loads(line)
        if message["reason"] == "compiler-message" and message["message"]["level"] == "error":
            printed[message["target"]["name"]].append(message["message"]["rendered"])
    assert any(printed.values()), result.stderr
    return printed


@pytest.mark.parametrize("mistake", MISTAKES)
def test_the_first_line_says_what_to_write_and_few_follow(mistake: str, errors: dict[str, list[str]]) -> None:
    _, expected = MISTAKES[mistake]
    text = "".join(errors[mistake])
    print(text)
    first = text.splitlines()[0].split(": ", 1)[1]
    assert first.startswith(expected)
    # Two errors of the compiler, each with the places of its reasons.
    assert len(text.splitlines()) <= 50


def test_the_build_says_that_nothing_makes_the_functions(tmp_path: Path) -> None:
    package(tmp_path, 'fmu_export_build::generate("model.json");')
    tmp_path.joinpath("model.json").write_text(json.dumps(DECLARATION))
    tmp_path.joinpath("src").mkdir()
    tmp_path.joinpath("src", "lib.rs").write_text(USE + "struct Motor;" + EQUATIONS)
    result = check(tmp_path)
    said = [line for line in result.stderr.splitlines() if line.startswith("error")]
    print(result.stderr)
    assert said[0].startswith(
        "error: mistakes@0.0.0: src/lib.rs: nothing uses the variables of model.json: write"
    )
    assert len(said) <= 2


def test_a_library_of_another_name_than_the_model_is_told_with_both(tmp_path: Path) -> None:
    package(tmp_path, 'fmu_export_build::generate("model.json");')
    with tmp_path.joinpath("Cargo.toml").open("a") as manifest:
        manifest.write('\n[lib]\nname = "Motor"\n')
    tmp_path.joinpath("model.json").write_text(json.dumps(DECLARATION))
    tmp_path.joinpath("src").mkdir()
    source = USE + "fmu_export::fmu!(equations struct Motor);" + EQUATIONS
    tmp_path.joinpath("src", "lib.rs").write_text(source)
    result = check(tmp_path)
    print(result.stderr)
    said = [line for line in result.stderr.splitlines() if line.startswith("error")]
    assert said[0] == (
        "error: the library is called `Motor`, and the model of the JSON `mistakes`: "
        'write "model_identifier": "Motor" in the JSON'
    )


def test_a_clock_in_a_model_of_equations_is_refused_with_the_way_that_works(tmp_path: Path) -> None:
    package(tmp_path, 'fmu_export_build::generate("model.json");')
    clock = {
        "name": "sample",
        "type": "Clock",
        "causality": "input",
        "interval_variability": "constant",
        "interval_decimal": 0.1,
    }
    declaration = {"variables": [*DECLARATION["variables"], clock]}
    tmp_path.joinpath("model.json").write_text(json.dumps(declaration))
    tmp_path.joinpath("src").mkdir()
    tmp_path.joinpath("src", "lib.rs").write_text(
        USE + "fmu_export::fmu!(equations struct Motor);" + EQUATIONS
    )
    # The compiler looks at it as it makes code.
    result = cargo("build", tmp_path)
    print(result.stderr)
    assert result.returncode != 0
    assert "no variables of the type Clock, because its integrator finds the events" in result.stderr
    assert "`next_event` says when its samples are due, and `event` computes them" in result.stderr


def test_a_sampled_model_with_neither_period_nor_clocks_is_refused(tmp_path: Path) -> None:
    package(tmp_path, 'fmu_export_build::generate("model.json");')
    tmp_path.joinpath("model.json").write_text(json.dumps(DECLARATION))
    tmp_path.joinpath("src").mkdir()
    tmp_path.joinpath("src", "lib.rs").write_text(
        "#![allow(unused)]\n" + USE + "fmu_export::fmu!(sampled struct Motor);" + TICKED
    )
    # The compiler looks at it as it makes code.
    result = cargo("build", tmp_path)
    print(result.stderr)
    assert result.returncode != 0
    said = [line for line in result.stderr.splitlines() if line.startswith("error")]
    assert "a `Sampled` model needs `fn period`, or clocks in its JSON" in said[0]
    assert len(said) <= 2


@pytest.mark.parametrize(
    ("model", "variables", "message"),
    [
        (
            "fmu!(stepper struct Motor);" + STEPPER,
            {"FMU_INTERFACES": "me"},
            "this model cannot be exported for Model Exchange",
        ),
        (
            "fmu!(stepper struct Motor);" + STEPPER,
            {"FMU_INTERFACES": "se", "FMU_FMI_VERSION": "3"},
            "this model cannot be exported for Scheduled Execution",
        ),
        (
            "fmu!(sampled struct Motor);" + SAMPLED,
            {"FMU_INTERFACES": "se", "FMU_FMI_VERSION": "3"},
            "Scheduled Execution needs a clock in the model's JSON",
        ),
    ],
    ids=["model_exchange", "scheduled_execution", "without_a_clock"],
)
def test_an_interface_that_a_model_lacks_is_refused_once(
    model: str, variables: dict[str, str], message: str, tmp_path: Path
) -> None:
    package(tmp_path, 'fmu_export_build::generate("model.json");')
    # Scheduled Execution has no states.
    calculated = {"name": "speed", "causality": "output", "unit": "rad/s"}
    without_states = [calculated, *DECLARATION["variables"][1:]]
    declared = without_states if "se" in variables.values() else DECLARATION["variables"]
    tmp_path.joinpath("model.json").write_text(json.dumps({"variables": declared}))
    tmp_path.joinpath("src").mkdir()
    tmp_path.joinpath("src", "lib.rs").write_text("#![allow(unused)]\n" + USE + "fmu_export::" + model)
    result = cargo("check", tmp_path, variables=variables)
    print(result.stderr)
    said = [line for line in result.stderr.splitlines() if line.startswith("error")]
    assert message in said[0]
    assert len(said) <= 2


ALGEBRAIC = """
impl Equations for Motor {
    type Variables = Variables;
    fn evaluate<T: Number>(&self, _: T, variables: Evaluation<'_, T>) {
        variables.outputs.speed = variables.inputs.torque;
    }
}
"""


@pytest.mark.parametrize(
    ("model", "precision", "message"),
    [
        (
            "fmu!(equations struct Motor);" + ALGEBRAIC,
            "single",
            "FMU_PRECISION is single, but only a `Sampled` model computes with `f32`",
        ),
        (
            "fmu!(stepper struct Motor);" + STEPPER,
            "single",
            "FMU_PRECISION is single, but only a `Sampled` model computes with `f32`",
        ),
        (
            "fmu!(sampled struct Motor);" + SAMPLED,
            "half",
            "FMU_PRECISION: 'half' is not one of double and single",
        ),
    ],
    ids=["equations", "stepper", "no_precision"],
)
def test_a_precision_that_a_model_cannot_have_is_refused(
    model: str, precision: str, message: str, tmp_path: Path
) -> None:
    package(tmp_path, 'fmu_export_build::generate("model.json");')
    without_states = [{"name": "speed", "causality": "output", "unit": "N.m"}, *DECLARATION["variables"][1:]]
    tmp_path.joinpath("model.json").write_text(json.dumps({"variables": without_states}))
    tmp_path.joinpath("src").mkdir()
    tmp_path.joinpath("src", "lib.rs").write_text("#![allow(unused)]\n" + USE + "fmu_export::" + model)
    # The compiler looks at it as it makes code.
    result = cargo("build", tmp_path, variables={"FMU_PRECISION": precision})
    print(result.stderr)
    said = [line for line in result.stderr.splitlines() if line.startswith("error")]
    assert message in said[0]
