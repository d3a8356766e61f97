"""Which question is asked: what has changed since identification, or what the model leaves out."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

from hil.diagnosis.diagnosis import Asked
from hil.diagnosis.skeleton.table import VERSION, Table, library_of, read_table, table_of
from hil.errors import FileError, SettingError, option, reason
from hil.identification.preparation.content import is_of_its_origin
from hil.identification.preparation.experiment import Experiment
from hil.language.note import Note
from hil.physics.model import Model

QUESTIONS: tuple[Asked, ...] = ("changed", "left_out")


@dataclass(frozen=True)
class Question:
    """What is asked of the recordings.

    Attributes:
        asked: the question. `why`: it is this one, in words.
        table: what is known of the recordings of identification, where *changed* is asked.
        warnings: what limits it, in words. `is_own`: whether the model was identified from all of the recordings.
    """

    asked: Asked
    why: Note
    table: Table | None = None
    warnings: tuple[Note, ...] = ()
    is_own: bool = False


def question_of(
    model: Model, experiments: Sequence[Experiment], wanted: str = "", before: Sequence[Experiment] = ()
) -> Question:
    """The question of recordings, unless one is wanted.

    Args:
        model: the nominal model.
        experiments: the recordings.
        wanted: the question, or empty.
        before: recordings of the same unit at the date of identification; what the model file keeps where there are
            none.

    Raises:
        SettingError: an unknown question, or nothing is known of before where *changed* is wanted.
        FileError: what the model file keeps of before is damaged.
    """
    if wanted and wanted not in QUESTIONS:
        raise SettingError(f"{option('question')} {wanted}: no such question; it is one of {', '.join(QUESTIONS)}")
    own = [e.name for e in experiments if is_of_its_origin(model, e)]
    if wanted == "left_out" or (own and not wanted):
        why = Note("asked for") if wanted else Note("the model was identified from {recording}", recording=own[0])
        return Question("left_out", why, is_own=len(own) == len(experiments))
    if before:
        if (known := table_of(model, before)) is None:
            raise SettingError(
                f"{option('before')}: too short to tell what an unchanged unit leaves; give more or longer"
            )
        return Question("changed", Note("recordings of before were given"), known)
    if model.skeleton is None or model.skeleton.get("version") != VERSION:
        why = Note("the model file keeps nothing of the recordings that it was identified from")
        if model.skeleton is not None:
            why = Note("another version of the program wrote what the model file keeps of its recordings")
        if wanted:
            asked, given = option("question"), option("before")
            raise SettingError(f"{asked} changed: {why}; give them as {given} RECORDING…, or identify it anew")
        limited = Note(
            "{why}; whether it has changed since tells {option} RECORDING…", why=why, option=option("before")
        )
        return Question("left_out", why, None, () if model.skeleton is None else (limited,))
    try:
        table = read_table(model.skeleton, model)
    except (KeyError, ValueError, TypeError, AttributeError, IndexError, zlib.error) as error:
        raise FileError(
            f"the model file: skeleton: cannot be read ({reason(error)}); identify the model anew, or give recordings "
            f"of before as {option('before')} RECORDING…"
        ) from None
    other = Note(
        "the library has changed since the model was identified; only what it still has of the recordings is compared. "
        "{option} RECORDING… compares all of them",
        option=option("before"),
    )  # fmt: skip
    warnings = () if table.library == library_of(model) else (other,)
    return Question("changed", Note("the model was identified from other recordings"), table, warnings)
