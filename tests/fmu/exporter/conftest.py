"""The exported FMUs of the test model, and instances of it that are freed after each test.

`bash tests/run` exports them: one with both interfaces, and one with each alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from fmu import TARGET
from fmu.exporter.importer import Instance, Library
from fmu.master import Fmu


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Fmu]:
    """The test model with interfaces (`cs`, `me` or `cs,me`), extracted."""

    def exported(interfaces: str) -> Fmu:
        path = TARGET / "test-model" / interfaces / "TestModel.fmu"
        assert path.is_file(), f"{path} is missing: bash tests/run exports it"
        return Fmu(path, tmp_path_factory.mktemp("fmu"))

    return exported


@pytest.fixture(scope="session")
def fmu(exported: Callable[[str], Fmu]) -> Fmu:
    """The one with both interfaces."""
    return exported("cs,me")


@pytest.fixture(scope="session")
def library(fmu: Fmu) -> Library:
    """Its library, loaded."""
    return Library(fmu.library)


@pytest.fixture
def make(fmu: Fmu, library: Library, capfd: pytest.CaptureFixture[str]) -> Iterator[Callable[..., Instance]]:
    """Makes instances, and frees them after the test. Nothing may be written to the host's streams: by
    default Rust writes each panic to stderr."""
    made: list[Instance] = []

    def make(kind: type[Instance] = Instance, **arguments) -> Instance:
        made.append(kind(fmu, library, **arguments))
        return made[-1]

    yield make
    for instance in made:
        instance.free()
    assert capfd.readouterr() == ("", "")
