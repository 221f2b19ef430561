"""The FMU of FMI 3.0 for all platforms, in FMPy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from fmu.platforms import file_of

pytestmark = pytest.mark.platforms


def test_it_is_valid_and_gives_the_outputs_of_fmi_2(exported: Path) -> None:
    """From the start values, to the last bit."""
    results = []
    for version in (2, 3):
        fmu = file_of(exported, "BoostController", version)
        assert validate_fmu(str(fmu)) == []
        outputs = sorted(
            variable.name
            for variable in read_model_description(fmu).modelVariables
            if variable.causality == "output"
        )
        results.append(simulate_fmu(fmu, stop_time=1.0, output_interval=0.0125, output=outputs))
    of_fmi2, of_fmi3 = results
    assert of_fmi2.dtype.names == of_fmi3.dtype.names
    assert len(of_fmi2) == 81
    assert all(np.array_equal(of_fmi2[output], of_fmi3[output]) for output in of_fmi2.dtype.names)
