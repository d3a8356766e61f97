"""Issue a passport: from run folders to one signed file."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hil.bench.audit import Audit, head, is_on_the_trail, issued_on_the_trail
from hil.errors import InputError, SettingError, option, storing
from hil.language.choice import in_page_language
from hil.language.note import Note
from hil.passport.attached import (
    DCC_FILE,
    DIAGNOSIS_FILE,
    MODEL_FILE,
    POWER_FILE,
    TYPE_MODEL_FILE,
    Attached,
    attached_runs,
    evaluated_copies,
)
from hil.passport.attached import without_names as nameless
from hil.passport.certificate import Signer, Trail, certificate_of
from hil.passport.dcc import certificate_xml
from hil.passport.figures import pictures
from hil.passport.identified import Understood, understood
from hil.passport.key import SigningKey, fingerprint, name_of
from hil.passport.pdf import compiled, write_plain
from hil.passport.power import Power, notes, power_of, rows
from hil.passport.power import as_dict as power_dict
from hil.passport.revoked import read_revocations
from hil.passport.sign import signed
from hil.passport.unit import Unit, read_unit_runs
from hil.passport.verify import SignatureStatus, Trust, verify
from hil.physics.model import Model, save_model
from hil.physics.other_plant import other_plants
from hil.record.durable import write_whole
from hil.record.run_folder.progress import Progress, quiet
from hil.version import PROGRAM

SCHEMA = "hil.passport/1"


@dataclass(frozen=True, slots=True)
class Wanted:
    """How a passport is asked for.

    Attributes:
        names: whether it says who ran the tests.
        identify: whether the unit is identified.
        model: of the type, for what the data excluded.
        anew: take what an evaluation now finds, where that is not what the run was said to have found.
        power: whether the least faults that break each limit are sought.
    """

    names: bool = True
    identify: bool = True
    model: Model | None = None
    anew: bool = False
    power: bool = False


@dataclass(frozen=True, slots=True)
class Issued:
    """The passport that was written, what it is about, and what the limits of its runs would have caught."""

    path: Path
    unit: Unit
    understood: Understood
    signer: Signer
    powers: tuple[Power, ...] = ()


def issue(
    folders: Sequence[Path], out: Path, key: SigningKey, wanted: Wanted = Wanted(),
    progress: Progress = quiet,
) -> Issued:  # fmt: skip
    """Make, sign, check and write a passport.

    Raises:
        InputError: runs of different units or of none, a changed run, a key that cannot sign, a model of another plant.
        StorageError: something cannot be written.
    """
    if wanted.power and not wanted.identify:
        raise SettingError(f"{option('power')} needs the model of the unit; leave out {option('no-model')}")
    progress(0.0, "evaluating the runs anew")
    unit, trail = read_unit_runs(folders, also_moved=wanted.anew), trail_of(folders)
    _check_kind(unit, wanted.model)
    signer = Signer(name_of(key.certificate), fingerprint(key.certificate))
    known = understood(unit, wanted.identify, wanted.model, progress)
    powers: tuple[Power, ...] = ()
    if wanted.power:
        if known.model is None:
            raise InputError(f"{option('power')} needs the model of the unit. {known.sentences[0]}")
        judged = [run for run in unit.runs if any(m.verdict for m in run.findings.measured)]
        powers = tuple(  # what was found so far is kept beside the passport until it is written
            power_of(run, known.model, progress, out.with_name(f".{out.name}.power{n}.json"))
            for n, run in enumerate(judged)
        )
    if powers:
        annex = Note("What its limits would have caught is in the annex.")
        known = replace(known, sentences=(*known.sentences, annex))
    with TemporaryDirectory(prefix="hil-passport-") as folder:
        place = Path(folder)
        unit = evaluated_copies(unit, place / "anew")
        if not wanted.names:
            unit = nameless(unit, place / "nameless")
        progress(0.9, "setting the pages")
        issued = Issued(out, unit, known, signer, powers)
        content = _sealed(issued, wanted, key, place, trail)
    with storing(out, "the passport cannot be written", "; the runs are as they were"):
        write_whole(out, content)
    issued_on_the_trail(out, hashlib.sha256(content).hexdigest(), unit.serial)
    progress(1.0, "done")
    return issued


def _check_kind(unit: Unit, kind: Model | None) -> None:
    """Raise `SettingError` when the model is of another plant: what the data excluded would be said of that."""
    if kind is not None and (other := other_plants(kind.plant, ((r.folder.name, r.recording.meta) for r in unit.runs))):
        raise SettingError(f"{option('model')}: {other[0]} Give the model of this valve's type")


def trail_of(folders: Sequence[Path]) -> Trail:
    """The audit trail of this computer, and how many of these runs it holds.

    Raises:
        FileError: it holds one otherwise, or is broken.
    """
    held, last = [is_on_the_trail(folder) for folder in folders], head(Audit().path)
    return Trail() if last is None else Trail(last.number, last.sha256, sum(held))


def _sealed(issued: Issued, wanted: Wanted, key: SigningKey, place: Path, trail: Trail) -> bytes:
    unit, known = issued.unit, issued.understood
    page, drawn = _page_and_pictures(issued, wanted, trail)
    inside = [*_made(issued, wanted, place / "made"), *attached_runs(unit)]
    content = {
        "schema": SCHEMA, "serial": unit.serial, "valve": unit.valve, "verdict": unit.verdict,
        "simulated": unit.simulated,
        "dates": [date.isoformat() for date in unit.dates], "seconds_identification_and_diagnosis": known.seconds,
        "model": known.says, "program": PROGRAM, "language": page["language"], "audit_trail": asdict(trail),
        "runs": [
            {"run": run.results.run, "recorded_by": run.recording.meta.get("program"),
             "evaluated_by": PROGRAM if run.moved else run.evaluated_by or None, "moved": run.moved}
            for run in unit.runs
        ],
    }  # fmt: skip
    work = place / "pages"
    work.mkdir()
    sealed = signed(compiled(page, drawn, inside, content, work), key)
    checked = verify(sealed, Trust([key.certificate], read_revocations(None)))
    if checked.outcome is not SignatureStatus.SOUND:
        raise InputError(f"the passport was not written: its own check says: {checked.sentence}")
    return sealed


@in_page_language
def _page_and_pictures(issued: Issued, wanted: Wanted, trail: Trail) -> tuple[dict[str, Any], list[tuple[str, bytes]]]:
    """What the pages say and show; the files beside them are in English whatever the pages are in."""
    unit, known, powers = issued.unit, issued.understood, issued.powers
    page = certificate_of(unit, issued.signer, known.says, names=wanted.names, trail=trail)
    page |= {"valve": unit.valve, "serial": unit.serial, "model_about": known.about,
             "parameters": known.parameters, "excluded": known.excluded,
             "power": rows(powers), "power_notes": [note.translated for note in notes(powers)]}  # fmt: skip
    return page, pictures(run.results for run in unit.runs)


def _made(issued: Issued, wanted: Wanted, place: Path) -> Iterator[Attached]:
    """The files that are made for this passport."""
    unit, known = issued.unit, issued.understood
    place.mkdir()
    identifier = f"{unit.serial}-{unit.dates[1]:%Y%m%d}-{_mark(unit)}"
    (place / DCC_FILE).write_bytes(certificate_xml(unit, issued.signer, identifier, names=wanted.names))
    yield Attached(DCC_FILE, place / DCC_FILE, "data", "Digital Calibration Certificate, PTB schema 3.2.1")
    if known.model is not None:
        save_model(known.model, place / MODEL_FILE)
        yield Attached(MODEL_FILE, place / MODEL_FILE, "data", "the model of this unit")
    if wanted.model is not None:
        save_model(wanted.model, place / TYPE_MODEL_FILE)
        yield Attached(TYPE_MODEL_FILE, place / TYPE_MODEL_FILE, "supplement", "the model of its type")
    if known.diagnosed is not None:
        write_plain(place / DIAGNOSIS_FILE, known.diagnosed.diagnosis.as_dict())
        yield Attached(DIAGNOSIS_FILE, place / DIAGNOSIS_FILE, "data", "the diagnosis against the model of its type")
    if issued.powers:
        write_plain(place / POWER_FILE, power_dict(issued.powers))
        yield Attached(POWER_FILE, place / POWER_FILE, "data", "the least faults that break each limit")


def _mark(unit: Unit) -> str:
    """The same for the same runs: from their names and times."""
    return uuid.uuid5(uuid.NAMESPACE_OID, "\n".join(f"{run.results.run} {run.started}" for run in unit.runs)).hex[:12]
