"""Compares validators on the broken FMUs of `fmu-validation`'s tests, for the table in docs/validation.md.

    PYTHONPATH=tests target/venv/bin/python -m fmu.validators

makes these FMUs, runs `cargo fmu validate`, `fmpy validate` and `fmutool -check` on each, and writes the
table into the page. A validator finds the break if it complains about the broken FMU; none complains about
the good ones.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fmu import ROOT, TARGET

PAGE = ROOT / "docs" / "validation.md"
BEGIN, END = "<!-- The table of tests/fmu/validators.py begins here. -->\n", "<!-- It ends here. -->\n"
HEADER = "| what is broken | `cargo fmu validate` | `fmpy validate` | `fmutool -check` |\n|---|---|---|---|\n"

Answer = tuple[bool, str]
"""Whether it complains, and its message."""


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    """Runs a command."""
    return subprocess.run(command, capture_output=True, text=True, check=False)


def cargo_fmu(file: Path) -> Answer:
    """The broken rules, with warnings."""
    done = run(TARGET / "debug" / "cargo-fmu", "fmu", "validate", file, "--format", "json")
    rules = [finding["rule"] for finding in json.loads(done.stdout)["findings"]]
    return bool(rules), ", ".join(f"`{rule}`" for rule in dict.fromkeys(rules))


def fmpy(file: Path) -> Answer:
    """FMPy's own command."""
    done = run(Path(sys.executable).parent / "fmpy", "validate", file)
    crash = "Traceback" in done.stderr
    return "No problems found." not in done.stdout, "traceback" if crash else "found"


def fmutool(file: Path) -> Answer:
    """The checks of fmu-manipulation-toolbox."""
    done = run(Path(sys.executable).parent / "fmutool", "-input", file, "-check")
    output = done.stdout + done.stderr
    complains = re.search(r"^(ERROR|CRITICAL|FATAL) ", output, re.MULTILINE) is not None
    crash = "Traceback" in output
    return complains or crash or done.returncode != 0, "traceback" if crash else "found"


VALIDATORS = [cargo_fmu, fmpy, fmutool]


def row(broken: Path) -> str:
    """What each validator finds in a broken FMU."""
    cells = [broken.stem.split(" ", 1)[1].removesuffix(" (FMI 2)")]
    for validator in VALIDATORS:
        complains, text = validator(broken)
        cells.append(text if complains else "missed")
    return f"| {' | '.join(cells)} |\n"


def table() -> str:
    """The rows, in the order of the tests."""
    subprocess.run(
        ["cargo", "test", "--quiet", "--package", "fmu-validation", "--test", "validation"],
        cwd=ROOT,
        check=True,
    )
    subprocess.run(["cargo", "build", "--quiet", "--package", "cargo-fmu"], cwd=ROOT, check=True)
    folder = TARGET / "tmp" / "good-fmus"
    for good in (folder / "2.fmu", folder / "3.fmu"):
        assert not any(complains for complains, _ in (validator(good) for validator in VALIDATORS)), good
    broken = sorted((TARGET / "tmp" / "broken-fmus").glob("*.fmu"))
    with ThreadPoolExecutor(2) as pool:
        rows = list(pool.map(row, broken))
    finds = [[not cell.startswith("missed") for cell in line.split(" | ")[1:]] for line in rows]
    counts = [sum(column) for column in zip(*finds, strict=True)]
    total = f"| **found, of {len(rows)}** | {' | '.join(map(str, counts))} |\n"
    return HEADER + "".join(rows) + total


if __name__ == "__main__":
    rows = table()
    before, rest = PAGE.read_text().split(BEGIN)
    _, after = rest.split(END)
    PAGE.write_text(f"{before}{BEGIN}\n{rows}\n{END}{after}")
