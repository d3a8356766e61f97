"""What its operator says of a run: which unit it is of, who runs it, what else is to be known."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Any

from hil.bench.read import BenchFile
from hil.errors import SettingError, option
from hil.session.procedure import Procedure

ASK = "ask"
SIMULATED = "simulated"
_LONGEST, _LONGEST_NOTE = 64, 1000
_LONGEST_IN_FOLDER = 40  # characters, four bytes each at most: a file system allows 255 bytes


@dataclass(frozen=True, slots=True)
class Labels:
    """Serial number of the unit, the operator's name or mark, notes by name. What is empty was not stated."""

    serial: str = ""
    operator: str = ""
    notes: Mapping[str, str] = field(default_factory=dict)

    @property
    def about(self) -> dict[str, Any]:
        """For the header of a run."""
        return {name: value for name, value in (("operator", self.operator), ("notes", dict(self.notes))) if value}


NO_LABELS = Labels()


def labels_of(serial: str, operator: str, notes: Iterable[str]) -> Labels:
    """Labels as they are typed.

    Raises:
        SettingError: a note that is not KEY=VALUE or is given twice, or a text that no label can be.
    """
    for name, text in ((option("serial"), serial), (option("operator"), operator)):
        if text and not text.strip():
            raise SettingError(f"{name}: {text!r}: nothing but blanks; leave it out where there is none")
    found: dict[str, str] = {}
    for text in notes:
        key, equals, value = (part.strip() for part in text.partition("="))
        if not (key and equals and value):
            raise SettingError(f"{option('note')} {text!r}: KEY=VALUE was expected, as in 'oil=ISO VG 46'")
        key, value = _label(option("note"), key), _label(f"{option('note', f'{key}')}", value, _LONGEST_NOTE)
        if key in found:
            raise SettingError(f"{option('note', f'{key}')}: is given twice")
        found[key] = value
    return Labels(_label(option("serial"), serial), _label(option("operator"), operator), found)


def labelled(
    bench: BenchFile, procedure: Procedure, labels: Labels, ask: Callable[[], str] | None = None
) -> tuple[BenchFile, Labels]:
    """The bench with the unit's serial number in it, and the labels complete.

    Args:
        bench: the bench file; `serial = "ask"` wants one for each run.
        procedure: one that issues a certificate needs one too.
        labels: as they were given.
        ask: asks the operator; None where nobody is there to answer.

    Raises:
        SettingError: a serial number is needed, and there is none.
    """
    stated = bench.bench.valve.serial
    serial = labels.serial or ("" if stated == ASK else stated)
    if not serial and stated == ASK:
        if ask is None:
            raise SettingError(f'{bench.path}: serial = "ask": say which unit this is with {option("serial", "SN")}')
        serial = _label("serial number", ask())
        if not serial:
            raise SettingError(f'{bench.path}: serial = "ask": nothing was typed or scanned; nothing was driven')
    if not serial and bench.is_simulated:
        serial = SIMULATED
    if procedure.certificate and (not serial or (serial == SIMULATED and not bench.is_simulated)):
        raise SettingError(
            f"{procedure.name} issues a certificate, which is of a unit: say which with {option('serial', 'SN')}; "
            "nothing was driven"
        )
    return bench.of_unit(serial), replace(labels, serial=serial)


def folder_name(procedure: str, serial: str) -> str:
    """Procedure, unit and time in UTC; of the serial number what a folder's name can hold."""
    plain = re.sub(r"[^\w.-]+", "-", serial)[:_LONGEST_IN_FOLDER].strip("-.")
    unit = f"{plain}-" if plain and plain != SIMULATED else ""
    return f"{procedure}-{unit}{datetime.now(UTC):%Y%m%dT%H%M%SZ}"


def new_folder(runs: Path, procedure: str, serial: str, taken: Collection[str] = ()) -> Path:
    """A folder of that name, or with a number behind it where a run of the same second has it, or will have it."""
    folder = runs / folder_name(procedure, serial)
    names = (folder.with_name(f"{folder.name}{f'-{i}' if i else ''}") for i in count())
    return next(name for name in names if not name.exists() and name.name not in taken)


def _label(name: str, text: str, longest: int = _LONGEST) -> str:
    """A label in one line; a scanner's carriage return is none of it."""
    found = text.strip()
    if len(found) > longest or not found.isprintable():
        raise SettingError(f"{name}: {found[:_LONGEST]!r}: up to {longest} printable characters are allowed")
    return found
