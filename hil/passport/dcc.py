"""The results as PTB's Digital Calibration Certificate: XML, schema 3.2.1, values in D-SI units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from xml.etree.ElementTree import Element, indent, register_namespace, tostring

from hil.bench.manual.certificate import DCC, SI
from hil.errors import UnitError
from hil.passport.certificate import Signer
from hil.passport.unit import Unit, UnitRun
from hil.record.measurement import COVERAGE_FACTOR, Measured, Verdict
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
    root = _dcc(
        "digitalCalibrationCertificate",
        _dcc("administrativeData", *_administration(unit, signer, identifier, names)),
        _dcc("measurementResults", *(_dcc("measurementResult", *_measurement(run)) for run in unit.runs)),
    )
    root.set("schemaVersion", VERSION)
    indent(root)
    return bytes(tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _administration(unit: Unit, signer: Signer, identifier: str, names: bool) -> Iterator[Element]:
    yield _dcc("dccSoftware/software", _text("name", "valve-hil"), _dcc("release", __version__))
    first, last = unit.dates
    core = {
        "countryCodeISO3166_1": "ZZ", "usedLangCodeISO639_1": "en", "mandatoryLangCodeISO639_1": "en",
        "uniqueIdentifier": identifier, "beginPerformanceDate": first.isoformat(),
        "endPerformanceDate": last.isoformat(), "performanceLocation": "laboratory",
    }  # fmt: skip
    yield _dcc("coreData", *(_dcc(name, value) for name, value in core.items()))
    valve = f"SIMULATED: {unit.valve}" if unit.simulated else unit.valve
    yield _dcc("items/item", _text("name", valve), _serial(unit.serial))
    # the signature is that of the file which carries this one
    yield _dcc("calibrationLaboratory", _contact("contact", signer.name), _dcc("cryptElectronicSignature", "false"))
    operators = dict.fromkeys(str(run.recording.meta.get("operator") or "not stated") for run in unit.runs)
    persons = (_dcc("respPerson/person", _text("name", one)) for one in (operators if names else ("left out",)))
    yield _dcc("respPersons", *persons)
    yield _contact("customer", "not stated")
    verdict: str = unit.verdict or "not judged: no limit was given"
    if not unit.finished:
        verdict += "; a test did not end as planned"
    yield _dcc(
        "statements/statement", _text("name", "Conformity of the unit"), _dcc("norm", "ISO 14253-1"),
        _dcc("declaration/content", f"{verdict}; guard band: expanded uncertainty, k = 2"), *_conformity(unit.verdict),
    )  # fmt: skip


def _measurement(run: UnitRun) -> Iterator[Element]:
    yield _text("name", f"{run.results.procedure}, {run.results.run}")
    stated = run.recording.meta.get("instruments", ())
    if instruments := [one for one in stated if isinstance(one, Mapping) and one.get("name")]:
        yield _dcc("measuringEquipments", *map(_instrument, instruments))
    if facts := stated_or_measured(run.recording):
        influences = (_dcc("influenceCondition", _text("name", label), _data(text)) for label, text in facts)
        yield _dcc("influenceConditions", *influences)
    nothing = _dcc("result", _text("name", "none"), _data("nothing could be evaluated of this run"))
    yield _dcc("results", *(map(_result, run.findings.measured) if run.findings.measured else [nothing]))


def _instrument(one: Mapping[str, object]) -> Element:
    serial = [_serial(str(one["serial"]))] if one.get("serial") else []
    return _dcc("measuringEquipment", _text("name", str(one["name"])), *serial)


def _result(m: Measured) -> Element:
    stated = si_value(m)
    value = _dcc("noQuantity/content", value_text(m, m.unit)) if stated is None else _real(*stated)
    meaning = [_dcc("description/content", m.meaning)] if m.meaning else []
    if m.verdict is None:
        judged = []
    else:
        declared = _dcc("declaration/content", f"limits {m.limits} {m.unit}: {m.verdict}")
        judged = [_dcc("measurementMetaData/metaData", declared, *_conformity(m.verdict))]
    return _dcc("result", _text("name", m.name), *meaning, _dcc("data/quantity", value, *judged))


def si_value(m: Measured) -> tuple[float, float | None, str] | None:
    """(value, expanded uncertainty or None, D-SI unit); None for a bound, or what D-SI has no unit for."""
    if m.value is None or m.relation != "=":
        return None
    expanded = m.expanded if m.std is not None and m.std > 0.0 else None
    if name := (_AS_THEY_ARE | _SI_UNITS).get(m.unit):
        return m.value, expanded, name
    for unit, name in _SI_UNITS.items():
        try:
            scale, offset = scale_and_offset(m.unit, unit)
        except UnitError:
            continue
        return scale * m.value + offset, None if expanded is None else abs(scale) * expanded, name
    return None


def _real(value: float, expanded: float | None, unit: str) -> Element:
    width = [] if expanded is None else [
        _si("expandedUnc", _si("uncertainty", f"{expanded:.8g}"), _si("coverageFactor", f"{COVERAGE_FACTOR:g}"),
            _si("coverageProbability", "0.95"), _si("distribution", "normal")),
    ]  # fmt: skip
    return _si("real", _si("value", f"{value:.10g}"), _si("unit", unit), *width)


def _conformity(verdict: Verdict | None) -> list[Element]:
    return [] if verdict is None else [_dcc("conformity", _CONFORMITY[verdict])]


def _contact(name: str, who: str) -> Element:
    return _dcc(name, _text("name", who), _dcc("location/further/content", "not stated"))


def _serial(number: str) -> Element:
    return _dcc(
        "identifications/identification", _dcc("issuer", "owner"), _dcc("value", number), _text("name", "serial number")
    )


def _data(text: str) -> Element:
    return _dcc("data", _text("text", text))


def _text(name: str, text: str) -> Element:
    content = _dcc("content", text)
    content.set("lang", "en")
    return _dcc(name, content)


def _dcc(path: str, *inside: Element | str, space: str = DCC) -> Element:
    """An element `a`, or one inside another, `a/b`, with a text or elements in it."""
    name, _slash, further = path.partition("/")
    made = Element(f"{{{space}}}{name}")
    for one in [_dcc(further, *inside, space=space)] if further else inside:
        if isinstance(one, str):
            made.text = one
        else:
            made.append(one)
    return made


def _si(name: str, *inside: Element | str) -> Element:
    return _dcc(name, *inside, space=SI)
