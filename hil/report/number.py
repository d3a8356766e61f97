"""Numbers as a report shows them: no more digits than the uncertainty supports."""

from __future__ import annotations

import math
import re

from hil.language.figures import localised
from hil.language.note import translated
from hil.language.words import place_words
from hil.signals.interval import is_arithmetic

MINUS = "\N{MINUS SIGN}"
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SMALLEST, _LARGEST = 1e-4, 1e7


def number(value: float | None, digits: int = 4) -> str:
    """A number whose uncertainty nobody stated, with so many significant digits; an em dash for none."""
    if value is None or math.isnan(value):
        return "—"
    if math.isinf(value):
        return "∞" if value > 0.0 else f"{MINUS}∞"
    if value == 0.0 or _SMALLEST <= abs(value) < _LARGEST:
        shown = f"{value:.{digits}g}"
        return _signed(f"{value:.0f}" if "e" in shown else shown)
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return _signed(f"{float(mantissa):g}·10{str(int(exponent)).translate(_SUPERSCRIPT)}")


def rounded(value: float | None, expanded: float | None) -> tuple[str, str]:
    """(value, uncertainty) as text: the uncertainty to two digits, the value to the same place.

    The second is empty when the uncertainty is not known, or zero as for a count.
    """
    if value is None or not math.isfinite(value) or expanded is None or not expanded > 0.0:
        return number(value), ""
    if is_arithmetic(expanded, value):
        return number(value, 9), ""
    if not math.isfinite(expanded):
        return number(value), "∞"
    if max(abs(value), expanded) < _SMALLEST or max(abs(value), expanded) >= _LARGEST:
        return _scaled(value, expanded)
    place = _place(expanded)
    return _signed(_to_place(value, place)), localised(_to_place(expanded, place))


def fixed(value: float, places: int) -> str:
    """A number with so many decimals."""
    return _signed(f"{value:.{places}f}") if math.isfinite(value) else number(value)


def with_uncertainty(value: float | None, expanded: float | None, unit: str = "") -> str:
    """`1.269 ± 0.012 Hz`; a pure number has no unit."""
    shown, width = rounded(value, expanded)
    text = f"{shown} ± {width}" if width else shown
    return f"{text} {unit_text(unit)}".rstrip() if value is not None else text


def with_std(value: float | None, std: float | None, unit: str = "") -> str:
    """The same of a value whose standard uncertainty is known, None where it is not."""
    from hil.record.measured import COVERAGE_FACTOR

    return with_uncertainty(value, None if std is None else COVERAGE_FACTOR * std, unit)


def with_unit(value: float, unit: str, digits: int = 3) -> str:
    """A number without stated uncertainty, with its unit; a pure number has none."""
    return f"{number(value, digits)} {unit_text(unit)}".rstrip()


def grouped(value: float) -> str:
    """A whole number in groups of three: `1 176 961`."""
    if not math.isfinite(value):
        return number(value)
    return _signed(f"{value:,.0f}").replace(",", "\N{NARROW NO-BREAK SPACE}")


def with_minus(text: str) -> str:
    """Text in which a hyphen before a number is a minus sign."""
    return re.sub(r"(?<![\w.])-(?=[\d.])", MINUS, text)


def note_text(note: str) -> str:
    """A note or a deviation as a page has it; what is none, a stranger's procedure has it, stays as it is."""
    return with_minus(translated(note))


def label_text(label: str) -> str:
    """A label with numbers in it, `supply 52.5 bar`, with minus, words and the decimal sign of the language."""
    return localised(with_minus(place_words(label)))


def unit_text(unit: str) -> str:
    """The unit as it is shown: nothing for a pure number."""
    return {"1": "", "deg": "°", "degC": "°C"}.get(unit, unit)


def limits_text(low: float | None, high: float | None) -> str:
    """`0.8 … 1.2`, `≥ 0.8`, or nothing."""
    if low is None and high is None:
        return ""
    if low is None:
        return f"≤ {number(high, 6)}"
    return f"≥ {number(low, 6)}" if high is None else f"{number(low, 6)} … {number(high, 6)}"


def _place(expanded: float) -> int:
    """Decimals (negative left of the point) that keep two digits, after rounding: 0.0996 is 0.10."""
    place = 1 - math.floor(math.log10(expanded))
    return 1 - math.floor(math.log10(round(expanded, place)))


def _to_place(value: float, place: int) -> str:
    return f"{round(value, place) + 0.0:.{max(0, place)}f}"


def _scaled(value: float, expanded: float) -> tuple[str, str]:
    exponent = math.floor(math.log10(max(abs(value), expanded)))
    scale, power = 10.0**exponent, f"·10{str(exponent).translate(_SUPERSCRIPT)}"
    shown, width = rounded(value / scale, expanded / scale)
    return f"{shown}{power}" if shown.strip(f"{MINUS}0.,") else "0", f"{width}{power}"


def _signed(text: str) -> str:
    """With a minus sign instead of a hyphen, never minus zero, and with the decimal sign of the page's language."""
    if text.startswith("-"):
        text = text[1:] if not text.strip("-0.") else MINUS + text[1:]
    return localised(text)
