"""The ladder's FMUs, and instances of them that are freed after each test."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest

from fmu.exchange import Exchange
from fmu.exporter.importer import Instance, Library
from fmu.ladder import FMUS, exported
from fmu.master import Fmu, Value

VERSIONS = [
    pytest.param(FMUS, id="fmi2"),
    pytest.param(FMUS / "fmi3", id="fmi3", marks=pytest.mark.fmi3),
]


@pytest.fixture(scope="session", params=VERSIONS)
def fmu(request: pytest.FixtureRequest) -> Callable[[str], Path]:
    """The FMU of a model, in both versions of FMI."""
    return lambda model: exported(model, request.param)


@pytest.fixture(scope="session")
def fmu2() -> Callable[[str], Path]:
    """The FMU of a model, of FMI 2.0."""
    return lambda model: exported(model, FMUS)


@pytest.fixture
def instance(fmu2: Callable[[str], Path], tmp_path: Path) -> Iterator[Callable[..., Instance]]:
    """Makes initialized instances of FMI 2.0 with their resources, each from a copy of its library."""
    made: list[Instance] = []
    folders = (tmp_path / str(number) for number in itertools.count())

    def instance(
        model: str,
        kind: int,
        start_values: Mapping[str, object] | None = None,
        resources: bytes | None = b"",
        **experiment: float,
    ) -> Instance:
        fmu = Fmu(fmu2(model), next(folders))
        if resources == b"":
            resources = (fmu.folder / "resources").resolve().as_uri().encode()
        made.append(Instance(fmu, Library(fmu.library), fmu_type=kind, resource_location=resources))
        assert made[-1].component, made[-1].messages
        for name, value in (start_values or {}).items():
            made[-1].ok(*made[-1].settings({name: value}))
        return made[-1].initialize(**experiment)

    yield instance
    for one in made:
        one.free()


@pytest.fixture
def exchange(fmu2: Callable[[str], Path], tmp_path: Path) -> Iterator[Callable[..., Exchange]]:
    """Makes instances of FMI 2.0 for Model Exchange in FMPy, in Continuous-Time Mode."""
    made: list[Exchange] = []

    def exchange(model: str, start_values: Mapping[str, Value], start_time: float) -> Exchange:
        made.append(Exchange(Fmu(fmu2(model), tmp_path)))
        return made[-1].start(start_values, start_time=start_time).go()

    yield exchange
    for one in made:
        one.free()
