"""The steps of the workflow that makes a release, as a reader of YAML yields them, in a clone: those of the
machine with Linux, the libraries for Windows, and what joins them. What installs Rust is replaced, and what
attaches files to a release does not run."""

import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import pytest
import yaml

from fmu import ROOT, TARGET

pytestmark = pytest.mark.platforms

JOBS = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text())["jobs"]
MACHINES = {machine["runner"]: machine for machine in JOBS["build"]["strategy"]["matrix"]["include"]}


def step(job: str, name: str) -> dict:
    (found,) = [step for step in JOBS[job]["steps"] if step.get("name") == name]
    return found


@pytest.fixture(scope="module")
def clone(tmp_path_factory) -> Path:
    """The repository's files, whose builds are kept."""
    folder = tmp_path_factory.mktemp("release") / "clone"
    subprocess.run(["git", "clone", "--quiet", ROOT, folder], check=True)
    built = TARGET / "release-workflow"
    built.mkdir(parents=True, exist_ok=True)
    for made in ("fmu", "wheels"):
        shutil.rmtree(built / made, ignore_errors=True)
    (folder / "target").symlink_to(built)
    return folder


@pytest.fixture(scope="module")
def environment(tmp_path_factory) -> dict[str, str]:
    """A machine with the tools of release/build, and a Python of its own."""
    folder = tmp_path_factory.mktemp("machine")
    venv.create(folder / "python", with_pip=True, system_site_packages=False)
    tools = folder / "tools"
    tools.mkdir()
    for name in ("rustup", "gh"):
        (tools / name).write_text("#!/bin/sh\n")
        (tools / name).chmod(0o755)
    own = TARGET / "release-tools" / "bin"
    path = [tools, folder / "python" / "bin", own, Path(sys.executable).parent, os.environ["PATH"]]
    environment = {**os.environ, "PATH": os.pathsep.join(map(str, path))}
    environment.pop("CARGO_TARGET_DIR", None)
    return environment


@pytest.fixture
def run(clone: Path, environment: dict[str, str]):
    def run(job: str, name: str, runner: str = "ubuntu-latest", **variables: str) -> str:
        known = step(job, name)
        own = {key: str(value) for key, value in known.get("env", {}).items()}
        for key, value in MACHINES[runner].items():
            own = {name: text.replace("${{ matrix." + key + " }}", value) for name, text in own.items()}
        assert not [text for text in own.values() if "${{" in text]
        shell = ["bash", "--noprofile", "--norc", "-e", "-o", "pipefail", "-c", known["run"]]
        everything = {**environment, **own, **variables}
        done = subprocess.run(shell, cwd=clone, env=everything, capture_output=True, text=True)
        assert done.returncode == 0, f"{name}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    return run


def for_macos(fmu: Path, out: Path) -> None:
    """Writes an FMU with its libraries for macOS alone, as a machine with macOS would make it."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with ZipFile(fmu) as archive, ZipFile(out, "w", ZIP_DEFLATED) as written:
        for entry in archive.infolist():
            if not entry.filename.startswith("binaries/") or "darwin" in entry.filename:
                written.writestr(entry, archive.read(entry))


def test_a_release(run, clone: Path, environment: dict[str, str]) -> None:
    run("build", "Install Rust, the sources of its standard library, zig and FMPy")
    run("build", "Build the command")
    # Debian's compiler has the sources of its standard library, which the workflow takes from rustup.
    with_sources = {"RUSTC": "/usr/bin/rustc", "CARGO_TARGET_DIR": str(clone / "target" / "build-std")}
    made = {}
    for runner in ("windows-latest", "ubuntu-latest"):
        # Exported FMUs lie beside cargo's builds.
        run("build", "Export", runner, **with_sources)
        made[runner] = clone / "built" / runner / "fmu"
        shutil.copytree(clone / "target" / "build-std" / "fmu", made[runner])
    shutil.copytree(made["ubuntu-latest"], clone / "target" / "fmu")
    run("build", "Validate the FMUs and run the loop in FMPy")
    run("build", "Build the package for Python")
    run("build", "Run the loop by the package")
    run("build", "Build the laboratory")
    shutil.copytree(clone / "target" / "wheels", made["ubuntu-latest"].parent / "wheels")

    # The command of the package is that of cargo.
    command = [TARGET / "debug/cargo-fmu", "simulate", "boost/lab/scenarios/figure_13.toml"]
    subprocess.run([*command, "--out", "target/own.csv"], cwd=clone, check=True)
    own, packaged = ((clone / "target" / name).read_bytes() for name in ("own.csv", "figure_13.csv"))
    assert own == packaged
    called = subprocess.run(["fmu", "fmu"], env=environment, capture_output=True, text=True)
    assert called.returncode == 2
    assert "Usage: fmu <COMMAND>" in called.stderr

    # There is no macOS here; its libraries are those that tests/platforms/run has built for it.
    for name in ("BoostPlant.fmu", "BoostController.fmu"):
        for_macos(TARGET / "platforms" / name, clone / "built" / "macos-latest" / "fmu" / name)
    run("release", "Merge")
    merged = sorted(path.name for path in (clone / "merged").iterdir())
    names = [f"{fmu}{version}.fmu" for fmu in ("BoostController", "BoostPlant") for version in ("", ".fmi3")]
    assert set(merged) >= {*names, "Boost.ssp"}
    assert [name for name in merged if name.endswith(".whl") and "manylinux2014" in name]
    assert [name for name in merged if name.startswith("boost-lab-")]
    with ZipFile(clone / "merged" / "BoostPlant.fmu") as archive:
        binaries = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    assert binaries >= {"linux64", "win64", "darwin64"}
