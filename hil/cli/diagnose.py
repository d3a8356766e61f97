"""`hil diagnose`: where a model and recordings part, what physics was left out, and the corrected model."""

from __future__ import annotations

from pathlib import Path

import typer


def command(
    recordings: list[Path] = typer.Argument(..., metavar="RECORDING...", help="Recordings of the unit."),
    model: Path = typer.Option(..., "--model", help="Nominal model file."),
    out: Path = typer.Option(..., "--out", help="Folder for diagnosis.json, corrected.json and report.html."),
    input_name: str = typer.Option("", "--input", help="Input channel, if not the model's own."),
    output_name: str = typer.Option("", "--output", help="Output channel, if not the model's own."),
    bench: str = typer.Option(
        "", "--bench", metavar="BENCH.toml", help="Run the tests that are still needed on this bench, and conclude."
    ),
    budget_s: float = typer.Option(60.0, "--budget", min=0.0, help="Bench time that those tests may take, in s."),
) -> None:
    """Locate a mismatch, name the physics that was left out, model it, and show the fit improve."""
    from hil.cli.progress import shown
    from hil.diagnose.diagnose import diagnose
    from hil.identify.experiment import for_model
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
