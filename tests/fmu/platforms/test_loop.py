"""The experiment of fig. 13 on each platform that can be run here, by a master in C."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fmu.c_loop import run_loop
from fmu.experiments import BOOST_STEPS, ON_TOLERANCE
from fmu.master import Fmu
from fmu.platforms import NAMES

pytestmark = pytest.mark.platforms


@pytest.fixture(scope="session")
def run(host: Callable[[str], list[str]], fmus: dict[str, Fmu]) -> Callable[[str], np.ndarray]:
    """Runs the experiment on a platform; both FMUs' outputs in each step."""
    known: dict[str, np.ndarray] = {}

    def run(platform: str) -> np.ndarray:
        if platform not in known:
            known[platform] = run_loop(host(platform), platform, *(fmus[name] for name in NAMES))
        return known[platform]

    return run


def test_linux64(run: Callable[[str], np.ndarray], fmus: dict[str, Fmu]) -> None:
    """It is the experiment: boost pressure ends at its last reference, within the 2 Pa of
    tests/closed_loop.rs and the margin there."""
    names = [name for fmu in NAMES for name in fmus[fmu].named("output")]
    boost = run("linux64")[:, names.index("boost_pressure")]
    assert abs(boost[-1] - BOOST_STEPS[-1][1]) <= 2 + ON_TOLERANCE
    assert max(boost) > 184e3


@pytest.mark.parametrize("platform", ["win64", "aarch64-linux"])
def test_other_platforms_get_the_same_numbers(run: Callable[[str], np.ndarray], platform: str) -> None:
    here, there = run("linux64"), run(platform)
    assert here.shape == there.shape
    assert np.array_equal(here, there)
