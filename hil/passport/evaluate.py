"""Whether what a passport says follows from the samples inside: for who has nothing but the file.

Samples give results, within a share of their uncertainty. Results and the headers of the runs give page one with its
conditions and instruments, the tables of the annex and the Digital Calibration Certificate, to the last digit. The
model of the unit is not identified again, as page one says; its parameters in the annex are those of the file inside.
"""

from __future__ import annotations

import io
import json
import math
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree.ElementTree import Element, ParseError, fromstring, tostring

from hil.bench.manual.certificate import DCC
from hil.errors import InputError
from hil.language.note import Note
from hil.language.words import languages, speaking
from hil.passport.attached import CONTENT_FILE, DCC_FILE, MODEL_FILE, RUNS
from hil.passport.certificate import Signer, certificate_of
from hil.passport.contents import lay_out
from hil.passport.dcc import certificate_xml
from hil.passport.identified import Understood
from hil.passport.unit import Unit, read_unit_runs
from hil.version import PROGRAM

_HELD = ("administrativeData/dcc:statements", "measurementResults")


@dataclass(frozen=True, slots=True)
class Evaluated:
    """What came of it: `faults` where the file does not say what its samples say, `notes` for its reader."""

    faults: tuple[str, ...]
    notes: tuple[Note, ...] = ()
    values: int = 0
    runs: int = 0


def evaluate_passport(content: bytes, most_bytes: float = math.inf) -> Evaluated:
    """Evaluate the runs inside a passport anew, and hold page one, certificate and data together.

    Args:
        content: of the passport.
        most_bytes: what its attachments may unpack to.

    Raises:
        StorageError: it cannot be laid out.
    """
    with TemporaryDirectory(prefix="hil-verify-") as folder:
        place = Path(folder) / "laid-out"
        try:
            unit = read_unit_runs(lay_out(content, place, most_bytes), also_moved=True)
            faults = (
                *_run_faults(unit),
                *_page_faults(unit, _model_inside(place), content),
                *_certificate_faults(unit, place),
                *_content_faults(unit, place),
            )
        except InputError as error:
            fault, _, _ = str(error).partition("; `hil report")  # a remedy of who has the run
            return Evaluated((fault.replace(f"{place / RUNS}/", "run "),))
    notes = tuple(
        Note("an earlier version did not seal its results; they were evaluated like the others").of(run.results.run)
        for run in unit.runs if not run.evaluated_by
    )  # fmt: skip
    return Evaluated(faults, notes, len(unit.findings.measured), len(unit.runs))


def _run_faults(unit: Unit) -> Iterator[str]:
    for run in unit.runs:
        maker = run.evaluated_by or "an earlier version"
        by = f" (evaluated by {maker}, now by {PROGRAM})" if maker != PROGRAM else ""
        yield from (f"run {run.results.run}: {text}{by}" for text in run.moved)


def _model_inside(place: Path) -> Understood:
    """The model of the unit as a file of the passport has it; none where there is no such file.

    Raises:
        InputError: it is no model.
    """
    path = place / MODEL_FILE
    if not path.is_file():
        return Understood(())
    from hil.physics.model import load_model

    return Understood((), load_model(path))


def _page_faults(unit: Unit, known: Understood, content: bytes) -> Iterator[str]:
    """What page one and the tables of the annex should say and do not, in the language in which they are."""
    try:
        pages = [_squeezed(page) for page in _texts(content)]
    except Exception as error:  # as `verify` has it: a broken PDF makes its reader raise anything
        yield f"its pages cannot be read: {type(error).__name__}"
        return
    missing = min((list(_missing(unit, known, pages, language)) for language in languages()), key=len)
    yield from missing[:5]


def _missing(unit: Unit, known: Understood, pages: list[str], language: str) -> Iterator[str]:
    with speaking(language):
        page, parameters = certificate_of(unit, Signer("", ""), "", names=True), known.parameters
    first, whole = pages[0], "".join(pages)
    head = [unit.valve, f"{page['labels']['serial']} {unit.serial} {str(page['word']).upper()}"]
    for text in (*head, *map("".join, page["limits"])):
        if _squeezed(text) not in first:
            yield f"page one does not say what the results say: {text}"
    conditions = (f"{label} {text}" for label, text in page["conditions"])
    for text in dict.fromkeys(chain(conditions, *page["instruments"])):
        if _squeezed(text) not in whole:  # many instruments need more than a page
            yield f"page one does not say what the runs say: {text}"
    for row in parameters:
        if _squeezed("".join(row)) not in whole:
            yield f"the annex does not say what {MODEL_FILE} says: {' '.join(row)}"
    for row in (*page["more_limits"], *page["values"]):
        if _squeezed("".join(row)) not in whole:
            yield f"the annex does not say what the results say: {' '.join(row)}"


def _texts(content: bytes) -> list[str]:
    from pypdf import PdfReader

    return [page.extract_text() for page in PdfReader(io.BytesIO(content)).pages]


def _squeezed(text: str) -> str:
    """Without spaces, which a page sets as it likes, and with ligatures taken apart."""
    return "".join(unicodedata.normalize("NFKC", text).split())


def _certificate_faults(unit: Unit, place: Path) -> Iterator[str]:
    """Parts of the Digital Calibration Certificate that the results do not give."""
    try:
        found = fromstring((place / DCC_FILE).read_bytes())
    except (OSError, ParseError) as error:
        yield f"{DCC_FILE} cannot be read: {error}"
        return
    given = fromstring(certificate_xml(unit, Signer("", ""), "", names=False))
    for path in _HELD:
        if _canonical(found, path) != _canonical(given, path):
            yield f"{DCC_FILE} does not say what the results say: {path.rpartition(':')[2]}"
    serials = {one.text for one in found.iterfind("dcc:administrativeData/dcc:items//dcc:value", {"dcc": DCC})}
    if serials != {unit.serial}:
        yield f"{DCC_FILE} is of {', '.join(map(str, serials)) or 'no unit'}, the runs are of {unit.serial}"


def _canonical(root: Element, path: str) -> str:
    part = root.find(f"dcc:{path}", {"dcc": DCC})
    return "" if part is None else "".join(tostring(part, encoding="unicode").split())


def _content_faults(unit: Unit, place: Path) -> Iterator[str]:
    try:
        content = json.loads((place / CONTENT_FILE).read_bytes())
        found = {"serial": content["serial"], "valve": content["valve"], "verdict": content["verdict"]}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        yield f"{CONTENT_FILE} is not what this program writes"
        return
    for name, value in found.items():
        if value != getattr(unit, name):
            yield f"{CONTENT_FILE}: {name} is {value!r}, by the results {getattr(unit, name)!r}"
