"""Hand a model or the transfer functions of a run on to another tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hil.errors import InputError, SettingError, storing
from hil.exports.texts import functions_text, model_text
from hil.findings.results import FittedFunction, Results
from hil.fmu.build import own_platform, write_c, write_fmu
from hil.fmu.variables import Variables, variables_of
from hil.physics.model import Model, load_model
from hil.record.durable import write_named
from hil.session.kept_results import results_of_run

TEXTS = ("python", "matlab", "json", "csv")
TABLE = "table"
FORMS = (*TEXTS, TABLE, "c", "fmu")


@dataclass(frozen=True, slots=True)
class Simulation:
    """How a model becomes C or an FMU.

    Attributes:
        fmi: version, `2` or `3`.
        step_s: internal step; the plant's own when None.
        effects: `NAME@HOOK`, switched off, for fault injection.
        platforms: of binaries; this machine's when None, sources alone when empty.
    """

    fmi: str = "3"
    step_s: float | None = None
    effects: Sequence[str] = ()
    platforms: Sequence[str] | None = None


AS_THE_PLANT = Simulation()


@dataclass(frozen=True, slots=True)
class Exported:
    """What was handed on.

    Attributes:
        text: of a form that is a text; else empty.
        path: that was written, if one was.
        title: of the plant, of C and FMU.
        parameters: how many can be set from outside, of C and FMU.
        platforms: for which an FMU has binaries.
        difference: between an FMU and `simulate` as a share of full scale; None where it cannot run here.
        notes: for the user.
    """

    text: str = ""
    path: Path | None = None
    title: str = ""
    parameters: int = 0
    platforms: tuple[str, ...] = ()
    difference: float | None = None
    notes: tuple[str, ...] = ()


def exported(
    source: Model | Results | str | Path,
    to: str,
    out: Path | None,
    part: str = "",
    how: Simulation = AS_THE_PLANT,
    points: int = 0,
) -> Exported:
    """Export a model, the transfer functions of a run whose names hold `part`, or a run's flow curve in `points` rows.

    Raises:
        SettingError: a form that there is not, or one that the source does not have.
        StorageError: the file cannot be written.
    """
    if to not in FORMS:
        raise SettingError(f"to {to}: no such form; there are: {', '.join(FORMS)}")
    if points and to != TABLE:
        raise SettingError(f"points {points}: only of a table (to {TABLE})")
    as_text = to in (*TEXTS, TABLE)
    if as_text and (how.effects or how.step_s is not None or how.platforms is not None):
        raise SettingError(f"to {to}: a step, effects and platforms are of C and FMU only")
    if not as_text:
        if out is None:
            raise SettingError(f"to {to}: name a file (out), as FILE.{to}")
        return _simulated(source, to, out, how)
    text = _table(source, points) if to == TABLE else _text(source, to, part)
    if out is not None:
        with storing(out):
            write_named(out, text)
    return Exported(text, out)


def _table(source: Model | Results | str | Path, points: int) -> str:
    from hil.exports.compensation import compensation, compensation_text
    from hil.session.analyses import flow_curve_of

    if isinstance(source, Model | Results) or Path(source).suffix == ".json":
        raise SettingError(f"to {TABLE}: of a run of flow_curve, or of a curve as CSV, by its path")
    curve = flow_curve_of(Path(source))
    rows = compensation(curve.command, curve.flow, points)
    return compensation_text(rows, curve.input, curve.output, simulated=curve.simulated)


def _text(source: Model | Results | str | Path, to: str, part: str) -> str:
    if isinstance(source, Results) or (not isinstance(source, Model) and Path(source).is_dir()):
        results = source if isinstance(source, Results) else results_of_run(Path(source))
        return functions_text(_functions(results, part), to, simulated=results.simulated)
    name = "model" if isinstance(source, Model) else Path(source).stem
    if part:
        raise SettingError(f"part {part}: only a run has parts; {name} is a model")
    return model_text(_model(source), name, to)


def _functions(results: Results, part: str) -> list[FittedFunction]:
    chosen = [one for one in results.transfer_functions if part in one.name]
    if not chosen:
        known = "; ".join(one.name for one in results.transfer_functions) or "none"
        raise SettingError(f"{results.run}: no transfer function with '{part}' in its name; there are: {known}")
    return chosen


def _model(source: Model | str | Path) -> Model:
    return source if isinstance(source, Model) else load_model(Path(source))


def _simulated(source: Model | Results | str | Path, to: str, out: Path, how: Simulation) -> Exported:
    if isinstance(source, Results) or (not isinstance(source, Model) and Path(source).is_dir()):
        raise SettingError(f"to {to}: of a model; a run's transfer functions go to {', '.join(TEXTS)}")
    if how.step_s is not None and not how.step_s > 0.0:
        raise SettingError(f"step {how.step_s:g} s: must be above 0 s")
    also = [(name, hook) for name, _, hook in (text.partition("@") for text in how.effects)]
    variables = variables_of(_model(source), also, how.step_s)
    if to == "fmu":
        return _fmu(variables, out, how)
    write_c(variables, out)
    return Exported("", out, variables.plant.title, len(variables.parameters))


def _fmu(variables: Variables, out: Path, how: Simulation) -> Exported:
    """Written under its name only when it has been held against the simulation, where it can run here."""
    from hil.fmu.validation import validate

    if how.fmi not in ("2", "3"):
        raise SettingError(f"fmi {how.fmi}: there are 2 and 3")
    part = out.with_name(f".part-{out.name}")
    try:
        built = write_fmu(variables, part, "2" if how.fmi == "2" else "3", how.platforms)
        found = validate(part) if own_platform() in built.platforms else None
        if found is not None and found.faults:
            raise InputError(f"{out}: {found.faults[0]}")
        part.replace(out)
    finally:
        part.unlink(missing_ok=True)
    count = len(variables.parameters)
    return Exported(
        "", out, variables.plant.title, count, built.platforms, None if found is None else found.difference, built.notes
    )
