"""`modelDescription.xml` of FMI 2.0 and 3.0: the variables with units and bounds, for a tool that imports the FMU."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from hil.errors import UnitError
from hil.fmu.source import Source
from hil.fmu.variables import FAR, Variable, Variables, variable_name
from hil.units import in_base_units

FmiVersion = Literal["2", "3"]
_STOP_S = 10.0


@dataclass(frozen=True, slots=True)
class _Described:
    """A variable as both versions describe it: attributes that all share, its type, and those of the type."""

    kind: Literal["Real", "Boolean"]
    attributes: dict[str, str]
    typed: dict[str, str]
    calculated: bool = False


def identifier(variables: Variables) -> str:
    """The name of the model in its binaries."""
    return re.sub(r"\W", "_", variables.plant.name)


def description(variables: Variables, source: Source, version: FmiVersion) -> bytes:
    """The XML document."""
    root = Element("fmiModelDescription", _head(variables, source, version))
    simulation = SubElement(root, "CoSimulation", _abilities(variables, version))
    if version == "2":
        SubElement(SubElement(simulation, "SourceFiles"), "File", name="fmi.c")
    _units(SubElement(root, "UnitDefinitions"), variables)
    categories = SubElement(root, "LogCategories")
    for name in ("logStatusError", "logEvents"):
        SubElement(categories, "Category", name=name)
    SubElement(root, "DefaultExperiment", startTime="0.0", stopTime=repr(_STOP_S), stepSize=repr(variables.step_s))
    entries = list(_described(variables, source))
    if version == "2":  # where importers ask the independent variable for a start value, which it may not have
        entries = [one for one in entries if one.attributes["causality"] != "independent"]
    _variables(SubElement(root, "ModelVariables"), entries, version)
    _structure(SubElement(root, "ModelStructure"), entries, version)
    indent(root)
    made: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return made + b"\n"


def _head(variables: Variables, source: Source, version: FmiVersion) -> dict[str, str]:
    active = ", ".join(f"{effect.name} at {effect.hook}" for effect in variables.model.effects) or "no effects"
    token = {"guid": source.token} if version == "2" else {"instantiationToken": source.token}
    return {
        "fmiVersion": f"{version}.0", "modelName": variables.plant.title, **token,
        "description": f"{variables.plant.title}; {active}. Without noise and without the uncertainties of the model.",
        "generationTool": "valve-hil", "variableNamingConvention": "structured",
    }  # fmt: skip


def _abilities(variables: Variables, version: FmiVersion) -> dict[str, str]:
    state = "FMUstate" if version == "2" else "FMUState"
    own = {"canNotUseMemoryManagementFunctions": "true"} if version == "2" else {
        "fixedInternalStepSize": repr(variables.step_s)
    }  # fmt: skip
    return {
        "modelIdentifier": identifier(variables), "canHandleVariableCommunicationStepSize": "true",
        f"canGetAndSet{state}": "true", f"canSerialize{state}": "true", **own,
    }  # fmt: skip


def _units(parent: Element, variables: Variables) -> None:
    for unit in variables.units:
        element = SubElement(parent, "Unit", name=unit)
        try:
            factor, offset, powers = in_base_units(unit)
        except UnitError:  # known by its name alone
            continue
        entries = {name: str(power) for name, power in powers.items()}
        if factor != 1.0:
            entries["factor"] = repr(factor)
        if offset:
            entries["offset"] = repr(offset)
        SubElement(element, "BaseUnit", entries)


def _described(variables: Variables, source: Source) -> Iterator[_Described]:
    varies = {"variability": "continuous"}
    yield _Described(
        "Real", {"name": "time", "valueReference": "0", "causality": "independent", **varies}, {"unit": "s"}
    )
    for i, signal in enumerate(variables.inputs, variables.first_input):
        shared = {"name": variable_name(signal), "valueReference": str(i), "causality": "input", **varies}
        yield _Described("Real", shared, {"unit": signal.unit, "start": "0.0"})
    for i, signal in enumerate(variables.outputs, variables.first_output):
        shared = {"name": variable_name(signal), "valueReference": str(i), "causality": "output", **varies}
        yield _Described("Real", {**shared, "initial": "calculated"}, {"unit": signal.unit}, calculated=True)
    for i, variable in enumerate(variables.parameters):
        fixed = not source.is_tunable and i < len(variables.plant.parameters)
        kind = ("local", "constant") if fixed else ("parameter", "tunable")
        shared = _parameter(variable.name, variables.first_parameter + i, kind, variable.meaning)
        yield _Described("Real", shared, {"unit": variable.unit, "start": _number(variable.start), **_bounds(variable)})
    for i, site in enumerate(variables.kernel.sites, variables.first_switch):
        name = f"effect.{site.effect.name}.{site.hook.name}.on"
        shared = _parameter(name, i, ("parameter", "fixed"), site.effect.title)
        yield _Described("Boolean", shared, {"start": str(variables.is_on(site)).lower()})


def _parameter(name: str, reference: int, kind: tuple[str, str], meaning: str) -> dict[str, str]:
    causality, variability = kind
    return {
        "name": name, "valueReference": str(reference), "causality": causality, "variability": variability,
        "initial": "exact", "description": meaning,
    }  # fmt: skip


def _bounds(variable: Variable) -> dict[str, str]:
    bounds = {"min": variable.low, "max": variable.high}
    return {name: _number(value) for name, value in bounds.items() if abs(value) < FAR}


def _variables(parent: Element, described: list[_Described], version: FmiVersion) -> None:
    for one in described:
        if version == "2":
            SubElement(SubElement(parent, "ScalarVariable", one.attributes), one.kind, one.typed)
        else:
            SubElement(parent, {"Real": "Float64"}.get(one.kind, one.kind), {**one.attributes, **one.typed})


def _structure(parent: Element, described: list[_Described], version: FmiVersion) -> None:
    if version == "2":
        for group in ("Outputs", "InitialUnknowns"):
            inside = SubElement(parent, group)
            for place, one in enumerate(described, 1):
                if one.calculated:
                    SubElement(inside, "Unknown", index=str(place))
        return
    for name in ("Output", "InitialUnknown"):
        for one in described:
            if one.calculated:
                SubElement(parent, name, valueReference=one.attributes["valueReference"])


def _number(value: float) -> str:
    return "NaN" if math.isnan(value) else repr(float(value))
