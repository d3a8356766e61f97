"""`hil diagnose`: where a model and recordings part, what physics was left out, and the corrected model."""

from __future__ import annotations

import json
from pathlib import Path

import typer


def command(
    recordings: list[Path] = typer.Argument(..., metavar="RECORDING...", help="Recordings of the unit."),
    model: Path = typer.Option(..., "--model", help="Nominal model file."),
    out: Path = typer.Option(..., "--out", help="Folder for diagnosis.json, corrected.json and report.html."),
    input_name: str = typer.Option("", "--input", help="Input channel, if not the model's own."),
    output_name: str = typer.Option("", "--output", help="Output channel, if not the model's own."),
) -> None:
    """Locate a mismatch, name the physics that was left out, model it, and show the fit improve."""
    from hil.cli.progress import shown
    from hil.diagnose.diagnose import diagnose
    from hil.errors import FileError
    from hil.identify.experiment import for_model
    from hil.physics.model import load_model, save_model
    from hil.record.plain import plain
    from hil.record.read import read_recording
    from hil.report.diagnosis_page import write_diagnosis_report

    nominal = load_model(model)
    experiments = [for_model(nominal, read_recording(path), input_name, output_name) for path in recordings]
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{out}: cannot be made a folder: {error.strerror}") from error
    with shown() as progress:
        found = diagnose(nominal, experiments, progress)
    content = json.dumps(plain(found.diagnosis.as_dict()), indent=1, ensure_ascii=False)
    (out / "diagnosis.json").write_text(content + "\n", encoding="utf-8")
    save_model(found.corrected, out / "corrected.json")
    write_diagnosis_report(found.diagnosis, out / "report.html")
    typer.echo(found.diagnosis.as_text())
    typer.echo(f"report: {out / 'report.html'}")
