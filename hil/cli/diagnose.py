"""`hil diagnose`: where a model and recordings part, what physics was left out, and the corrected model."""

from __future__ import annotations

from pathlib import Path

import typer


def command(
    recordings: list[Path] = typer.Argument(None, metavar="RECORDING...", help="Recordings of the unit."),
    model: Path | None = typer.Option(None, "--model", help="Nominal model file."),
    out: Path = typer.Option(..., "--out", help="Folder for diagnosis.json, corrected.json and report.html."),
    input_name: str = typer.Option("", "--input", help="Input channel, if not the model's own."),
    output_name: str = typer.Option("", "--output", help="Output channel, if not the model's own."),
    bench: str = typer.Option(
        "", "--bench", metavar="BENCH.toml", help="Run the tests that are still needed on this bench, and conclude."
    ),
    budget_s: float = typer.Option(60.0, "--budget", min=0.0, help="Bench time that those tests may take, in s."),
    units: list[Path] = typer.Option(
        [],
        "--unit",
        metavar="FOLDER",
        help="Instead of recordings: a unit's folder of CSV files, with its own "
        "nominal.json or the --model; may be given again. Each gets a folder of its own in --out.",
    ),
    scheduler: str = typer.Option("", "--scheduler", metavar="tcp://…", help="Dask scheduler that does the units."),
) -> None:
    """Locate a mismatch, name the physics that was left out, model it, and show the fit improve."""
    from hil.cli.places import check_distinct, check_folder

    check_folder(out)
    if units:
        _diagnose_units(units, model, out, scheduler)
        return
    if model is None or not recordings:
        raise typer.BadParameter("give --model and recordings, or units by --unit")
    if scheduler:
        raise typer.BadParameter(
            "spreads units (--unit) over machines; one unit is done on this one", param_hint="--scheduler"
        )
    check_distinct(recordings)
    from hil.cli.progress import shown
    from hil.diagnosis.diagnose import diagnose
    from hil.identification.experiment import for_model
    from hil.physics.model import load_model
    from hil.record.read import read_recording
    from hil.session.diagnosis import conclude, write_diagnosis

    nominal = load_model(model)
    experiments = [for_model(nominal, read_recording(path), input_name, output_name) for path in recordings]
    with shown() as progress:
        if bench:
            from hil.bench.find import find_bench
            from hil.bench.read import read_bench

            found = conclude(nominal, experiments, read_bench(find_bench(bench)), budget_s, out, progress)
        else:
            found = diagnose(nominal, experiments, progress)
    report = write_diagnosis(found, out)
    typer.echo(found.diagnosis.as_text())
    typer.echo(f"report: {report}")


def _diagnose_units(folders: list[Path], model: Path | None, out: Path, scheduler: str) -> None:
    from hil.cli.progress import shown
    from hil.physics.model import load_model
    from hil.session.diagnosis import write_diagnosis
    from hil.session.fleet import diagnose_units, read_unit

    nominal = load_model(model) if model is not None else None
    units = [read_unit(folder, nominal) for folder in folders]
    with shown() as progress:
        answers = list(diagnose_units(units, scheduler, progress))
    failed = 0
    for unit, answer in answers:
        if isinstance(answer, str):
            failed += 1
            typer.echo(f"{unit.name}: not diagnosed: {answer}")
        else:
            write_diagnosis(answer, out / unit.name)
            names = ", ".join(effect.name for effect in answer.diagnosis.effects)
            typer.echo(f"{unit.name}: {answer.diagnosis.verdict}{': ' if names else ''}{names}")
    if failed:
        raise typer.Exit(2)
