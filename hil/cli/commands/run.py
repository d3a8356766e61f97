"""`hil run`: a procedure on a bench, from the first check to the report."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from hil.cli.completed import benches_like, procedures_like
from hil.cli.options import Archive, Json, Language, Limits, Notes, Operator, Resets, Serial, argument, option
from hil.language.note import Note, translated

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from hil.record.measurement import Limit, Measurement
    from hil.safety.outputs import Outputs
    from hil.session.labels import Labels
    from hil.session.outcome import Outcome
    from hil.session.procedure import Procedure


def command(
    procedure: str = argument("", "PROCEDURE", "Name of an installed procedure.", autocompletion=procedures_like),
    bench: str = option(
        "", "--bench", "BENCH.toml", "Bench file, or the name of an installed one.", autocompletion=benches_like
    ),
    settings: list[str] = option([], "--set", "NAME=VALUE", "A setting; may be given again."),
    preset: str = option(
        "",
        "--preset",
        "NAME",
        "Settings by their name in the bench file, else its `default`; those given here go before.",
    ),
    limits: Limits = [],  # noqa: B006 — typer makes a new one
    out: Path | None = option(None, "--out", help="Run folder; default: runs/PROCEDURE-<time>."),
    serial: Serial = "",
    operator: Operator = "",
    notes: Notes = [],  # noqa: B006 — typer makes a new one
    archive: Archive = "",
    cause_s: float = option(
        120.0,
        "--cause-budget",
        "S",
        "Time that the cause of a missed certificate is looked for, in s, once outputs are safe and the verdict "
        "is written; Ctrl-C leaves it out. 0: it is not.",
        min=0.0,
    ),
    resets: Resets = [],  # noqa: B006 — typer makes a new one
    rehearse: bool = option(
        False, "--rehearse", help="First play it on the simulated valve; drive only what goes through there."
    ),
    rehearse_only: bool = option(
        False, "--rehearse-only", help="Play it on the simulated valve, and no further; --out keeps its recording."
    ),
    resume: Path | None = option(
        None, "--resume", "RUN", "Go on where this run was broken off: its procedure, bench and settings."
    ),
    describe: bool = option(False, "--describe", help="Say what the procedure does and takes; run nothing."),
    as_json: Json = False,
    language: Language = "",  # noqa: ARG001 — its callback takes it
) -> None:
    """Run a procedure on a bench; leaves a run folder with samples, findings and report."""
    from hil.archive.place import DEFAULT_FOLDER
    from hil.cli.progress import shown
    from hil.session.labels import labelled, labels_of, new_folder
    from hil.session.limit import checked_limits, split_limits
    from hil.session.preset import preset_settings
    from hil.session.procedure import load_procedure
    from hil.session.setting import split_assignments

    labels = labels_of(serial, operator, notes)
    if resume is not None:
        procedure, bench, labels = _resumed(resume, procedure, bench, labels)
    if not procedure:
        raise typer.BadParameter("say which procedure: `hil list procedures` shows them", param_hint="PROCEDURE")
    chosen = load_procedure(procedure)
    if describe:
        typer.echo(_described(chosen))
        return
    if not bench:
        raise typer.BadParameter("say on which bench: --bench BENCH.toml", param_hint="--bench")
    from hil import api
    from hil.bench.find import find_bench
    from hil.bench.read import read_bench
    from hil.cli.places import check_folder
    from hil.cli.run_end import ended
    from hil.session.run import rehearse_procedure

    found = read_bench(find_bench(bench))
    found, labels = labelled(found, chosen, labels, _serial_asked if sys.stdin.isatty() else None)
    folder = out or new_folder(DEFAULT_FOLDER, chosen.name, labels.serial)
    check_folder(folder)
    given = {**preset_settings(found, chosen, preset), **split_assignments(settings)}
    judged_by = checked_limits(chosen.measurements, split_limits(limits))

    def run(output_states: Outputs) -> Outcome | None:
        if rehearse or rehearse_only:
            with shown() as progress:
                keep = out if rehearse_only else None
                rehearsed = rehearse_procedure(chosen, found, given, progress, resume, keep)
            typer.echo("\n".join(_for_reader(rehearsed.notes)), err=as_json)
        if rehearse_only:
            return None
        inputs = understood(chosen, given, judged_by)
        typer.echo(f"{chosen.name} on {found.bench.name}, recording into {folder}{inputs}", err=as_json)
        with shown() as progress:
            return api.run(
                chosen, found, folder, limits=limits, serial=labels.serial, operator=labels.operator,
                notes=labels.notes, resets=resets, resume=resume, progress=progress, outputs=output_states,
                settings=given, archive=archive, cause_s=cause_s,
            )  # fmt: skip

    ended(run, folder, archive, as_json=as_json)


def _resumed(run: Path, procedure: str, bench: str, labels: Labels) -> tuple[str, str, Labels]:
    """Procedure, bench and labels: those that were given, else those of the run that is resumed."""
    from hil.session.labels import Labels
    from hil.session.resume import broken_off_command

    earlier = broken_off_command(run)
    either = Labels(
        labels.serial or earlier.labels.serial,
        labels.operator or earlier.labels.operator,
        {**earlier.labels.notes, **labels.notes},
    )
    return procedure or earlier.procedure, bench or earlier.bench, either


def _serial_asked() -> str:
    """The serial number, typed or scanned."""
    return typer.prompt("serial number of the unit", default="", show_default=False, err=True)


def understood(procedure: Procedure, given: Mapping[str, str], limits: Mapping[str, Limit]) -> str:
    """Settings and limits that were typed, as they were understood; each on a line of its own."""
    from hil.report.number import limits_text
    from hil.report.terminal import typed
    from hil.session.setting import parse_settings

    values = parse_settings(procedure.settings, given)
    lines = [Note("setting {setting!l}", setting=procedure.settings[name].echoed(values[name])) for name in given]
    units = {measurement.name: measurement.unit for measurement in procedure.measurements}
    for name, limit in limits.items():
        text = typed(limits_text(limit.low, limit.high))
        lines.append(Note("limit {limit!l}", limit=f"{name} {text} {units[name.partition(', ')[0]]}".rstrip()))
    return "".join(f"\n{line}" for line in _for_reader(lines))


def _for_reader(lines: Iterable[Note]) -> list[str]:
    """In English; in the language of the page for a console, which shows them on it."""
    from hil.bench.audit import ACCOUNT
    from hil.language.choice import page_language
    from hil.language.words import ENGLISH, speaking

    with speaking(page_language() if ACCOUNT in os.environ else ENGLISH):
        return list(map(translated, lines))


def _described(procedure: Procedure) -> str:
    settings = [f"  --set {setting.described()}" for setting in procedure.settings.values()]
    measured = [_defined(m) for m in procedure.measurements]
    return "\n".join([procedure.doc, "", "settings:", *settings, "", "measures:", *measured])


def _defined(measurement: Measurement) -> str:
    line = f"  {measurement.name} [{measurement.unit}]: {measurement.meaning}"
    return f"{line}\n      {measurement.definition}" if measurement.definition else line
