"""Memory and the process: hundreds of loads, other ways of loading, and valgrind.

The process is `host` of the importer in Rust (crates/fmu-export/tests/importer/examples/host.rs): valgrind
reports errors in Python itself, and glibc counts the allocated bytes of a run.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from fmu import TARGET

CYCLES = 400

CHUNK = 32
"""The smallest chunk of glibc's malloc in bytes (64-bit: `MINSIZE`)."""

NAMES = pytest.mark.parametrize("name", ["BoostPlant", "BoostController"])


@pytest.fixture(scope="module")
def host() -> Path:
    """The program, an example of its package."""
    program = TARGET.resolve() / "debug" / "examples" / "host"
    assert program.is_file(), f"{program} is missing: bash tests/run rest compiles it"
    return program


def cycle(host: Path, fmu: Path, keep: bool, leak: str) -> tuple[list[int], list[int]]:
    """Bytes and mappings after each quarter of the cycles."""
    command = [host, "cycle", str(CYCLES), str(int(keep)), leak, fmu]
    # Chunks in glibc's cache of each thread would count as used.
    variables = {**os.environ, "GLIBC_TUNABLES": "glibc.malloc.tcache_count=0"}
    result = subprocess.run(command, capture_output=True, text=True, check=False, env=variables)
    assert (result.returncode, result.stderr) == (0, "")
    lines = [line.split() for line in result.stdout.splitlines()]
    assert len(lines) == 4
    return [int(size) for size, _ in lines], [int(count) for _, count in lines]


@pytest.mark.parametrize("keep", [False, True], ids=["unloaded each time", "kept"])
@NAMES
def test_nothing_is_left_behind(host: Path, exported: Path, name: str, keep: bool) -> None:
    """After a warm-up of a half, memory is constant: in 200 cycles the smallest leak would be 200 chunks.
    (The host checks that the library is unmapped at the end of a cycle.)"""
    sizes, mappings = cycle(host, exported / f"{name}.fmu", keep, "0")
    assert max(sizes[1:]) - sizes[1] < 0.5 * CYCLES * CHUNK / 10
    assert set(mappings) == {mappings[0]}


@NAMES
@pytest.mark.parametrize(("leak", "least"), [("30", CHUNK), ("instance", 1000)])
def test_a_leak_is_detected(host: Path, exported: Path, name: str, leak: str, least: int) -> None:
    """The test above can fail: with 30 bytes a cycle, or an instance that is not freed."""
    sizes, _ = cycle(host, exported / f"{name}.fmu", keep=False, leak=leak)
    assert sizes[-1] - sizes[0] >= 0.75 * CYCLES * least


def run(
    host: Path, folder: Path, how: str = "default", before: tuple[str, ...] = (), **environment: str
) -> str:
    """The bytes of both FMUs' states at the end."""
    command = [
        *before,
        host,
        "run",
        how,
        *(folder.resolve() / f"Boost{of}.fmu" for of in ("Plant", "Controller")),
    ]
    variables = {**os.environ, **environment}
    result = subprocess.run(command, capture_output=True, text=True, check=False, env=variables)
    assert (result.returncode, result.stderr) == (0, "")
    assert len(result.stdout) > 10_000
    return result.stdout


@pytest.mark.parametrize("folder", ["fmu", "compiled/both"])
def test_environments_of_floating_point(host: Path, folder: str) -> None:
    """A host that has enabled traps, or rounds upward, still does so afterwards, and gets the same bits; from
    compiled sources, too."""
    expected = run(host, TARGET / folder)
    for how in ("traps", "upward"):
        assert run(host, TARGET / folder, how) == expected


def test_ways_of_loading(host: Path, exported: Path, fmus: dict) -> None:
    """Both FMUs define the same 34 symbols. However a host loads them, each library finds its own."""
    expected = run(host, exported)
    assert run(host, exported, LD_BIND_NOW="1") == expected
    for fmu in fmus.values():
        assert run(host, exported, LD_PRELOAD=str(fmu.library)) == expected


def test_small_stack(host: Path, exported: Path) -> None:
    """128 kB, musl's default for threads, are enough for the FMUs and their host."""
    limited = ("bash", "-c", 'ulimit -s 128; exec "$@"', "bash")
    assert run(host, exported, before=limited) == run(host, exported)


VALGRIND = (
    "valgrind",
    "--quiet",
    "--leak-check=full",
    "--errors-for-leak-kinds=definite,indirect",
    "--show-leak-kinds=definite,indirect",
    "--error-exitcode=99",
)


def test_valgrind_finds_nothing(host: Path, exported: Path) -> None:
    """Both FMUs, with saved and restored states, errors, and a reset: no invalid access, no uninitialized
    value, no leak."""
    assert run(host, exported, before=VALGRIND) == run(host, exported)


def test_valgrind_would_find_a_leak(host: Path, exported: Path) -> None:
    """With the library unloaded at the end, as above: memory that only the library refers to is lost."""
    command = [*VALGRIND, host, "cycle", "4", "0", "instance", exported / "BoostPlant.fmu"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 99
    assert "definitely lost" in result.stderr


def test_library_that_stays_is_detected(host: Path, exported: Path, fmus: dict) -> None:
    """The host detects when dlclose leaves a library in the process, as with a thread's destructors."""
    fmu = fmus["BoostController"]
    command = [host, "cycle", "4", "0", "0", exported / "BoostController.fmu"]
    preloaded = {**os.environ, "LD_PRELOAD": str(fmu.library)}
    result = subprocess.run(command, capture_output=True, text=True, check=False, env=preloaded)
    assert result.returncode != 0
    assert "found in the process" in result.stderr
