"""Gather the texts of pages into the gettext catalogues, and compile them.

    python docs/catalogues.py
    python docs/catalogues.py --long    prints every sentence of more than 25 words, in every language

Texts marked in the code and in templates, and what the program declares (quantities, their meanings, settings,
conditions), go into `hil/language/catalogues/LANGUAGE/LC_MESSAGES/ROOM.po`; translations that stand there are kept, and
the compiled catalogue is written beside it. What is not translated yet is counted. A test compares both with the code.
"""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import get_args

from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_dir
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po, write_po

from hil.bench.file import Conditions, InstrumentEntry, Valve
from hil.catalog import entries
from hil.console.form import NOTES
from hil.findings.difference import Meaning
from hil.language.figures import POINT
from hil.physics.compose import effects, plant
from hil.record.measurement import Verdict
from hil.report.name import quantity_words, split_unit
from hil.rig import SWITCHED, ConditionRole
from hil.session.procedure import load_procedure

ROOT = Path(__file__).parent.parent
CATALOGUES = ROOT / "hil" / "language" / "catalogues"
ROOMS = {
    "pages": ("hil/report", "hil/passport"), "console": ("hil/console",), "outputs": ("hil/safety",),
    "notes": ("procedures", "hil/identification", "hil/diagnosis", "hil/session", "hil/archive", "hil/cli",
              "hil/physics", "hil/bench", "hil/record"),
}  # fmt: skip
"""Catalogues with the folders whose texts they hold."""
MOST_WORDS = 25  # of a sentence
_METHODS = [("**.py", "python"), ("**.html", "jinja2.ext:babel_extract")]
_OPTIONS = {"**.html": {"newstyle_gettext": "false", "trimmed": "true", "silent": "false"}}
_KEYWORDS = {"_": None, "Note": None, "marked": None, "plural": (1, 2), "gettext": None, "ngettext": (1, 2)}


def main() -> None:
    """Bring every catalogue up to date, or say what in them is too long."""
    if "--long" in sys.argv[1:]:
        print("\n".join(long_sentences()) or f"no sentence of more than {MOST_WORDS} words")
        return
    for language in sorted(entry.name for entry in CATALOGUES.iterdir() if entry.is_dir()):
        for room in ROOMS:
            path = CATALOGUES / language / "LC_MESSAGES" / f"{room}.po"
            made = catalogue(room, path)
            path.write_bytes(text_of(made))
            path.with_suffix(".mo").write_bytes(compiled(made))
            open_ = [message.id for message in made if message.id and not message.string]
            print(f"{path.relative_to(ROOT)}: {len(made)} texts, {len(open_)} not translated")


def catalogue(room: str, path: Path) -> Catalog:
    """The catalogue of a room as the code asks for it, with the translations that it has."""
    template = Catalog(fuzzy=False)
    for folder in filter(lambda name: (ROOT / name).is_dir(), ROOMS[room]):
        found = extract_from_dir(ROOT / folder, _METHODS, _OPTIONS, _KEYWORDS)
        for file, _line, message, _comments, _context in sorted(found, key=lambda one: (one[0], one[1])):
            if _has_words(message):
                template.add(message, locations=[(f"{folder}/{file}", 0)])
    if room == "pages":
        for text in declared():
            template.add(text)
    if room == "console":
        for text in described():
            template.add(text)
    language = path.parent.parent.name
    made = read_po(io.BytesIO(path.read_bytes()), locale=language) if path.exists() else Catalog(language)
    made.update(template, no_fuzzy_matching=True, update_creation_date=False)
    made.header_comment = f"# Pages of valve-hil: {room}."
    made.fuzzy = False
    return made


def long_sentences() -> Iterator[str]:
    """Every sentence that is too long for one reading, with its language and count; numbers and signs are no words."""
    for path in sorted(CATALOGUES.glob("*/LC_MESSAGES/*.po")):
        for message in filter(lambda one: one.id, catalogue(path.stem, path)):
            for language, texts in (("en", message.id), (path.parent.parent.name, message.string)):
                for text in [texts] if isinstance(texts, str) else texts:
                    for sentence in re.split(r"(?<=[.!?])\s+", text):
                        count = len(re.findall(r"(?<!\S)\S*[^\W\d_]\S*", sentence))
                        if count > MOST_WORDS:
                            yield f"{language} {count}: {sentence}"


def _has_words(message: str | tuple[str, ...]) -> bool:
    """Whether there is anything to translate beside what is put in."""
    return not isinstance(message, str) or bool(re.search(r"[^\W\d_]", re.sub(r"\{[^{}]*\}", "", message)))


def declared() -> Iterator[str]:
    """What the program itself declares, as pages say it."""
    for entry in entries("procedures"):
        procedure = load_procedure(entry.name)
        yield quantity_words(procedure.name)
        for measurement in procedure.measurements:
            yield quantity_words(measurement.name)
            yield measurement.meaning
        for setting in procedure.settings:
            yield split_unit(setting)[0]
    yield from get_args(ConditionRole)
    yield from (f"{role} lost" for role in SWITCHED)
    for effect in effects():
        yield effect.name.replace("_", " ")
        yield effect.title
        yield effect.sentence
        yield from (parameter.meaning for parameter in effect.parameters)
        yield from (hook.replace("_", " ") for hook in effect.hooks)
    for entry in entries("plants"):
        yield plant(entry.name).title
        yield from (parameter.meaning for parameter in plant(entry.name).parameters)
        yield from (hook.stage for hook in plant(entry.name).hooks)
    yield POINT
    yield from (name for name, _ in NOTES)
    yield from (*get_args(Verdict), *get_args(Meaning))
    for model in (Conditions, Valve, InstrumentEntry):
        for field in model.model_fields:
            yield split_unit(field)[0]


def described() -> Iterator[str]:
    """What the form of a run says of procedures and their settings."""
    for entry in entries("procedures"):
        procedure = load_procedure(entry.name)
        yield from procedure.doc.splitlines()[:1]
        yield from (setting.meaning for setting in procedure.settings.values() if setting.meaning)


def text_of(made: Catalog) -> bytes:
    """The catalogue as a file, with nothing in it that changes by itself."""
    file = io.BytesIO()
    write_po(file, made, width=120, omit_header=False, sort_by_file=True, ignore_obsolete=True, include_lineno=False)
    kept = [line for line in file.getvalue().splitlines(keepends=True) if not line.startswith(_OF_THE_DAY)]
    return b"".join(kept)


_OF_THE_DAY = (b'"POT-Creation-Date', b'"PO-Revision-Date', b'"Generated-By', b'"Last-Translator', b'"Report-Msgid',
               b'"Project-Id', b'"Language-Team')  # fmt: skip


def compiled(made: Catalog) -> bytes:
    """The catalogue as gettext reads it."""
    file = io.BytesIO()
    kept = read_po(io.BytesIO(text_of(made)), locale=made.locale)
    kept.creation_date = kept.revision_date = datetime(2026, 1, 1, tzinfo=UTC)  # else that of the minute
    write_mo(file, kept)
    return file.getvalue()


if __name__ == "__main__":
    main()
