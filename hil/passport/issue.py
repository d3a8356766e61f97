"""Issue a passport: from run folders to one signed file."""

from __future__ import annotations

import hashlib
import json
import uuid
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from hil.bench.audit import Audit, head, is_on_the_trail, issued_on_the_trail
from hil.errors import InputError, SettingError, StorageError, option
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
from hil.passport.pdf import compiled
from hil.passport.power import Power, notes, power_of, rows
from hil.passport.power import as_dict as power_dict
from hil.passport.revoked import read_revocations
from hil.passport.sign import signed
from hil.passport.unit import Unit, read_unit_runs
from hil.passport.verify import SignatureStatus, Trust, verify
from hil.physics.other_plant import other_plants
from hil.record.durable import write_whole
from hil.record.plain import plain, to_json
from hil.record.progress import Progress, quiet
from hil.version import PROGRAM

if TYPE_CHECKING:
    from hil.physics.model import Model

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
    powers = _powers(unit, known, out, progress) if wanted.power else ()
    if powers:
        annex = Note("What its limits would have caught is in the annex.")
        known = replace(known, sentences=(*known.sentences, annex))
    with TemporaryDirectory(prefix="hil-passport-") as folder:
        place = Path(folder)
        unit = evaluated_copies(unit, place / "anew")
        if not wanted.names:
            unit = nameless(unit, place / "nameless")
        progress(0.9, "setting the pages")
        content = _sealed(unit, known, powers, signer, wanted, key, place, trail)
    _written(content, out)
    issued_on_the_trail(out, hashlib.sha256(content).hexdigest(), unit.serial)
    progress(1.0, "done")
    return Issued(out, unit, known, signer, powers)


def _powers(unit: Unit, known: Understood, out: Path, progress: Progress) -> tuple[Power, ...]:
    """Of every run that was judged; what was found so far is kept beside the passport until it is written."""
    if known.model is None:
        raise InputError(f"{option('power')} needs the model of the unit. {known.sentences[0]}")
    judged = [run for run in unit.runs if any(m.verdict for m in run.findings.measured)]
    return tuple(
        power_of(run, known.model, progress, out.with_name(f".{out.name}.power{n}.json"))
        for n, run in enumerate(judged)
    )


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


def _sealed(
    unit: Unit, known: Understood, powers: Sequence[Power], signer: Signer, wanted: Wanted, key: SigningKey,
    place: Path, trail: Trail,
) -> bytes:  # fmt: skip
    page, drawn = _page_and_pictures(unit, known, powers, signer, wanted, trail)
    inside = [*_made(unit, known, powers, signer, wanted, place / "made"), *attached_runs(unit)]
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
def _page_and_pictures(
    unit: Unit, known: Understood, powers: Sequence[Power], signer: Signer, wanted: Wanted, trail: Trail
) -> tuple[dict[str, Any], list[tuple[str, bytes]]]:
    """What the pages say and show; the files beside them are in English whatever the pages are in."""
    page = certificate_of(unit, signer, known.says, names=wanted.names, trail=trail)
    page |= {"valve": unit.valve, "serial": unit.serial, "model_about": known.about,
             "parameters": known.parameters, "excluded": known.excluded,
             "power": rows(powers), "power_notes": [note.translated for note in notes(powers)]}  # fmt: skip
    return page, pictures(run.results for run in unit.runs)


def _made(
    unit: Unit, known: Understood, powers: Sequence[Power], signer: Signer, wanted: Wanted, place: Path
) -> list[Attached]:
    """The files that are made for this passport."""
    place.mkdir()
    xml = place / DCC_FILE
    xml.write_bytes(
        certificate_xml(unit, signer, f"{unit.serial}-{unit.dates[1]:%Y%m%d}-{_mark(unit)}", names=wanted.names)
    )
    found = [Attached(DCC_FILE, xml, "data", "Digital Calibration Certificate, PTB schema 3.2.1")]
    if known.model is not None or wanted.model is not None:
        from hil.physics.model import save_model
    if known.model is not None:
        save_model(known.model, place / MODEL_FILE)
        found.append(Attached(MODEL_FILE, place / MODEL_FILE, "data", "the model of this unit"))
    if wanted.model is not None:
        save_model(wanted.model, place / TYPE_MODEL_FILE)
        found.append(Attached(TYPE_MODEL_FILE, place / TYPE_MODEL_FILE, "supplement", "the model of its type"))
    if known.diagnosed is not None:
        path = place / DIAGNOSIS_FILE
        path.write_text(
            json.dumps(plain(known.diagnosed.diagnosis.as_dict()), indent=1, ensure_ascii=False), encoding="utf-8"
        )
        found.append(Attached(DIAGNOSIS_FILE, path, "data", "the diagnosis against the model of its type"))
    if powers:
        path = place / POWER_FILE
        path.write_text(to_json(power_dict(powers)), encoding="utf-8")
        found.append(Attached(POWER_FILE, path, "data", "the least faults that break each limit"))
    return found


def _mark(unit: Unit) -> str:
    """The same for the same runs: from their names and times."""
    return uuid.uuid5(uuid.NAMESPACE_OID, "\n".join(f"{run.results.run} {run.started}" for run in unit.runs)).hex[:12]


def _written(content: bytes, out: Path) -> None:
    try:
        write_whole(out, content)
    except OSError as error:
        raise StorageError(
            f"{out}: the passport cannot be written: {error.strerror}; the runs are as they were"
        ) from error
