"""Memory and the process: what a master in C finds after thousands of loads, and what valgrind finds.

The master is `host.c`, compiled here. In C because valgrind finds fault with Python itself, and because
glibc counts there what a run has allocated, to the byte.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from master import Fmu

CYCLES = 2000

CHUNK = 32
"""Bytes that glibc's malloc takes at the least, whatever is asked for (64-bit: `MINSIZE`)."""

NAMES = ["BoostPlant", "BoostController"]


@pytest.fixture(scope="module")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The master, compiled."""
    source = Path(__file__).with_name("host.c")
    program = tmp_path_factory.mktemp("host") / "host"
    flags = ["-std=c11", "-O1", "-g", "-Wall", "-Wextra", "-Werror"]
    command = [os.environ.get("CC", "cc"), *flags, str(source), "-o", str(program), "-ldl", "-lm"]
    subprocess.run(command, check=True)
    return program


def arguments(fmu: Fmu, other: Fmu) -> list[str]:
    """An FMU as the master wants it: with what it gives to the other one, and takes from it."""

    def references(names: list[str], taken: list[str]) -> str:
        return ",".join(str(fmu.variables[name].valueReference) for name in names if name in taken)

    gives = references(fmu.named("output"), other.named("input"))
    takes = references(other.named("output"), fmu.named("input"))
    return [str(fmu.library), fmu.description.guid, gives, takes]


@pytest.fixture
def couple(host: Path, fmus: dict[str, Fmu]) -> list[str]:
    """The command that couples both FMUs, but for how and how far."""
    plant, controller = fmus["BoostPlant"], fmus["BoostController"]
    return [str(host), "couple", *arguments(plant, controller), *arguments(controller, plant)]


def run_coupled(command: list[str], how: str, steps: int, before: tuple[str, ...] = ()) -> list[str]:
    """What both FMUs gave each other at the end."""
    program, name, *of_fmus = command
    # Both declare canSerializeFMUstate, see quick/test_interface.py.
    whole = [*before, program, name, how, str(steps), "1", *of_fmus]
    result = subprocess.run(whole, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")
    return result.stdout.splitlines()


def cycle(host: Path, fmus: dict[str, Fmu], name: str, keep: bool, leak: str) -> tuple[list[int], list[int]]:
    """Bytes and mappings after each quarter of the cycles."""
    (other,) = set(NAMES) - {name}
    command = [str(host), "cycle", str(CYCLES), "1", str(int(keep)), leak]
    command += arguments(fmus[name], fmus[other])
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")
    lines = [line.split() for line in result.stdout.splitlines()][1:]
    assert len(lines) == 4
    return [int(size) for size, _ in lines], [int(count) for _, count in lines]


@pytest.mark.parametrize("keep", [False, True], ids=["unloaded each time", "kept"])
@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_left_behind(host: Path, fmus: dict[str, Fmu], name: str, keep: bool) -> None:
    """After a warm-up of a quarter, memory stays as it is: in 1500 cycles the smallest leak would be 1500
    chunks. (The library's being unmapped at the end of a cycle is checked in the host.)"""
    sizes, mappings = cycle(host, fmus, name, keep, "0")
    assert max(sizes) - sizes[0] < 1500 * CHUNK / 10
    assert set(mappings) == {mappings[0]}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("leak", "least"), [("100", 100), ("instance", 1000)])
def test_a_leak_is_seen(host: Path, fmus: dict[str, Fmu], name: str, leak: str, least: int) -> None:
    """The test above could fail: 100 bytes a cycle, or an instance that is not freed, show."""
    sizes, _ = cycle(host, fmus, name, keep=False, leak=leak)
    assert sizes[-1] - sizes[0] >= 1500 * least


def test_loaded_in_any_way(couple: list[str]) -> None:
    """Both FMUs define the same 34 symbols. However a host loads them, each library finds its own, and the
    results are the same to the bit; also where the host lets the processor trap."""
    results = {
        how: run_coupled(couple, how, 40)
        for how in ["lazy local", "lazy global", "now local", "now global", "now local traps"]
    }
    assert len(results["now local"]) == 7
    assert set(map(tuple, results.values())) == {tuple(results["now local"])}


def test_another_rounding(couple: list[str]) -> None:
    """A host that rounds upward gets other last digits, and its rounding back."""
    nearest, upward = run_coupled(couple, "now", 40), run_coupled(couple, "now upward", 40)
    assert upward != nearest
    # The solver's tolerance (0.01 % of full scale) does not depend on the rounding.
    assert [float.fromhex(x) for x in upward] == pytest.approx([float.fromhex(x) for x in nearest], rel=1e-4)


def test_small_stack(couple: list[str]) -> None:
    """128 kB, what musl gives each thread, are enough for the FMU and its host."""
    limited = ("bash", "-c", 'ulimit -s 128; exec "$@"', "bash")
    assert run_coupled(couple, "now", 40, limited) == run_coupled(couple, "now", 40)


VALGRIND = (
    "valgrind",
    "--quiet",
    "--leak-check=full",
    "--errors-for-leak-kinds=definite,indirect",
    "--error-exitcode=99",
)


def test_valgrind_finds_nothing(couple: list[str]) -> None:
    """Both FMUs, coupled, with states saved and restored, errors provoked, and a reset: no access beyond what
    is theirs, nothing read before it was written, no memory lost."""
    assert len(run_coupled(couple, "now", 10, VALGRIND)) == 7


def test_valgrind_would_find_a_leak(host: Path, fmus: dict[str, Fmu]) -> None:
    """With the library unloaded at the end, as above: what only the library knows is lost with it."""
    command = [*VALGRIND, str(host), "cycle", "4", "1", "0", "instance"]
    command += arguments(fmus["BoostController"], fmus["BoostPlant"])
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 99
    assert "definitely lost" in result.stderr


def test_library_that_stays_is_seen(host: Path, fmus: dict[str, Fmu], tmp_path: Path) -> None:
    """The host does find out when dlclose leaves a library in the process, as a thread's destructors do."""
    fmu = fmus["BoostController"]
    copy = tmp_path / "BoostController.so"
    shutil.copy(fmu.library, copy)
    _, *rest = arguments(fmu, fmus["BoostPlant"])
    command = [str(host), "cycle", "4", "1", "0", "0", str(copy), *rest]
    preloaded = {**os.environ, "LD_PRELOAD": str(copy)}
    for environment, code in [(dict(os.environ), 0), (preloaded, 1)]:
        result = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
        assert result.returncode == code, result.stderr
    assert "found == loaded" in result.stderr
