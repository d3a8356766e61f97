"""DBC files as people write them, put into the form that the cantools library reads.

Files of the trade have 29-bit identifiers without the bit that says so, names of values for signals that are not there
or without their end, numbers that begin with a point, and comments in other grammars. None changes what a signal means.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from hil.description.makers_text import makers_text

_EXTENDED = 1 << 31
_LOOSE = "VECTOR__INDEPENDENT_SIG_MSG"  # where an editor keeps signals that are in no message
_STRING = re.compile(r'"(?:[^"\\]|\\.)*"', re.DOTALL)
_COMMENT = re.compile(r"^[ \t]*CM_\b.*$", re.MULTILINE)
_WITHOUT_END = re.compile(r"^([ \t]*VAL_[ \t][^;\n]*)$(?=\n[ \t]*(?:[A-Z]+_|\n|\Z))", re.MULTILINE)
_MESSAGE = re.compile(r"^[ \t]*BO_[ \t]+(\d+)[ \t]+(\w+)[^\n]*\n((?:[ \t]*SG_[^\n]*\n?)*)", re.MULTILINE)
_SIGNAL = re.compile(r"^[ \t]*SG_[ \t]+(\w+)", re.MULTILINE)
_ABOUT = re.compile(r"\b(BO_|SG_|VAL_|SIG_GROUP_|SIG_VALTYPE_|BO_TX_BU_|SG_MUL_VAL_)(\s+)(\d+)\b")
_OF_A_SIGNAL = re.compile(r"^[ \t]*(VAL_|SIG_VALTYPE_)\s+(\d+)\s+(\w+)[^;]*;", re.MULTILINE)


@dataclass(slots=True)
class DbcText:
    """A file in the library's form.

    Attributes:
        text: of it, line by line where it was.
        left_out: what was not taken as it stands, in words.
    """

    text: str
    left_out: list[str] = field(default_factory=list)


def dbc_text(data: bytes) -> DbcText:
    """What stands in a DBC file: UTF-8, or the Windows code page that editors write; without its comments."""
    text, strings = _apart(makers_text(data))
    plain = _COMMENT.sub(lambda found: "\n" * _put_back(found[0], strings).count("\n"), text)
    plain = _WITHOUT_END.sub(r"\1 ;", plain)
    plain = re.sub(r"(?<![\w.])\.(?=\d)", "0.", plain)
    made = DbcText("")
    plain = _without_values_of_nothing(_with_long_identifiers(plain + "\n", made.left_out), made.left_out)
    made.text = _put_back(plain, strings)
    return made


def _apart(text: str) -> tuple[str, list[str]]:
    """A text with a number in place of each of its strings, and these: what stands in them is nobody's keyword."""
    strings = _STRING.findall(text)
    numbers = iter(range(len(strings)))
    return _STRING.sub(lambda _found: f'"{next(numbers)}"', text), strings


def _put_back(text: str, strings: list[str]) -> str:
    return re.sub(r'"(\d+)"', lambda found: strings[int(found[1])], text)


def _with_long_identifiers(text: str, left_out: list[str]) -> str:
    """Identifiers of more than 11 bits marked as those of 29 bits; messages that can have neither are taken away."""
    long: dict[str, str] = {}
    for found in list(_MESSAGE.finditer(text)):
        number = int(found[1])
        if 0x7FF < number < 1 << 29:
            long[found[1]] = str(number | _EXTENDED)
            left_out.append(f"{found[2]}: {number:#x} has more than 11 bits and is taken for a 29-bit identifier")
        elif number & ~_EXTENDED >= 1 << 29:
            text = text.replace(found[0], "\n" * found[0].count("\n"))
            if found[2] != _LOOSE:
                left_out.append(f"message {found[2]}: no identifier can be {number:#x}")
    return _ABOUT.sub(lambda found: f"{found[1]}{found[2]}{long.get(found[3], found[3])}", text) if long else text


def _without_values_of_nothing(text: str, left_out: list[str]) -> str:
    known = {found[1]: set(_SIGNAL.findall(found[3])) for found in _MESSAGE.finditer(text)}

    def kept(found: re.Match[str]) -> str:
        if found[3] in known.get(found[2], ()):
            return found[0]
        if found[2] in known:
            left_out.append(f"{found[1]} of {found[3]}: there is no such signal in message {found[2]}")
        return "\n" * found[0].count("\n")

    return _OF_A_SIGNAL.sub(kept, text)
