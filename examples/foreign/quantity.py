"""Units for PythonFMU: variables with units, and models that define them.

PythonFMU 0.7 writes no units, but its classes for variables and models can be extended. With declared units,
`boost-fmu check` finds the conversions.
"""

from xml.etree.ElementTree import Element, SubElement

from pythonfmu import Fmi2Slave, Real

BASE_UNITS = {
    "1": {},
    "%": {"factor": "0.01"},
    "%/Pa": {"kg": "-1", "m": "1", "s": "2", "factor": "0.01"},
    "s": {"s": "1"},
    "rad/s": {"rad": "1", "s": "-1"},
    "V": {"kg": "1", "m": "2", "s": "-3", "A": "-1"},
    "Pa": {"kg": "1", "m": "-1", "s": "-2"},
    "bar": {"kg": "1", "m": "-1", "s": "-2", "factor": "1e5"},
}
"""Each unit in SI base units: a value times the factor is in SI units."""


class Quantity(Real):
    """A real variable with a unit."""

    def __init__(self, name, unit, **attributes):
        super().__init__(name, **attributes)
        self.unit = unit

    def to_xml(self):
        element = super().to_xml()
        element.find("Real").set("unit", self.unit)
        return element


class SlaveWithUnits(Fmi2Slave):
    """A model with quantities as variables and outputs calculated during initialization."""

    def to_xml(self, *options):
        root = super().to_xml(*options)
        definitions = Element("UnitDefinitions")
        for unit in sorted({variable.unit for variable in self.vars.values()}):
            SubElement(SubElement(definitions, "Unit", name=unit), "BaseUnit", BASE_UNITS[unit])
        # The standard requires them between CoSimulation and LogCategories.
        root.insert(1, definitions)
        # The standard requires calculated outputs here as well; PythonFMU 0.7 omits them.
        structure = root.find("ModelStructure")
        structure.append(Element("InitialUnknowns"))
        structure.find("InitialUnknowns").extend(structure.find("Outputs"))
        return root
