"""The names of units in another reader: pint, as importers in Python use it."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import pint
import pytest

REGISTRY = pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
ROUNDING = 4 * 2.0**-52
"""A unit is a product of some powers."""


def read(name: str) -> pint.Unit:
    """A unit by its name, in which an exponent follows its symbol."""
    return REGISTRY.parse_units(re.sub(r"([a-zA-Z])(-?\d)", r"\1^\2", name))


@pytest.mark.parametrize("model", ["BoostPlant", "BoostController"])
def test_pint_reads_every_unit_as_it_is_defined(exported: Path, model: str) -> None:
    with ZipFile(exported / f"{model}.fmu") as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    units = {unit.get("name"): unit for unit in root.findall("UnitDefinitions/Unit")}
    assert len(units) > 10
    for name, unit in units.items():
        one = REGISTRY.Quantity(1.0, read(name))
        base = unit.find("BaseUnit")
        if base is not None:
            factor = float(base.attrib.pop("factor", 1.0))
            powers = [f"{symbol}^{exponent}" for symbol, exponent in base.items()]
            assert one.m_as("*".join(powers)) == pytest.approx(factor, rel=ROUNDING), name
        for shown in unit.findall("DisplayUnit"):
            factor, offset = float(shown.get("factor", "1")), float(shown.get("offset", "0"))
            assert one.m_as(read(shown.get("name"))) == pytest.approx(factor + offset, rel=ROUNDING), name
