"""Memory and the process: thousands of loads in a master in C, and valgrind.

The master is `host.c`, compiled here. In C because valgrind reports errors in Python itself, and because
glibc counts the allocated bytes of a run.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from conftest import TARGET
from master import Fmu

CYCLES = 2000

CHUNK = 32
"""The smallest chunk of glibc's malloc in bytes (64-bit: `MINSIZE`)."""

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
    """The master's arguments for an FMU, with its connected outputs and inputs."""

    def references(names: list[str], taken: list[str]) -> str:
        return ",".join(str(fmu.variables[name].valueReference) for name in names if name in taken)

    gives = references(fmu.named("output"), other.named("input"))
    takes = references(other.named("output"), fmu.named("input"))
    return [str(fmu.library), fmu.description.guid, gives, takes]


def coupling(host: Path, fmus: dict[str, Fmu]) -> list[str]:
    """The command that couples both FMUs, without its options."""
    plant, controller = (fmus[name] for name in NAMES)
    return [str(host), "couple", *arguments(plant, controller), *arguments(controller, plant)]


@pytest.fixture
def couple(host: Path, fmus: dict[str, Fmu]) -> list[str]:
    """The command that couples both FMUs with their native libraries."""
    return coupling(host, fmus)


def run_coupled(command: list[str], how: str, steps: int, before: tuple[str, ...] = ()) -> list[str]:
    """The exchanged values at the end."""
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
    """After a warm-up of a quarter, memory is constant: in 1500 cycles the smallest leak would be 1500
    chunks. (The host checks that the library is unmapped at the end of a cycle.)"""
    sizes, mappings = cycle(host, fmus, name, keep, "0")
    assert max(sizes) - sizes[0] < 1500 * CHUNK / 10
    assert set(mappings) == {mappings[0]}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("leak", "least"), [("100", 100), ("instance", 1000)])
def test_a_leak_is_detected(host: Path, fmus: dict[str, Fmu], name: str, leak: str, least: int) -> None:
    """The test above can fail: with 100 bytes a cycle, or an instance that is not freed."""
    sizes, _ = cycle(host, fmus, name, keep=False, leak=leak)
    assert sizes[-1] - sizes[0] >= 1500 * least


def same_in_all(ways: list[str], command: list[str]) -> None:
    results = {tuple(run_coupled(command, how, 40)) for how in ways}
    (result,) = results
    assert len(result) == 9


ENVIRONMENTS = ["now local", "now local traps", "now local upward"]
"""A host that has enabled traps, or rounds upward, still does so afterwards."""


def test_modes_of_loading(couple: list[str]) -> None:
    """Both FMUs define the same 34 symbols. However a host loads them, each library finds its own, and the
    results are the same to the bit, also if the host's floating-point environment is another one."""
    same_in_all(["lazy local", "lazy global", "now global", *ENVIRONMENTS], couple)


def test_environments_of_compiled_sources(host: Path, tmp_path: Path) -> None:
    """The libraries of the sources, too, compute in their own environment."""
    fmus = {name: Fmu(TARGET / "compiled" / "both" / f"{name}.fmu", tmp_path / name) for name in NAMES}
    same_in_all(ENVIRONMENTS, coupling(host, fmus))


def test_small_stack(couple: list[str]) -> None:
    """128 kB, musl's default for threads, are enough for the FMU and its host."""
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
    """Both FMUs, coupled, with saved and restored states, errors, and a reset: no invalid access, no
    uninitialized value, no leak."""
    assert len(run_coupled(couple, "now", 10, VALGRIND)) == 9


def test_valgrind_would_find_a_leak(host: Path, fmus: dict[str, Fmu]) -> None:
    """With the library unloaded at the end, as above: memory that only the library refers to is lost."""
    command = [*VALGRIND, str(host), "cycle", "4", "1", "0", "instance"]
    command += arguments(fmus["BoostController"], fmus["BoostPlant"])
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 99
    assert "definitely lost" in result.stderr


def test_library_that_stays_is_detected(host: Path, fmus: dict[str, Fmu], tmp_path: Path) -> None:
    """The host detects when dlclose leaves a library in the process, as with a thread's destructors."""
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
