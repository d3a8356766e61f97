"""A sensor's Digital Calibration Certificate (PTB's DCC, XML with D-SI units) as the points of a calibration."""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, fromstring

from hil.errors import FileError, UnitError, reading
from hil.record.measurement import COVERAGE_FACTOR
from hil.units import scale_and_offset
from hil.untrusted import open_untrusted

DCC, SI = "https://ptb.de/dcc", "https://ptb.de/si"
"""Namespaces of the certificate and of its values."""

_REFERENCE, _INDICATED, _ERROR = "basic_referenceValue", "basic_measuredValue", "basic_measurementError"
_TOKEN = re.compile(r"\\([A-Za-z]+)(?:\{([^}]*)\})?")
_PREFIXES = frozenset({"kilo", "milli", "micro", "mega", "hecto", "centi", "deci", "deca", "giga", "nano"})
_NAMES = {"degreecelsius": "degC", "percent": "%", "one": "1"}
# How D-SI 2.1 and 2.2 call an uncertainty, alone and in a list, and whether a coverage factor stands beside it.
_WIDTHS = {"uncertainty": True, "valueExpandedMU": True, "standardUnc": False, "valueStandardMU": False}


@dataclass(frozen=True, slots=True)
class CertifiedPoint:
    """What an instrument indicated, what the reference was, and the standard uncertainty; None where none is stated."""

    indicated: float
    reference: float
    std: float | None


@dataclass(frozen=True, slots=True)
class Certificate:
    """What a laboratory certifies of an instrument, and the last day on which it measured."""

    identifier: str
    laboratory: str
    date: dt.date
    tables: dict[str, Element]
    path: Path

    @property
    def source(self) -> str:
        """In words, for a bench file."""
        return f"DCC {self.identifier}, {self.laboratory}"

    def points(self, table: str, unit: str, indicated_in: tuple[str, ...]) -> tuple[str, list[CertifiedPoint]]:
        """The points of a table of results.

        Args:
            table: its name; may be left empty where there is only one.
            unit: of reference and uncertainty.
            indicated_in: units that the indication may have; it is converted to the first that it can be.

        Returns:
            The unit of the indication, and the points.

        Raises:
            FileError: no such table or several, columns of different lengths, or a unit of another quantity.
        """
        names = ", ".join(f"'{name}'" for name in self.tables)
        if not table and len(self.tables) > 1:
            raise FileError(f"{self.path}: holds the tables {names}; name one (--table)")
        found = next(iter(self.tables.values())) if not table else self.tables.get(table)
        if found is None:
            raise FileError(f"{self.path}: no table '{table}'; it holds {names}")
        indicated_unit, indicated, indicated_std = self._column(found, _INDICATED, indicated_in)
        _, reference, std = self._column(found, _REFERENCE, (unit,))
        if len(indicated) != len(reference):
            raise FileError(f"{self.path}: {len(indicated)} indications for {len(reference)} values of the reference")
        if indicated_unit == unit and not any(std):
            std = indicated_std
        if not any(std) and any(_quantities(found, _ERROR)):
            _, _, std = self._column(found, _ERROR, (unit,))
        whole = std if len(std) == len(reference) else [None] * len(reference)
        return indicated_unit, [CertifiedPoint(*point) for point in zip(indicated, reference, whole, strict=True)]

    def _column(self, table: Element, kind: str, units: tuple[str, ...]) -> tuple[str, list[float], list[float | None]]:
        """Unit, values and standard uncertainties of all quantities of a kind, in the order of the certificate."""
        unit, values, stds = "", list[float](), list[float | None]()
        for quantity in _quantities(table, kind):
            stated = [one for tag in ("realListXMLList", "real") for one in quantity.iter(f"{{{SI}}}{tag}")]
            try:
                read = next((r for to in units for one in stated if (r := _converted(one, to)) is not None), None)
            except ValueError as error:
                raise FileError(f"{self.path}: {kind}: {error}") from None
            if read is None or unit not in ("", read[0]):
                has = ", ".join(dict.fromkeys(_text(one, "unit", "unitXMLList") or "no unit" for one in stated))
                raise FileError(f"{self.path}: {kind} is in {has or 'no unit'}, which is not {' or '.join(units)}")
            unit = read[0]
            values += read[1]
            stds += read[2]
        return unit, values, stds


def read_certificate(path: Path) -> Certificate:
    """A certificate, and its tables that hold a reference beside an indication.

    Raises:
        FileError: it is none, or there is no such table; says what there is.
    """
    try:
        with reading(path), open_untrusted(path.parent, path.name) as file:
            root = fromstring(file.read())
    except ParseError as error:
        raise FileError(f"{path}: is no XML: {error}") from None
    if _local(root) != "digitalCalibrationCertificate":
        raise FileError(f"{path}: is no Digital Calibration Certificate (DCC); its first element is '{_local(root)}'")
    tables, kinds = {}, dict[str, None]()
    for number, result in enumerate(root.iter(f"{{{DCC}}}result"), 1):
        own = [kind for one in result.iter(f"{{{DCC}}}quantity") for kind in one.get("refType", "").split()]
        kinds |= dict.fromkeys(own)
        if _REFERENCE in own and _INDICATED in own:
            name = _content(result, "{*}name")
            tables[name if name and name not in tables else f"{name} {number}".strip()] = result
    if not tables:
        raise FileError(
            f"{path}: no result holds quantities of the types {_REFERENCE} and {_INDICATED}; it has "
            f"{', '.join(kinds) or 'none with a refType'}"
        )
    core = "{*}administrativeData/{*}coreData/{*}"
    try:
        date = dt.date.fromisoformat((root.findtext(f"{core}endPerformanceDate") or "").strip()[:10])
    except ValueError:
        raise FileError(f"{path}: endPerformanceDate: it does not say when it was measured") from None
    return Certificate(
        (root.findtext(f"{core}uniqueIdentifier") or "").strip(),
        _content(root, "{*}administrativeData/{*}calibrationLaboratory/{*}contact/{*}name"), date, tables, path,
    )  # fmt: skip


def unit_of(d_si: str) -> str:
    r"""A D-SI unit as it is written here: `\milli\bar` is millibar, `\litre\minute\tothe{-1}` litre*minute^-1."""
    parts, prefix, sign = list[str](), "", ""
    for name, power in _TOKEN.findall(d_si):
        if name == "tothe" and parts:
            parts[-1] = f"{parts[-1].removesuffix('^-1')}^{power}"
        elif name == "per":
            sign = "^-1"
        elif name in _PREFIXES:
            prefix = name
        else:
            parts.append(f"{prefix}{_NAMES.get(name, name)}{sign}")
            prefix = sign = ""
    return "*".join(parts)


def _converted(stated: Element, to: str) -> tuple[str, list[float], list[float | None]] | None:
    """(unit, values, standard uncertainties) in a unit; None where the quantity is another.

    Raises:
        ValueError: a value or an uncertainty is no number.
    """
    units = set(_text(stated, "unit", "unitXMLList").split())
    values = _numbers(_text(stated, "value", "valueXMLList"))
    try:
        scale, offset = scale_and_offset(unit_of(units.pop()), to) if len(units) == 1 else (0.0, 0.0)
    except UnitError:
        return None
    if not scale or not values:
        return None
    stds: list[float | None] = [None] * len(values)
    for name, expanded in _WIDTHS.items():
        if widths := _numbers(_text_below(stated, name)):
            stated_factors = _numbers(_text_below(stated, "coverageFactor")) or [COVERAGE_FACTOR]
            if 0.0 in stated_factors:
                raise ValueError("a coverage factor of 0")
            factors = _as_many(stated_factors if expanded else [1.0], values)
            stds = [abs(scale) * w / k for w, k in zip(_as_many(widths, values), factors, strict=True)]
            break
    return to, [scale * value + offset for value in values], stds


def _numbers(text: str) -> list[float]:
    """Finite numbers with blanks between; raises `ValueError` for any other."""
    found = [float(part) for part in text.split()]
    if bad := next((value for value in found if not math.isfinite(value)), None):
        raise ValueError(f"{bad} is no value")
    return found


def _as_many(numbers: Sequence[float], values: Sequence[float]) -> Sequence[float]:
    """One number for each value; a single one holds for all."""
    if len(numbers) not in (1, len(values)):
        raise ValueError(f"{len(numbers)} uncertainties or coverage factors for {len(values)} values")
    return [numbers[0]] * len(values) if len(numbers) == 1 else numbers


def _quantities(table: Element, kind: str) -> Iterator[Element]:
    every = table.iter(f"{{{DCC}}}quantity")
    return (one for one in every if kind in one.get("refType", "").split())


def _text(at: Element, *names: str) -> str:
    """The text of the first child that has one of these names."""
    return next((text for name in names if (text := at.findtext(f"{{*}}{name}"))), "").strip()


def _text_below(at: Element, name: str) -> str:
    """The text of the first element anywhere below that has this name, alone or as a list."""
    found = (one for one in at.iter() if _local(one) in (name, f"{name}XMLList"))
    return next((one.text or "" for one in found), "")


def _content(at: Element, path: str) -> str:
    return " ".join((at.findtext(f"{path}/{{*}}content") or "").split())


def _local(one: Element) -> str:
    return one.tag.rpartition("}")[2]
