"""How a command that drives a bench ends: what is said, where the run is entered, and the exit status."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypeVar

import typer

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.safety.outputs import Outputs
    from hil.session.outcome import Outcome

_T = TypeVar("_T")


def safely(run: Callable[[Outputs], _T], folder: Path, archive: str) -> _T:
    """Do a run; when it fails, say what came of it and of the outputs, and leave with the exit status of that.

    Args:
        run: does it, told where to keep what is known of the outputs.
        folder: of the run.
        archive: where a run that failed is entered.
    """
    from hil.archive.begun import mark_begun
    from hil.archive.place import archive_place
    from hil.cli.said import say
    from hil.safety.outputs import Outputs

    known = Outputs()
    mark_begun(archive_place(archive), folder)
    try:
        return run(known)
    except BaseException as error:  # said here: on its way up typer would make something else of some
        known.mark(error)
        stopped = isinstance(error, KeyboardInterrupt)
        status = say(error, *([known.text, _kept(folder)] if stopped else []))
        entered(archive, folder)
        raise typer.Exit(status) from error


def ended(run: Callable[[Outputs], Outcome | None], folder: Path, archive: str, *, as_json: bool = False) -> NoReturn:
    """Do a run, say what came of it and of the outputs, enter it into the archive, and leave with its exit status.

    Args:
        run: does it, told where to keep what is known of the outputs; None when there was nothing to drive.
        folder: of the run.
        archive: where it is entered.
        as_json: whether its results are printed as `hil results --json -` does, instead of words.
    """
    from hil.archive.begun import forget_begun

    outcome = safely(run, folder, archive)
    if outcome is None:
        forget_begun(folder)
        raise typer.Exit
    with suppress(OSError):  # nobody reads it: the verdict stands in the folder, and in the exit status
        say_outcome(outcome, as_json=as_json)
    entered(archive, folder)
    raise typer.Exit(outcome.exit_status)


def say_outcome(outcome: Outcome, *, as_json: bool) -> None:
    """What a run found and where its report is; or its results, for a program."""
    if as_json:
        from hil import api

        typer.echo(api.results(outcome.folder).as_json(), nl=False)
        return
    from hil.report.terminal import findings_text

    typer.echo(findings_text(outcome.findings))
    typer.echo(f"report: {outcome.report}")


def entered(archive: str, folder: Path) -> None:
    """Enter the run into the archive; what keeps it from that is said, and changes nothing of how the run ended."""
    try:
        told = _entered(archive, folder)
    except Exception as error:
        told = f"the run is not in the archive: {error}; `hil archive rebuild` enters it"
    from hil.archive.begun import forget_begun

    forget_begun(folder)
    with suppress(OSError):
        if told:
            typer.echo(f"hil: {told}", err=True)


def _entered(archive: str, folder: Path) -> str:
    from hil.record.header import HEADER_FILE

    if not (folder / HEADER_FILE).is_file():
        return ""
    from hil.archive.pending import enter_or_keep
    from hil.archive.place import archive_place

    return enter_or_keep(archive_place(archive), folder)


def _kept(folder: Path) -> str:
    from hil.record.header import HEADER_FILE

    return f"what was recorded is kept in {folder}" if (folder / HEADER_FILE).is_file() else ""
