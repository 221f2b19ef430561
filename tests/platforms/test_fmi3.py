"""The libraries of FMI 3.0 that run on this machine, in FMPy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import NAMES
from fmpy import read_model_description, simulate_fmu


@pytest.mark.parametrize("name", NAMES)
def test_outputs_are_those_of_fmi_2(exported: Path, name: str) -> None:
    """From the start values, to the last bit."""
    results = []
    for path in (exported / f"{name}.fmu", exported / "fmi3" / f"{name}.fmu"):
        variables = read_model_description(path).modelVariables
        outputs = sorted(v.name for v in variables if v.causality == "output")
        results.append(simulate_fmu(path, stop_time=1.0, output_interval=0.0125, output=outputs))
    of_fmi2, of_fmi3 = results
    assert of_fmi2.dtype.names == of_fmi3.dtype.names
    assert len(of_fmi2) == 81
    assert all(np.array_equal(of_fmi2[output], of_fmi3[output]) for output in of_fmi2.dtype.names)
