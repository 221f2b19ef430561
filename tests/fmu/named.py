"""An instance that is called with nothing in between, and whose variables go by their names."""

from __future__ import annotations

from c_interface import Caller, Library
from fmpy.model_description import ModelDescription


class Named(Caller):
    """An instance of an FMU with this description."""

    component = None

    def __init__(self, library: Library, description: ModelDescription, **arguments) -> None:
        self.description = description
        self.variables = {variable.name: variable for variable in description.modelVariables}
        super().__init__(library, arguments.pop("guid", description.guid), **arguments)

    def references(self, *names: str) -> list[int]:
        """The value references of variables."""
        return [self.variables[name].valueReference for name in names]

    def output_references(self) -> list[int]:
        """The value references of all outputs."""
        variables = self.variables.values()
        return [variable.valueReference for variable in variables if variable.causality == "output"]
