"""Units: many diagnosed in one call, one at two dates, the signed file of one. Imports come with the call."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from hil.api.callbacks import Notes, unsaid
from hil.api.models import model_of
from hil.errors import options_of
from hil.record.run_folder.progress import Progress, quiet
from hil.session.several import at_least_one, several

if TYPE_CHECKING:
    from hil.passport.difference import DateDifference
    from hil.passport.issue import Issued
    from hil.physics.model import Model
    from hil.record.reading import Reading
    from hil.session.fleet import UnitAnswer


@options_of("python")
def diagnose_fleet(
    folders: str | Path | Iterable[str | Path],
    *,
    model: Model | str | Path | None = None,
    inputs: str | Iterable[str] = (),
    output: str = "",
    out: str | Path | None = None,
    scheduler: str = "",
    budget_s: float = math.inf,
    screen: bool = False,
    reading: Reading | None = None,
    notes: Notes = unsaid,
    progress: Progress = quiet,
) -> list[UnitAnswer]:
    """Diagnose many units, each by itself, on all cores or on a Dask cluster (`hil diagnose --fleet`).

    Args:
        folders: one for each unit: its recordings as CSV and, where it has one of its own, its `nominal.json`.
        model: nominal model of the others, or the path of its file.
        inputs: names of the input channels, where they are not the model's own.
        output: name of the output channel, likewise.
        out: folder in which each unit gets one of its own once it is diagnosed; one that was before, from the same
            files in the same way, is not again. Nothing is written when not given.
        scheduler: address of a Dask scheduler, `tcp://host:port`.
        budget_s: of each unit: after so many times 10 million simulated samples no further search is begun.
        screen: ask only whether each has changed since its model was identified, and no cause; `out` gets a table,
            `screening.csv`, and no folders.
        reading: how files are read.
        notes: called with what was assumed of the recordings.
        progress: called with how many are done.

    Returns:
        An answer for each folder, in their order: the `diagnosed`, or the `folder` where it was written, or what was
        `screened`, or in `error` why there is none.

    Raises:
        FileError: a folder without recordings or model, or two folders of one name.
        StorageError: `out` cannot be written.
    """
    from hil.session.fleet import diagnosed_fleet

    given: list[str | Path] = several(folders)
    paths = [Path(folder) for folder in given]
    nominal, to = None if model is None else model_of(model), None if out is None else Path(out)
    return diagnosed_fleet(
        paths, nominal, several(inputs), output, to, scheduler, budget_s, reading, notes, progress, screens=screen
    )


@options_of("python")
def diff(
    old: str | Path,
    new: str | Path,
    *,
    model: Model | str | Path | None = None,
    inputs: str | Iterable[str] = (),
    output: str = "",
    budget_s: float = math.inf,
    reading: Reading | None = None,
    notes: Notes = unsaid,
    progress: Progress = quiet,
) -> DateDifference:
    """What changed in a unit between two dates, by cause, and what stayed within which limit (`hil diff`).

    Args:
        old: passport, run folder or folder with recordings.
        new: the same of a later date.
        model: of the type, or the path of its file, where no passport holds one.
        inputs: names of the input channels, where they are not the model's own.
        output: name of the output channel, likewise.
        budget_s: after so many times 10 million simulated samples no search is begun; of long recordings as much is
            taken as it allows.
        reading: how files are read.
        notes: called with what was assumed of the recordings.
        progress: called with how far it is.
    """
    from tempfile import TemporaryDirectory

    from hil.passport.difference import difference
    from hil.passport.sources import read_dated
    from hil.physics.other_plant import other_plants
    from hil.session.sources import notes_on

    kind, asked = None if model is None else model_of(model), reading
    with TemporaryDirectory(prefix="hil-diff-") as folder:
        first, second = (read_dated(Path(p), Path(folder) / name, asked) for p, name in ((old, "old"), (new, "new")))
        for note in notes_on([*first.recordings, *second.recordings]):
            notes(note)
        if (known := kind or first.kind or second.kind or first.unit) is not None:
            recorded = (*first.recordings, *second.recordings)
            for note in other_plants(known.plant, ((one.name, one.meta) for one in recorded)):
                notes(note)
        return difference(first, second, kind, progress, several(inputs), output, budget_s)


@options_of("python")
def issue_passport(
    runs: str | Path | Iterable[str | Path],
    out: str | Path,
    *,
    names: bool = True,
    identify: bool = True,
    model: Model | str | Path | None = None,
    key: str | Path | None = None,
    evaluated_anew: bool = False,
    power: bool = False,
    progress: Progress = quiet,
) -> Issued:
    """Put runs of one unit into one signed PDF (`hil passport`).

    Args:
        runs: run folders.
        out: the file to write.
        names: whether it says who ran the tests.
        identify: whether the unit is identified; page one says so where it is not.
        model: of the type, or the path of its file; states what these data excluded.
        key: file of the lab's key with its certificate, PEM or PKCS #12; else this machine's.
        evaluated_anew: where another version of the program found something else, take what is found now.
        power: seek the least fault of each kind that breaks each limit, by simulated repeats; takes minutes.
        progress: called with how far it is.

    Returns:
        The `path`, the `unit` with its verdict, the `signer`, and what was `understood` of the unit.

    Raises:
        InputError: runs of different units or of none, a changed run, results that its samples do not give, a key that
            cannot sign.
    """
    from hil.passport.issue import Wanted, issue
    from hil.passport.key import signing_key

    wanted = Wanted(names, identify, None if model is None else model_of(model), evaluated_anew, power)
    given: list[str | Path] = at_least_one(runs)
    folders, signer = [Path(one) for one in given], signing_key(None if key is None else Path(key))
    return issue(folders, Path(out), signer, wanted, progress)
