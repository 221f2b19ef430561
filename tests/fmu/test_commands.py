"""What the three commands refuse, and how: tables of commands and refusals. What one of them alone refuses is
tested beside its code."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path
from unicodedata import category

import pytest

from fmu import ROOT, TARGET

CARGO_FMU = ["cargo-fmu", "fmu"]
BOOST_FMU = ["boost-fmu"]
BOOST_LAB = ["boost-lab"]

HARM = "\u009d0;title\u009c\u009b31m\u202e&#10;"
"""What would control a terminal, in XML."""
SHOWN = r"\u{9d}0;title\u{9c}\u{9b}31m\u{202e}\n"


def description(identifier: str = "Other", name: str = "Other", variables: str = "") -> str:
    return f"""<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="g">
  <CoSimulation modelIdentifier="{identifier}"/>
  <ModelVariables>{variables}</ModelVariables>
</fmiModelDescription>"""


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """A folder with both FMUs and foreign ones, in which the commands run."""
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    for model in ("BoostPlant", "BoostController"):
        folder.joinpath(f"{model}.fmu").symlink_to(TARGET / "fmu" / f"{model}.fmu")
    parameters = "".join(
        f'<ScalarVariable name="p{number}" causality="parameter" variability="fixed">'
        f'<Real start="{number}"/></ScalarVariable>'
        for number in range(2000)
    )
    harmful = (
        f'<ScalarVariable name="a{HARM}" valueReference="0" causality="input" description="b{HARM}">'
        f'<Real unit="c{HARM}" start="d{HARM}"/></ScalarVariable>'
    )
    for file, text in {
        "evil.fmu": description(identifier="../../evil\u009b2J"),
        "harm.fmu": description(name=f"e{HARM}", variables=harmful),
        "harm_in_tag.fmu": "<a></\u009b2J>",
        "large.fmu": description(variables=parameters),
    }.items():
        with zipfile.ZipFile(folder / file, "w") as fmu:
            fmu.writestr("modelDescription.xml", text)
    with zipfile.ZipFile(folder / "harm_in_entry.fmu", "w") as fmu:
        fmu.writestr("../\u009b2J", "")
    scenario = 'step = 0.1\nstop_time = 1\n[[fmu]]\nname = "alone"\nfile = "BoostController.fmu"\n'
    for name, more in {
        "scenario": "",
        "csv": 'inputs.engine_speed = { csv = "/dev/zero", column = "a" }\n',
        "set": 'parameters = ["/dev/zero"]\n',
    }.items():
        folder.joinpath(f"{name}.toml").write_text(scenario + more)
    study = '[grid]\n"alone:engine_speed" = [1000, 2000]\n[measures]\nlast = { final = "engine_speed" }\n'
    folder.joinpath("endless.toml").write_text('scenario = "/dev/zero"\n' + study)
    return folder


def files(bench: Path) -> list[Path]:
    """Those in the folder and in both around it."""
    return sorted(path for path in bench.parents[1].rglob("*") if not path.is_dir())


def run(bench: Path, command: list[str], *arguments: str) -> subprocess.CompletedProcess[str]:
    program = TARGET / "debug" / command[0]
    return subprocess.run(
        [program, *command[1:], *arguments], cwd=bench, capture_output=True, encoding="utf-8", timeout=120
    )


def refusal(bench: Path, command: list[str], *arguments: str) -> str:
    """The message of a command that ends with the status of wrong input, and leaves no file."""
    before = files(bench)
    done = run(bench, command, *arguments)
    assert done.returncode == 2, done.stdout + done.stderr
    assert files(bench) == before
    return done.stderr


@pytest.mark.parametrize("command", [CARGO_FMU, BOOST_FMU, BOOST_LAB], ids=lambda command: command[0])
def test_exit_statuses_are_in_the_help(command: list[str], bench: Path) -> None:
    lines = [line.split() for line in run(bench, command, "--help").stdout.splitlines()]
    statuses = [line[0] for line in lines if line and line[0].isdecimal()]
    assert statuses == ["0", "1", "2", "130"]


TUNE = ["tune", "--plant", "BoostPlant.fmu"]
IDENTIFY = ["identify", "actuator", "a.csv", "--plant", "BoostPlant.fmu"]
STUDY = ["study", "--plant", "BoostPlant.fmu"]
SSP = ["ssp", "--plant", "BoostPlant.fmu", "--controller", "BoostController.fmu", "--out", "no.ssp"]


@pytest.mark.parametrize(
    ("command", "arguments", "option", "expected", "values"),
    [
        (CARGO_FMU, ["simulate", "scenario.toml"], "--stop-time", "a finite number", ["nan", "inf"]),
        (CARGO_FMU, ["simulate", "BoostPlant.fmu"], "--step", "a finite number above 0", ["nan", "0"]),
        (BOOST_LAB, TUNE, "--lambda", "a finite number above 0", ["nan", "-1"]),
        (BOOST_LAB, TUNE, "--engine-speeds", "a finite number above 0", ["1,nan", "0,1"]),
        (BOOST_LAB, TUNE, "--boost-references", "a finite number above 0", ["1,inf", "0,1"]),
        (BOOST_LAB, IDENTIFY, "--validation-share", "a number from 0 to 0.9", ["nan", "1"]),
    ],
)
def test_numbers_of_the_command_line_are_finite_and_in_their_range(
    command: list[str], arguments: list[str], option: str, expected: str, values: list[str], bench: Path
) -> None:
    for value in values:
        message = refusal(bench, command, *arguments, f"{option}={value}")
        assert option in message
        assert expected in message


MEBIBYTE = 2**20
ENDLESS = [
    (CARGO_FMU, ["simulate", "/dev/zero"]),
    (CARGO_FMU, ["simulate", "csv.toml", "--fmus", "."]),
    (CARGO_FMU, ["simulate", "set.toml", "--fmus", "."]),
    (CARGO_FMU, ["simulate", "scenario.toml", "--fmus", ".", "--connections", "/dev/zero"]),
    (CARGO_FMU, ["sweep", "/dev/zero"]),
    (CARGO_FMU, ["sweep", "endless.toml"]),
    (BOOST_FMU, [*SSP, "--parameters", "/dev/zero"]),
    (BOOST_FMU, [*SSP, "--connections", "/dev/zero"]),
    (BOOST_FMU, ["check", "BoostPlant.fmu", "--as", "plant", "--connections", "/dev/zero"]),
    (BOOST_FMU, ["export", "--manifest-path", str(ROOT / "Cargo.toml"), "--binary", "linux64=/dev/zero"]),
    (BOOST_LAB, [*TUNE, "--parameters", "/dev/zero"]),
    (BOOST_LAB, [*TUNE, "--connections", "/dev/zero"]),
    (BOOST_LAB, [*STUDY, "--connections", "/dev/zero"]),
]


@pytest.mark.parametrize(("command", "arguments"), ENDLESS)
def test_an_endless_file_is_refused(command: list[str], arguments: list[str], bench: Path) -> None:
    most = 1024 * MEBIBYTE if "--binary" in arguments else 64 * MEBIBYTE
    assert f"/dev/zero: it is larger than {most} bytes" in refusal(bench, command, *arguments)


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        (CARGO_FMU, ["parameters", "evil.fmu"]),
        (CARGO_FMU, ["info", "evil.fmu"]),
        (CARGO_FMU, ["merge", "evil.fmu", "--out", "merged.fmu"]),
        (CARGO_FMU, ["compile", "evil.fmu"]),
        (CARGO_FMU, ["simulate", "evil.fmu"]),
        (BOOST_FMU, ["check", "evil.fmu", "--as", "plant"]),
        (BOOST_FMU, ["ssp", "--plant", "evil.fmu", "--controller", "BoostController.fmu"]),
        (BOOST_LAB, ["study", "--plant", "evil.fmu"]),
    ],
)
def test_an_identifier_that_is_a_path_is_refused(
    command: list[str], arguments: list[str], bench: Path
) -> None:
    message = refusal(bench, command, *arguments)
    assert "evil.fmu" in message
    assert r"the modelIdentifier '../../evil\u{9b}2J' is not a C identifier" in message
    assert "\u009b" not in message


@pytest.mark.parametrize(
    ("command", "arguments", "shown"),
    [
        (CARGO_FMU, ["info", "harm.fmu"], [name + SHOWN for name in "abcde"]),
        (CARGO_FMU, ["info", "harm_in_tag.fmu"], [r"\u{9b}2J"]),
        (CARGO_FMU, ["info", "harm_in_entry.fmu"], [r"'../\u{9b}2J'"]),
        (CARGO_FMU, ["validate", "harm.fmu"], ["a" + SHOWN]),
        (BOOST_FMU, ["check", "harm.fmu", "--as", "plant"], ["e" + SHOWN]),
    ],
)
def test_a_description_does_not_control_the_terminal(
    command: list[str], arguments: list[str], shown: list[str], bench: Path
) -> None:
    done = run(bench, command, *arguments)
    printed = done.stdout + done.stderr
    assert [text for text in shown if text not in printed] == []
    assert [
        character for character in printed if category(character) in ("Cc", "Cf") and character != "\n"
    ] == []


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        (CARGO_FMU, ["parameters", "large.fmu", "--out", "set.ssv"]),
        (CARGO_FMU, ["merge", "large.fmu", "--out", "merged.fmu"]),
        (CARGO_FMU, ["simulate", "BoostPlant.fmu", "--stop-time", "5", "--out", "record.csv"]),
        (BOOST_FMU, ["ssp", *SSP[1:5], "--out", "system.ssp"]),
    ],
)
def test_a_failed_write_leaves_no_file(command: list[str], arguments: list[str], bench: Path) -> None:
    """No file may be longer than a block, which the program is told instead of being ended by a signal."""
    before = files(bench)
    shell = ["sh", "-c", 'trap \'\' XFSZ; ulimit -f 1; exec "$0" "$@"', TARGET / "debug" / command[0]]
    done = subprocess.run(
        [*shell, *command[1:], *arguments], cwd=bench, capture_output=True, encoding="utf-8", timeout=120
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("File too large") == 1
    assert files(bench) == before


@pytest.mark.parametrize(
    ("command", "arguments", "named"),
    [
        (CARGO_FMU, ["simulate", "missing.fmu"], "missing.fmu"),
        (CARGO_FMU, ["simulate", "scenario.toml"], "BoostController.fmu"),
        (BOOST_FMU, ["check", "missing.fmu", "--as", "plant"], "missing.fmu"),
        (BOOST_LAB, ["reproduce", "1"], "target/fmu/"),
    ],
)
def test_a_missing_fmu_is_named(command: list[str], arguments: list[str], named: str, bench: Path) -> None:
    assert named in refusal(bench, command, *arguments)
