"""The README's commands, and those for FMPy that docs/masters.md adds."""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from fmpy.util import read_csv

from fmu import ROOT, documents
from fmu.documents import run
from fmu.master import Fmu

README = (ROOT / "README.md").read_text()
MASTERS = (ROOT / "docs" / "masters.md").read_text()

BROWSER = """
import sys, urllib.request
page = urllib.request.urlopen(sys.argv[2]).read()
open(sys.argv[1], "wb").write(page)
"""
"""Replaces the browser in which FMPy shows a plot, and stores the page."""


LINES = documents.lines(README)

FMPY_LINES = [line for line in LINES + documents.lines(MASTERS) if line.startswith("fmpy ")]

TEMPLATE = (
    "cargo run --package cargo-fmu -- "
    "export --manifest-path examples/minimal-controller/Cargo.toml --out target/fmu"
)
"""The line that exports the template."""

PICTURE, TESTS = "python examples/closed_loop.py --plot target/closed_loop.png", "bash tests/run"
SYSTEM_LINES = LINES[LINES.index(PICTURE) + 1 : LINES.index(TESTS)]


@pytest.fixture
def clone(exported: Path, tmp_path: Path) -> Path:
    return documents.clone(exported, tmp_path)


def test_every_line_is_run() -> None:
    """Those that FMPy does not run: test_export, nothing (they run this test), test_picture and
    test_system_lines."""
    others = [line for line in LINES if line not in FMPY_LINES]
    assert others == [
        "cargo run -- export",
        PICTURE,
        *SYSTEM_LINES,
        TESTS,
    ]
    assert len(FMPY_LINES) >= 8


def test_a_reader_finds_their_section_in_a_minute() -> None:
    """150 lines; the first table leads to sections that are there."""
    assert len(README.splitlines()) <= 150
    table = README.partition("| you | read |")[2].partition("\n\n")[0]
    wanted = re.findall(r"\(#([a-z-]+)\)", table)
    sections = [
        line.lstrip("# ").lower().replace(" ", "-") for line in README.splitlines() if line[:1] == "#"
    ]
    assert len(wanted) == 4
    assert set(wanted) <= set(sections)


def test_links_lead_to_files_of_the_repository() -> None:
    """Pages of this repository's crates at docs.rs are there only after a release."""
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("crates/*/README.md")]
    for page in pages:
        for link in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"(?s)```.*?```", "", page.read_text())):
            assert not re.match(r"https://docs\.rs/(fmu-|cargo-fmu)", link), (page, link)
            path, _, anchor = link.partition("#")
            if link.startswith("http"):
                continue
            target = page.parent / path if path else page
            assert target.exists(), (page, link)
            if anchor and target.suffix == ".md":
                titles = re.findall(r"^#+ (.*)$", target.read_text(), re.MULTILINE)
                kept = [re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles]
                assert anchor in kept, (page, link)


def test_walk_knows_every_line() -> None:
    """`tests/walk` runs the pages' lines in a clean clone; here only what it would run."""
    done = subprocess.run(
        [sys.executable, ROOT / "tests" / "walk", "--list"], capture_output=True, text=True, check=True
    )
    walked = done.stdout.splitlines()
    for line in LINES:
        assert line in walked or any(each.endswith(f"): {line}") for each in walked)
    assert sum(line.startswith("not run") for line in walked) == 6


@pytest.mark.release
def test_export(clone: Path, exported: Path) -> None:
    """The line with another folder, since other tests read this one.

    Compiled again, the sources give the same bytes.
    """
    out = clone / "out"
    sources = [
        ROOT / "build.rs",
        ROOT / "src/lib.rs",
        *ROOT.glob("crates/*/src/lib.rs"),
        *ROOT.glob("boost/*/src/lib.rs"),
    ]
    times = [(source, source.stat()) for source in sources]
    for source in sources:
        os.utime(source)
    command = ["cargo", "run", "--release", "--", "export", "--out", out]
    try:
        subprocess.run(command, cwd=ROOT, check=True)
    finally:
        # Otherwise the commands of other tests would be older than their sources.
        for source, before in times:
            os.utime(source, ns=(before.st_atime_ns, before.st_mtime_ns))
    names = ["Boost.ssp", "BoostController.fmu", "BoostPlant.fmu"]
    assert sorted(file.name for file in out.iterdir()) == names
    for name in names:
        assert (out / name).read_bytes() == (exported / name).read_bytes(), name


def test_test_command_is_there() -> None:
    """It runs this test, so it cannot be run from here."""
    assert os.access(ROOT / "tests" / "run", os.X_OK)


def test_system_lines(clone: Path) -> None:
    """Those that check and couple the template, except for its export, which `tests/run` does."""
    assert TEMPLATE in SYSTEM_LINES
    assert 'export_from examples/minimal-controller "$target/fmu"' in (ROOT / "tests" / "steps").read_text()
    for line in SYSTEM_LINES:
        if line != TEMPLATE:
            run(line, clone)
    assert [path.name for path in (clone / "target").iterdir() if path.is_file()] == ["minimal.ssp"]


@pytest.mark.parametrize("line", FMPY_LINES)
def test_fmpy(clone: Path, line: str) -> None:
    page = clone / "page.html"
    fetch = clone / "browser.py"
    fetch.write_text(BROWSER)
    output = run(line, clone, BROWSER=f"{sys.executable} {fetch} {page} %s &")
    # The stimulus of the controller alone answers no command, which the diagnosis says.
    assert ("WARNING" in output) == ("simulate target/fmu/BoostController" in line)
    assert "Warning" not in output
    if "validate" in line:
        assert "No problems found." in output
    if "info" in line:
        assert "Co-Simulation" in output
    if "--show-plot" not in line:
        return
    # Without a choice, panels of all 14 outputs would overlap.
    names = line.partition("--output-variables ")[2].split()
    assert 1 <= len(names) <= 4
    # FMPy ends when it has sent the plot, but the output that was waited for ends with the browser.
    content = page.read_text()
    for name in names:
        assert name in content


def test_without_a_display(clone: Path) -> None:
    """The replacement that the page names, in its first line with a plot."""
    replacement = "--output-file target/result.csv"
    assert f"`{replacement}`" in README
    line = next(line for line in FMPY_LINES if "--show-plot" in line)
    run(line.replace("--show-plot", replacement), clone, BROWSER="false")
    names = line.partition("--output-variables ")[2].split()
    assert set(read_csv(clone / "target" / "result.csv").dtype.names) == {"time", *names}


def test_needs() -> None:
    """Rust's version is Cargo's; Python's is that of the tests' own check."""
    version = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["rust-version"]
    readme = README.replace("\n", " ")
    before, _, _ = readme.partition("cargo run -- export")
    assert f"Rust {version} or later" in before
    limits = runpy.run_path(str(ROOT / "tests" / "times"))["COMMANDS"]
    first = limits["export"][1]
    wall, processor, whole = (limit // 60 for limit in (*limits["run"][1:], limits["ci"][1]))
    assert f"first build takes at most {first} s" in before
    assert f"in about {wall} minutes" in readme
    contributing = (ROOT / "CONTRIBUTING.md").read_text().replace("\n", " ")
    for told in (
        f"{first} s for `cargo run -- export`",
        f"{wall} min and {processor} min of processor time for `bash tests/run`",
        f"{whole} min for `.ci/run`",
    ):
        assert told in contributing
    assert "Python 3.11 or later" in README
    assert (
        "needs\n#                            Rust, Python 3.11 or later"
        in (ROOT / "tests" / "run").read_text()
    )


@pytest.mark.parametrize("file", sorted((ROOT / "examples").glob("*.csv")), ids=lambda file: file.stem)
def test_example_inputs_name_every_input(fmus: dict[str, Fmu], file: Path) -> None:
    """FMPy warns about each input that a file leaves out."""
    names = read_csv(file).dtype.names
    inputs = [{"time", *fmu.named("input")} for fmu in fmus.values()]
    assert set(names) in inputs


def test_picture(clone: Path) -> None:
    (line,) = [line for line in LINES if line.startswith("python ")]
    run(line, clone)
    # No tracked file: the clone's docs would be the repository's.
    assert line.split()[-1].startswith("target/")
    picture = (clone / line.split()[-1]).read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert "(docs/closed_loop.png)" in README
    assert (ROOT / "docs" / "closed_loop.png").exists()
