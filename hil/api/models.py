"""Model files, and models and transfer functions for other tools."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hil.errors import options_of

if TYPE_CHECKING:
    from hil.findings.results import Results
    from hil.fmu.validation import ValidatedFmu
    from hil.physics.model import Model
    from hil.session.export import Exported


@options_of("python")
def load_model(path: str | Path) -> Model:
    """Read a model file, or an installed model by its bare name (`hil list models`).

    Raises:
        FileError: not a model file, of another version, or of a plant, parameter or effect that is not installed; names
            the field and what was expected.
        UnknownNameError: the plant is not installed.
    """
    from hil.physics.model import load_model as loaded

    return loaded(Path(path))


def model_of(given: Model | str | Path) -> Model:
    """A model as it is, or the one in a file: what calculations take."""
    from hil.physics.model import Model

    return given if isinstance(given, Model) else load_model(given)


def save_model(model: Model, path: str | Path) -> None:
    """Write a model file; a standard uncertainty without end (the data do not tell the parameter) is null.

    Raises:
        StorageError: it cannot be written.
    """
    from hil.physics.model import save_model as saved

    saved(model, Path(path))


@options_of("python")
def typical_model(plant: str) -> Model:
    """A plant at its typical values, nothing estimated."""
    from hil.physics.model import typical_model as typical

    return typical(plant)


@options_of("python")
def export(
    source: Model | Results | str | Path,
    to: str,
    out: str | Path | None = None,
    *,
    part: str = "",
    fmi: str = "3",
    step_s: float | None = None,
    effects: Sequence[str] = (),
    platforms: Sequence[str] | None = None,
    points: int = 0,
) -> Exported:
    """A model, or the transfer functions or the flow curve of a run, for another tool (`hil export`).

    Args:
        source: a model, the results of a run, or the path of either.
        to: `python`, `matlab`, `json`, `csv`, `c` or `fmu`; of a flow curve `table`: which command gives which flow.
        out: file to write; texts need none.
        part: of a run, transfer functions with this in the name.
        fmi: version of FMI, `2` or `3`.
        step_s: internal step of C and FMU; the plant's own when not given.
        effects: `NAME@HOOK`, brought along switched off, for fault injection.
        platforms: of an FMU's binaries; this machine's when not given, none at all when empty.
        points: rows of a table.

    Returns:
        `text`, where it is one; the `path` that was written; of an FMU also its `platforms`, the `difference` from
        this program's own simulation as a share of full scale, and `notes`.

    Raises:
        SettingError: what cannot be exported so, and why.
    """
    from hil.session.export import Simulation, exported

    how = Simulation(fmi, step_s, effects, platforms)
    return exported(source, to, None if out is None else Path(out), part, how, points)


@options_of("python")
def verify_fmu(path: str | Path) -> ValidatedFmu:
    """Run an FMU on the trajectories that it carries (`hil verify FILE.fmu`); it is executed, as by every simulator.

    Returns:
        The `difference` from them as a share of full scale, `faults`, and the `model` with uncertainties and fits.

    Raises:
        FileError: no FMU, or one without trajectories. InputError: it does not run on this machine.
    """
    from hil.fmu.validation import validate

    return validate(Path(path))
