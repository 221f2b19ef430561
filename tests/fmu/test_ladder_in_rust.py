"""The ladder's FMUs of FMI 3.0 in the crate fmi, by explicit Euler in Model Exchange: the results that
Reference-FMUs come with, which were made so."""

from __future__ import annotations

import os
import re
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import libclang
import numpy as np
import pytest
from conftest import ROOT, TARGET

FMUS = TARGET / "ladder" / "fmu" / "fmi3"
REFERENCE = ROOT / "crates" / "cargo-fmu" / "tests" / "ladder" / "reference"
EPSILON = np.finfo(float).eps

Simulate = Callable[..., np.ndarray]


@pytest.fixture(scope="module")
def program() -> Path:
    """Builds the importer if necessary."""
    # With the profile and features of `tests/run`, which has compiled most of it.
    build = "cargo build --quiet --locked --profile test --workspace --all-features --bin euler"
    subprocess.run(build.split(), cwd=ROOT, env={**os.environ, **libclang.environment()}, check=True)
    return TARGET / "debug" / "euler"


def copy_without_units(path: Path, copy: Path) -> None:
    """The crate's schema of variables has no `unit`, and refuses what it does not have."""
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(copy, "w") as new:
        for entry in old.infolist():
            content = old.read(entry)
            if entry.filename == "modelDescription.xml":
                content = re.sub(rb' (unit|displayUnit)="[^"]*"', b"", content)
            new.writestr(entry, content)


@pytest.fixture
def simulate(program: Path, tmp_path: Path) -> Simulate:
    def simulate(model: str, step: float, steps: int, *names: str) -> np.ndarray:
        """The variables after each step."""
        path, copy = FMUS / f"{model}.fmu", tmp_path / f"{model}.fmu"
        assert path.is_file(), f"{path} is missing: bash tests/run rest exports it"
        copy_without_units(path, copy)
        command = [program, copy, str(step), str(steps), *names]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        return np.genfromtxt(done.stdout.splitlines(), delimiter=",", names=True)

    return simulate


def reference(model: str) -> np.ndarray:
    return np.genfromtxt(REFERENCE / f"{model}_out.csv", delimiter=",", names=True)


def test_dahlquist(simulate: Simulate) -> None:
    found, theirs = simulate("Dahlquist", 0.1, 100, "x"), reference("Dahlquist")
    assert len(found) == len(theirs) == 101
    # A multiplication and an addition in each of 100 steps, of numbers up to 1.
    assert np.abs(found["x"] - theirs["x"]).max() < 200 * EPSILON


def test_van_der_pol(simulate: Simulate) -> None:
    found, theirs = simulate("VanDerPol", 0.01, 2000, "x0", "x1"), reference("VanDerPol")
    assert len(found) == len(theirs) == 2001
    # On the limit cycle a difference along the path remains one in time, which is the larger the faster the
    # state moves; others shrink.
    x0, x1 = theirs["x0"], theirs["x1"]
    speed = np.hypot(x1, (1 - x0**2) * x1 - x0)
    stretch = speed.max() / speed.min()
    for name in ("x0", "x1"):
        # Some ten roundings of numbers up to 8 in each of 2000 steps, times the step of 0.01.
        assert np.abs(found[name] - theirs[name]).max() < 2000 * 10 * 8 * EPSILON * 0.01 * stretch


def test_the_ball_bounces(simulate: Simulate) -> None:
    """Events are at the ends of steps, as in theirs."""
    found, theirs = simulate("BouncingBall", 0.001, 3000, "h", "v")[::10], reference("BouncingBall")
    assert len(found) == len(theirs) == 301
    for name in ("h", "v"):
        # A rounding of numbers up to 4.4 in each of 3000 steps.
        assert np.abs(found[name] - theirs[name]).max() < 3000 * 4.4 * EPSILON


def test_the_stair_ends_the_simulation(simulate: Simulate) -> None:
    found, theirs = simulate("Stair", 0.2, 60, "counter"), reference("Stair")
    assert list(found["counter"]) == list(theirs["counter"])
    assert found["time"] == pytest.approx(theirs["time"], rel=EPSILON)


def test_the_resource_is_read(simulate: Simulate) -> None:
    assert list(simulate("Resource", 1.0, 1, "y")["y"]) == list(reference("Resource")["y"]) == [97, 97]


def test_what_the_program_cannot_simulate_is_named(program: Path, tmp_path: Path) -> None:
    command = [program, tmp_path / "Missing.fmu", "0.1", "10", "x"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert re.match(f"error: cannot import {tmp_path / 'Missing.fmu'}: ", done.stderr)
