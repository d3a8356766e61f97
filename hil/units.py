"""Units at the doors: parse what a column header says, convert to what a plant or plot asks for.

Unit arithmetic is pint's; it is imported only when two spellings really differ, so that listing and
reading files in their own units stay fast.
"""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any

from hil.errors import UnitError

if TYPE_CHECKING:
    import pint

    from hil.arrays import Array

# Spellings that benches and loggers use and pint does not know, or takes for something else.
_SPELLINGS = {"1": "dimensionless", "": "dimensionless", "gpm": "gallon/minute", "GPM": "gallon/minute",
              "US gpm": "gallon/minute", "US gal/min": "gallon/minute", "USGPM": "gallon/minute",
              "cis": "inch**3/s", "CIS": "inch**3/s", "cim": "inch**3/min",
              "lpm": "l/min", "LPM": "l/min", "psig": "psi", "psia": "psi", "PSI": "psi",
              "BAR": "bar", "barg": "bar", "bara": "bar", "bar(g)": "bar", "bar(a)": "bar", "counts": "count",
              "Nm": "N*m", "pct": "%", "%FS": "%", "% FS": "%", "l/mn": "l/min", "kg/cm^2": "kgf/cm^2",
              "kg/cm²": "kgf/cm^2", "deg C": "degC", "oC": "degC", "oF": "degF", "℃": "degC", "V DC": "V",
              "U/min": "rpm", "r/min": "rpm", '"': "inch"}  # fmt: skip
# The same by their small letters, tried where a spelling is unknown: loggers write HZ, Kpa, PERCENT.
_FOLDED = {"hz": "Hz", "khz": "kHz", "kpa": "kPa", "mpa": "MPa", "degc": "degC", "vdc": "V", "prozent": "%",
           "sek": "s", "sekunde": "s", "sekunden": "s", "kn": "kN"}  # fmt: skip

# At the end of a name of the code, a longer one before what it ends in.
_ENDINGS = {"_rad_s": "rad/s", "_mm_s": "mm/s", "_s": "s", "_hz": "Hz", "_db": "dB", "_deg": "deg", "_c": "degC",
            "_bar": "bar", "_psi": "psi", "_mm": "mm", "_l_min": "l/min", "_lpm": "l/min", "_v": "V", "_a": "A",
            "_percent": "%"}  # fmt: skip


@cache
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    # Not from its cache on disk: that is written in place, and half a file there would make every unit unknown.
    return pint.UnitRegistry()


def units_ready() -> None:
    """Read the tables of units now, not when two units first differ."""
    _registry()


_TURNS, _ANGLES = re.compile("revolution"), re.compile("revolution|radian|degree")
# Typed twice, not a share of a share: 10 %% is no 0.1 %.
_TWICE = re.compile(r"%[\s*]*%")


@cache
def _unit(text: str) -> pint.Unit:
    registry = _registry()
    try:
        spelt = _spelt(text)
        if _TWICE.search(spelt):
            raise ValueError(spelt)
        try:
            if spelt[1:2].islower() and spelt[:1].isupper() and spelt not in registry:
                spelt = spelt.casefold()  # written out as loggers do: Volts, Newtons
            return registry.parse_units(spelt)
        except Exception:
            bare = spelt.casefold().rstrip(".")
            return registry.parse_units(_FOLDED.get(bare, bare))
    except Exception as error:  # pint raises several unrelated types for bad text
        raise UnitError(f"unknown unit '{text}'; examples: %, V, mA, l/min, bar, psi, mm, N, s, Hz, °C, 1") from error


def _spelt(text: str) -> str:
    """A unit as pint writes it: m3/h is m^3/h (mmH2O is left alone), l min-1 is l/min, l/Min and ltr/min too."""
    spelt = re.sub(r"(?<=[A-Za-z])([23])(?=$|[/*· ])", r"^\1", text.strip())
    spelt = re.sub(r"(?<=[A-Za-z])-([123])(?=$|[/*· ])", r"^-\1", spelt)
    spelt = re.sub(r"/\s*(min|sec|h)$", lambda per: per[0].casefold(), spelt, flags=re.IGNORECASE)
    spelt = re.sub(r"^(lit|ltr|Lit|Ltr)(?=/)", "l", spelt)
    return _SPELLINGS.get(spelt, re.sub(r"^ccm(?=/|$)", "cc", spelt))


@cache
def scale_and_offset(unit: str, to: str) -> tuple[float, float]:
    """The pair (a, b) with value[to] = a · value[unit] + b.

    Raises:
        UnitError: a unit is unknown, or the two measure different things.
    """
    if unit == to:
        return 1.0, 0.0
    registry = _registry()
    source, target = _unit(unit), _unit(to)
    if source.dimensionality != target.dimensionality:
        raise UnitError(f"unit '{unit}' cannot be read as '{to}': they measure different things")
    if _TURNS.search(str(target)) and not _ANGLES.search(str(source)):  # 1/min of a motor are turns
        source *= registry.revolution
    elif _TURNS.search(str(source)) and not _ANGLES.search(str(target)):
        target *= registry.revolution
    zero = float(registry.Quantity(0.0, source).to(target).magnitude)
    one = float(registry.Quantity(1.0, source).to(target).magnitude)
    return one - zero, zero


def is_convertible(unit: str, to: str) -> bool:
    """Whether two units are known, and of one quantity."""
    try:
        scale_and_offset(unit, to)
    except UnitError:
        return False
    return True


def in_base_units(unit: str) -> tuple[float, float, dict[str, int]]:
    """(factor, offset, exponents of kg, m, s, A, K) with SI value = factor · value + offset.

    Raises:
        UnitError: the unit is unknown, or has a power that is no whole number.
    """
    registry, parsed = _registry(), _unit(unit)
    powers = {_BASE.get(name, ""): float(str(power)) for name, power in parsed.dimensionality.items()}
    if "" in powers or any(power != round(power) for power in powers.values()):
        raise UnitError(f"unit '{unit}' is no product of whole powers of kg, m, s, A and K")
    zero = float(registry.Quantity(0.0, parsed).to_base_units().magnitude)
    one = float(registry.Quantity(1.0, parsed).to_base_units().magnitude)
    return one - zero, zero, {name: round(power) for name, power in powers.items()}


_BASE = {"[mass]": "kg", "[length]": "m", "[time]": "s", "[current]": "A", "[temperature]": "K"}


def convert(values: Array, unit: str, to: str) -> Array:
    """Values given in `unit`, expressed in `to`; the same array when nothing changes."""
    a, b = scale_and_offset(unit, to)
    if a == 1.0 and b == 0.0:
        return values
    return a * values + b


def split_unit(name: str) -> tuple[str, str]:
    """(`fluid temperature`, `degC`) from `fluid_temperature_c`; no unit when the name ends in none."""
    ending = next((known for known in _ENDINGS if name.endswith(known) and name != known), "")
    return name.removesuffix(ending).replace("_", " "), _ENDINGS.get(ending, "")


def behind_a_number(unit: str) -> str:
    """A unit as it stands behind a number: a space and the unit, nothing for a pure number."""
    return "" if unit == "1" else f" {unit}"


def check_unit(text: str) -> None:
    """Raise `UnitError` unless `text` is a unit this program understands."""
    if text not in _COMMON:
        _unit(text)


_COMMON = frozenset({"%", "V", "A", "mA", "l/min", "bar", "psi", "mm", "m", "N", "s", "Hz", "1", "rpm"})
