"""The C sources of an FMU compile without warnings for many platforms, and compute the same bits on each."""

from __future__ import annotations

import os
import subprocess
import zipfile
from pathlib import Path

import pytest
from fmpy import read_model_description

from fmu import ROOT, TARGET

PROGRAM = ROOT / "tests" / "platforms" / "sources.c"

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror"]

ZIG = [str(TARGET / "release-tools" / "bin" / "python"), "-m", "ziglang", "cc", "-target"]
"""A clang for any platform."""

SANITIZED = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

CONTRACTED = ["-O2", "-march=native", "-std=gnu99"]
"""What has compilers contract, unless the sources prevent it."""

COMPILERS = {
    "gcc -O0, little memory": ["gcc", *STRICT, "-O0", "-DMODEL_PAGES=20"],
    "gcc, contracting": ["gcc", *STRICT, *CONTRACTED, "-ffp-contract=fast"],
    "gcc, sanitized": ["gcc", *STRICT, *SANITIZED],
    "gcc, i386": ["i686-linux-gnu-gcc", *STRICT, "-O1", "-static", "-msse2", "-mfpmath=sse"],
    "gcc, riscv64": ["riscv64-linux-gnu-gcc", *STRICT, "-O1", "-static"],
    "gcc, Windows": ["x86_64-w64-mingw32-gcc", *STRICT, "-O1", "-D__USE_MINGW_ANSI_STDIO=1"],
    "clang, contracting": [*ZIG, "x86_64-linux-gnu.2.17", *STRICT, *CONTRACTED],
    "clang, aarch64": [*ZIG, "aarch64-linux-gnu.2.17", *STRICT, "-O1"],
    # A compiler of C11 without extensions; its warnings are of what the extensions say.
    "clang as any of C11": [*ZIG, "x86_64-linux-gnu.2.17", "-std=c11", "-U__GNUC__", "-O1", "-w"],
    # A compiler of C99 without extensions.
    "tcc": ["tcc", *STRICT, "-DACQUIRE=", "-DRELEASE="],
}

HERE = ["gcc -O0, little memory", "tcc"]
"""What the second tier takes of them: it needs no other processor, and no further compiler."""

EACH = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in HERE else pytest.mark.platforms) for name in COMPILERS]
)

EMULATORS = {
    "gcc, riscv64": ["qemu-riscv64"],
    # Debian's folder for the libraries of the other processor.
    "clang, aarch64": ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"],
}


@pytest.fixture(scope="session")
def fmu(folder: Path) -> Path:
    """An FMU with sources, extracted."""
    path = TARGET / "sources" / "ladder" / "VanDerPol.fmu"
    assert path.is_file(), f"{path} is missing: bash tests/run rest exports it"
    to = folder / "sources"
    with zipfile.ZipFile(path) as archive:
        archive.extractall(to)
    return to


def numbers(
    fmu: Path, folder: Path, command: list[str], emulator: list[str], inputs: list[Path]
) -> list[str]:
    """Compiles the program with sources or a library, and runs it."""
    program = folder / "program.exe"
    subprocess.run([*command, PROGRAM, *inputs, "-o", program, "-lm"], check=True)
    guid = read_model_description(str(fmu)).guid
    done = subprocess.run(
        [*emulator, program, guid], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.fixture(scope="session")
def native(fmu: Path, folder: Path) -> list[str]:
    """What the library prints that is in the FMU."""
    library = fmu / "binaries" / "linux64" / "VanDerPol.so"
    found = f"-Wl,-rpath,{library.parent}"
    to = folder / "native"
    to.mkdir()
    lines = numbers(fmu, to, [os.environ.get("CC", "cc"), found], [], [library])
    # Two instances at 200 points, a message of each refused call, three points after a restored state and a
    # reset.
    assert len(lines) == 2 * 200 + 3 + 3
    return lines


@EACH
def test_sources(
    fmu: Path, folder: Path, native: list[str], request: pytest.FixtureRequest, name: str
) -> None:
    emulator = EMULATORS.get(name, [])
    if name == "gcc, Windows":
        emulator = [str(request.getfixturevalue("wine") / "wine64")]
    to = folder / name.replace(", ", "-").replace(" ", "")
    to.mkdir()
    assert numbers(fmu, to, COMPILERS[name], emulator, sorted((fmu / "sources").glob("*.c"))) == native


@EACH
def test_the_functions_of_fmi_3(tmp_path: Path, name: str) -> None:
    """They compile, too; what is beneath is the same."""
    path = TARGET / "test-model" / "cs,me" / "fmi3" / "TestModel.fmu"
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
    source = tmp_path / "sources" / "fmi3.c"
    subprocess.run([*COMPILERS[name], "-c", source, "-o", tmp_path / "fmi3.o"], check=True)


@pytest.mark.platforms
@pytest.mark.parametrize("compiler", [["i686-linux-gnu-gcc"], ["i386-tcc", "-I/usr/i686-linux-gnu/include"]])
def test_the_x87_unit_is_refused(fmu: Path, tmp_path: Path, compiler: list[str]) -> None:
    command = [*compiler, "-std=c99", "-c", fmu / "sources" / "model.c", "-o", tmp_path / "model.o"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "compile with -msse2 -mfpmath=sse" in done.stderr


@pytest.mark.platforms
def test_processors_with_numbers_of_16_bits_are_not_refused(fmu: Path, tmp_path: Path) -> None:
    """For them, gcc has another `FLT_EVAL_METHOD`."""
    source = fmu / "sources" / "model.c"
    command = ["gcc", "-std=gnu99", "-march=sapphirerapids", "-c", source, "-o", tmp_path / "model.o"]
    subprocess.run(command, check=True)


@pytest.mark.parametrize("compiler", ["gcc", "tcc"])
def test_a_lock_of_the_importers_is_used(fmu: Path, tmp_path: Path, compiler: str) -> None:
    (tmp_path / "lock.h").write_text("void begin(void);\nvoid end(void);\n")
    lock = ["-DACQUIRE=begin()", "-DRELEASE=end()", "-include", tmp_path / "lock.h"]
    library = tmp_path / "fmi2.o"
    subprocess.run([compiler, *STRICT, *lock, "-c", fmu / "sources" / "fmi2.c", "-o", library], check=True)
    done = subprocess.run(["nm", library], capture_output=True, text=True, check=True)
    assert {"U begin", "U end"} <= {line.strip() for line in done.stdout.splitlines()}


def test_a_compiler_without_atomic_operations_is_told_what_it_takes(fmu: Path, tmp_path: Path) -> None:
    command = ["tcc", "-std=c99", "-c", fmu / "sources" / "fmi2.c", "-o", tmp_path / "fmi2.o"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "README.txt explains -DACQUIRE= and -DRELEASE=" in done.stderr
