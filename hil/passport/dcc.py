"""The results as PTB's Digital Calibration Certificate: XML, schema 3.2.1, values in D-SI units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

from hil.bench.hand.certificate import DCC, SI
from hil.errors import UnitError
from hil.passport.certificate import Signer
from hil.passport.unit import Unit, UnitRun
from hil.record.measurement import COVERAGE_FACTOR, Measured, Verdict
from hil.record.recording import Recording
from hil.report.provenance import stated_or_measured
from hil.report.results import value_text
from hil.units import scale_and_offset
from hil.version import __version__

VERSION = "3.2.1"
_AS_THEY_ARE = {"1": r"\one", "%": r"\percent", "deg": r"\degree", "°": r"\degree",
                "rad/s": r"\radian\second\tothe{-1}",
                "°C": r"\degreecelsius", "degC": r"\degreecelsius"}  # fmt: skip
# Units of pint and their D-SI names; a quantity is stated in the first that it converts to.
_SI_UNITS = {
    "m": r"\metre", "s": r"\second", "A": r"\ampere", "V": r"\volt", "ohm": r"\ohm", "H": r"\henry", "Pa": r"\pascal",
    "Hz": r"\hertz", "N": r"\newton", "W": r"\watt", "kg": r"\kilogram", "m/s": r"\metre\second\tothe{-1}",
    "m^3/s": r"\metre\tothe{3}\second\tothe{-1}", "Pa/A": r"\pascal\ampere\tothe{-1}",
    "Pa/s": r"\pascal\second\tothe{-1}", "m^3": r"\metre\tothe{3}",
}  # fmt: skip
_CONFORMITY: Mapping[Verdict, str] = {"pass": "pass", "fail": "fail", "cannot tell": "noPass"}


def certificate_xml(unit: Unit, signer: Signer, identifier: str, *, names: bool) -> bytes:
    """The certificate of a unit.

    Args:
        unit: with its runs.
        signer: stands for the laboratory, which signs the file that this is attached to.
        identifier: of this certificate, unlike any other.
        names: whether the operator is named.
    """
    register_namespace("dcc", DCC)
    register_namespace("si", SI)
    root = Element(_dcc("digitalCalibrationCertificate"), {"schemaVersion": VERSION})
    _administration(SubElement(root, _dcc("administrativeData")), unit, signer, identifier, names)
    results = SubElement(root, _dcc("measurementResults"))
    for run in unit.runs:
        _measurement(SubElement(results, _dcc("measurementResult")), run)
    indent(root)
    return bytes(tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _administration(at: Element, unit: Unit, signer: Signer, identifier: str, names: bool) -> None:
    software = SubElement(SubElement(at, _dcc("dccSoftware")), _dcc("software"))
    _text(software, "name", "valve-hil")
    _plain(software, "release", __version__)
    core = SubElement(at, _dcc("coreData"))
    first, last = unit.dates
    for name, value in (
        ("countryCodeISO3166_1", "ZZ"), ("usedLangCodeISO639_1", "en"), ("mandatoryLangCodeISO639_1", "en"),
        ("uniqueIdentifier", identifier), ("beginPerformanceDate", first.isoformat()),
        ("endPerformanceDate", last.isoformat()), ("performanceLocation", "laboratory"),
    ):  # fmt: skip
        _plain(core, name, value)
    item = SubElement(SubElement(at, _dcc("items")), _dcc("item"))
    _text(item, "name", f"SIMULATED: {unit.valve}" if unit.simulated else unit.valve)
    _identified(item, "owner", unit.serial, "serial number")
    laboratory = SubElement(at, _dcc("calibrationLaboratory"))
    _contact(laboratory, "contact", signer.name)
    _plain(laboratory, "cryptElectronicSignature", "false")  # of the file that carries this one
    operators = dict.fromkeys(str(run.recording.meta.get("operator") or "not stated") for run in unit.runs)
    persons = SubElement(at, _dcc("respPersons"))
    for operator in operators if names else ("left out",):
        person = SubElement(SubElement(persons, _dcc("respPerson")), _dcc("person"))
        _text(person, "name", operator)
    _contact(at, "customer", "not stated")
    _statement(at, unit)


def _statement(at: Element, unit: Unit) -> None:
    statement = SubElement(SubElement(at, _dcc("statements")), _dcc("statement"))
    _text(statement, "name", "Conformity of the unit")
    _plain(statement, "norm", "ISO 14253-1")
    declaration = SubElement(statement, _dcc("declaration"))
    verdict: str = unit.verdict or "not judged: no limit was given"
    if not unit.finished:
        verdict += "; a test did not end as planned"
    SubElement(declaration, _dcc("content")).text = f"{verdict}; guard band: expanded uncertainty, k = 2"
    if unit.verdict is not None:
        _plain(statement, "conformity", _CONFORMITY[unit.verdict])


def _measurement(at: Element, run: UnitRun) -> None:
    meta = run.recording.meta
    _text(at, "name", f"{run.results.procedure}, {run.results.run}")
    instruments = [one for one in meta.get("instruments", ()) if isinstance(one, Mapping) and one.get("name")]
    if instruments:
        equipment = SubElement(at, _dcc("measuringEquipments"))
        for one in instruments:
            entry = SubElement(equipment, _dcc("measuringEquipment"))
            _text(entry, "name", str(one["name"]))
            if one.get("serial"):
                _identified(entry, "owner", str(one["serial"]), "serial number")
    _influences(at, run.recording)
    results = SubElement(at, _dcc("results"))
    for m in run.findings.measured:
        _result(SubElement(results, _dcc("result")), m)
    if not run.findings.measured:
        _nothing(SubElement(results, _dcc("result")))


def _influences(at: Element, recording: Recording) -> None:
    facts = stated_or_measured(recording)
    if facts:
        conditions = SubElement(at, _dcc("influenceConditions"))
        for label, text in facts:
            one = SubElement(conditions, _dcc("influenceCondition"))
            _text(one, "name", label)
            _text(SubElement(one, _dcc("data")), "text", text)


def _nothing(at: Element) -> None:
    _text(at, "name", "none")
    _text(SubElement(at, _dcc("data")), "text", "nothing could be evaluated of this run")


def _result(at: Element, m: Measured) -> None:
    _text(at, "name", m.name)
    if m.meaning:
        SubElement(SubElement(at, _dcc("description")), _dcc("content")).text = m.meaning
    quantity = SubElement(SubElement(at, _dcc("data")), _dcc("quantity"))
    stated = si_value(m)
    if stated is None:
        text = SubElement(quantity, _dcc("noQuantity"))
        SubElement(text, _dcc("content")).text = value_text(m, m.unit)
    else:
        _real(SubElement(quantity, _si("real")), *stated)
    if m.verdict is not None:
        metadata = SubElement(SubElement(quantity, _dcc("measurementMetaData")), _dcc("metaData"))
        limits = " … ".join("" if edge is None else f"{edge:g}" for edge in (m.low, m.high))
        declaration = SubElement(metadata, _dcc("declaration"))
        SubElement(declaration, _dcc("content")).text = f"limits {limits} {m.unit}: {m.verdict}"
        _plain(metadata, "conformity", _CONFORMITY[m.verdict])


def si_value(m: Measured) -> tuple[float, float | None, str] | None:
    """(value, expanded uncertainty or None, D-SI unit); None for a bound, or what D-SI has no unit for."""
    if m.value is None or m.relation != "=":
        return None
    expanded = m.expanded if m.std is not None and m.std > 0.0 else None
    if m.unit in _AS_THEY_ARE:
        return m.value, expanded, _AS_THEY_ARE[m.unit]
    for unit, name in _SI_UNITS.items():
        try:
            scale, offset = scale_and_offset(m.unit, unit)
        except UnitError:
            continue
        return scale * m.value + offset, None if expanded is None else abs(scale) * expanded, name
    return None


def _real(at: Element, value: float, expanded: float | None, unit: str) -> None:
    _plain(at, "value", f"{value:.10g}", _si)
    _plain(at, "unit", unit, _si)
    if expanded is not None:
        width = SubElement(at, _si("expandedUnc"))
        _plain(width, "uncertainty", f"{expanded:.8g}", _si)
        _plain(width, "coverageFactor", f"{COVERAGE_FACTOR:g}", _si)
        _plain(width, "coverageProbability", "0.95", _si)
        _plain(width, "distribution", "normal", _si)


def _contact(at: Element, name: str, who: str) -> None:
    contact = SubElement(at, _dcc(name))
    _text(contact, "name", who)
    location = SubElement(contact, _dcc("location"))
    SubElement(SubElement(location, _dcc("further")), _dcc("content")).text = "not stated"


def _identified(at: Element, issuer: str, value: str, name: str) -> None:
    one = SubElement(SubElement(at, _dcc("identifications")), _dcc("identification"))
    _plain(one, "issuer", issuer)
    _plain(one, "value", value)
    _text(one, "name", name)


def _text(at: Element, name: str, text: str) -> None:
    SubElement(SubElement(at, _dcc(name)), _dcc("content"), {"lang": "en"}).text = text


def _plain(at: Element, name: str, text: str, space: Any = None) -> None:
    SubElement(at, (space or _dcc)(name)).text = text


def _dcc(name: str) -> str:
    return f"{{{DCC}}}{name}"


def _si(name: str) -> str:
    return f"{{{SI}}}{name}"
