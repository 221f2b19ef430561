#!/usr/bin/env python3
"""Prints what `cargo fmu sweep` takes for runs in one worker: the figures of docs/simulate.md.

python3 benches/workers.py
"""

from __future__ import annotations

import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()
COMMAND = TARGET / "release" / "cargo-fmu"

RUNS = 2000
REPEATS = 5

SCENARIO = """step = 0.1
stop_time = 1
record = ["x"]
[[fmu]]
name = "decay"
file = "decay.fmu"
"""


def run(*words: object, folder: Path, **environment: str) -> None:
    """A command; what it prints is of no interest."""
    subprocess.run(
        [str(word) for word in words],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        check=True,
    )


def taken(folder: Path, runs: int) -> float:
    """The median time of a study of so many runs (s)."""
    rates = [1 + number / RUNS for number in range(runs)]
    study = f'scenario = "scenario.toml"\n[grid]\n"decay:k" = {rates}\n[measures]\nlast = {{ final = "x" }}\n'
    (folder / "study.toml").write_text(study)
    times = []
    for _ in range(REPEATS):
        with tempfile.TemporaryDirectory() as out:
            begin = time.monotonic()
            run(COMMAND, "sweep", "study.toml", "--fmus", folder, "--workers", 1, "--out", out, folder=folder)
            times.append(time.monotonic() - begin)
    return statistics.median(times)


def main() -> None:
    run("cargo", "build", "--release", "--locked", "--package", "cargo-fmu", folder=ROOT)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(COMMAND, "new", "--template", "dahlquist", "--vcs", "none", "decay", folder=folder)
        export = [COMMAND, "export", "--manifest-path", "decay/Cargo.toml", "--out", "."]
        run(*export, folder=folder, CARGO_TARGET_DIR=str(TARGET / "workers"))
        (folder / "scenario.toml").write_text(SCENARIO)
        one, many = taken(folder, 1), taken(folder, RUNS)
    print(
        f"a study of one run: {1e3 * one:.0f} ms; each further run: {1e3 * (many - one) / (RUNS - 1):.2f} ms"
    )


if __name__ == "__main__":
    main()
