"""`hil export`: a model, or the transfer functions of a run, for another tool."""

from __future__ import annotations

from pathlib import Path

import typer

_FORMS = ("python", "matlab", "json", "csv")


def command(
    source: Path = typer.Argument(..., metavar="MODEL.json|RUN", help="Model file, or run folder."),
    to: str = typer.Option(..., "--to", metavar="|".join(_FORMS), help="For which tool."),
    out: str = typer.Option("-", "--out", metavar="FILE", help="File to write; `-` is stdout."),
    part: str = typer.Option(
        "", "--part", metavar="NAME", help="Of a run: the transfer functions with this in the name."
    ),
) -> None:
    """Hand a model or the transfer functions of a run on to another tool."""
    from hil.cli.places import check_file
    from hil.errors import SettingError

    if to not in _FORMS:
        raise SettingError(f"--to {to}: not known; there are: {', '.join(_FORMS)}")
    text = _of_run(source, part, to) if source.is_dir() else _of_model(source, part, to)
    if out == "-":
        typer.echo(text, nl=False)
    else:
        check_file(Path(out), [source])
        Path(out).write_text(text, encoding="utf-8")


def _of_model(source: Path, part: str, to: str) -> str:
    from hil.errors import SettingError
    from hil.export.texts import model_text
    from hil.physics.model import load_model

    if part:
        raise SettingError(f"--part {part}: only a run has parts; {source} is a model")
    return model_text(load_model(source), source.stem, to)


def _of_run(source: Path, part: str, to: str) -> str:
    from hil.errors import SettingError
    from hil.export.texts import functions_text
    from hil.session.results import results_of_run

    every = results_of_run(source).transfer_functions
    chosen = [one for one in every if part in one.name]
    if not chosen:
        known = "; ".join(one.name for one in every) or "none"
        raise SettingError(f"{source}: no transfer function with '{part}' in its name; there are: {known}")
    return functions_text(chosen, to)
