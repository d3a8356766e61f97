"""How a command that drives a bench ends: what is said, where the run is entered, and the exit status."""

from __future__ import annotations

import json
import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import typer

from hil.archive.place import archive_place
from hil.cli.error_message import WAITS_S, say, text_of
from hil.errors import RehearsalError, exit_status_of
from hil.stderr import write

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hil.safety.outputs import Outputs
    from hil.session.outcome import Outcome

_SLOW_S = 2.0  # so long a command may work without saying at what
_T = TypeVar("_T")


def safely(
    run: Callable[[Outputs], _T], folder: Path, archive: str, *,
    output_states: Outputs | None = None, as_json: bool = False,
) -> _T:  # fmt: skip
    """Do a run; when it fails, say what came of it and of the outputs, and leave with the exit status of that.

    Args:
        run: does it, told where to keep what is known of the outputs.
        folder: of the run.
        archive: where a run that failed is entered.
        output_states: what is known of the outputs, for who asks for it afterwards.
        as_json: whether the failure is printed as JSON too (see `failure_document`).
    """
    from hil.archive.begun import forget_begun, mark_begun
    from hil.bench.ending import last_word
    from hil.safety.interrupt import ended_by
    from hil.safety.outputs import Outputs

    output_states = output_states or Outputs()
    # Without waiting: a stopped terminal keeps no output from its safe value.
    output_states.announce = lambda text: write(f"hil: {text}\n", 0.0)

    def reported(error: BaseException) -> int:
        output_states.mark(error)
        stopped = isinstance(error, KeyboardInterrupt)
        status = say(error, *([output_states.text, _kept(folder)] if stopped else []))
        if as_json:
            document = json.dumps(failure_document(error, output_states, folder), indent=1, ensure_ascii=False)
            write(f"{document}\n", WAITS_S, sys.stdout)
        return status

    mark_begun(archive_place(archive), folder)
    with last_word(reported) as word:
        try:
            return run(output_states)
        except BaseException as error:  # said here: on its way up typer would make something else of some
            status = word.say(ended_by(error))
            if isinstance(error, RehearsalError):  # nothing was driven: there is no run
                forget_begun(folder)
            else:
                entered(archive, folder)
            raise typer.Exit(status) from error


def failure_document(error: BaseException, output_states: Outputs, folder: Path) -> dict[str, Any]:
    """What a run that failed prints as JSON: results without a value, the error, and the outputs as in `end.json`."""
    from hil.findings.results import SCHEMA

    return {
        "schema": SCHEMA, "run": folder.absolute().name, "verdict": None, "values": [], "curves": [],
        "transfer_functions": [], "error": text_of(error), "exit_status": exit_status_of(error),
        "outputs": output_states.record(),
    }  # fmt: skip


def ended(run: Callable[[Outputs], Outcome | None], folder: Path, archive: str, *, as_json: bool = False) -> NoReturn:
    """Do a run, say what came of it and of the outputs, enter it into the archive, and leave with its exit status.

    Args:
        run: does it, told where to keep what is known of the outputs; None when there was nothing to drive.
        folder: of the run.
        archive: where it is entered.
        as_json: whether its results are printed as JSON instead of words, with what is known of the outputs.
    """
    from hil.archive.begun import forget_begun
    from hil.safety.outputs import Outputs

    output_states = Outputs()
    outcome = safely(run, folder, archive, output_states=output_states, as_json=as_json)
    if outcome is None:
        forget_begun(folder)
        raise typer.Exit
    try:
        say_outcome(outcome, output_states, as_json=as_json, say=_print)
    except OSError as error:  # the verdict stands in the folder, and in the exit status
        if not isinstance(error, BrokenPipeError):
            write(f"hil: {error.filename}: {error.strerror}; the results stand in {folder}\n", WAITS_S)
    entered(archive, folder)
    raise typer.Exit(outcome.exit_status)


def say_outcome(
    outcome: Outcome, output_states: Outputs | None = None, *, as_json: bool, say: Callable[[str], None] = typer.echo
) -> None:
    """What a run found and where its report is; or its results and the outputs as in `end.json`, for a program."""
    if as_json:
        from hil import api

        found = api.results(outcome.folder).model_dump(mode="json", by_alias=True)
        outputs = {} if output_states is None else {"outputs": output_states.record()}
        say(json.dumps(found | outputs, indent=1, ensure_ascii=False))
        return
    from hil.report.terminal import findings_text, where

    text = findings_text(outcome.findings, simulated=outcome.simulated, ended=outcome.ended)
    say("\n".join([text, *where(outcome.report)]))


def _print(text: str) -> None:
    """Print a result; a stopped terminal is waited for as long as for the last word, a reading program for good."""
    from hil.printable import printable

    if sys.stdout.isatty():
        write(f"{printable(text)}\n", WAITS_S, sys.stdout)
    else:
        typer.echo(text)


def entered(archive: str, folder: Path) -> None:
    """Enter the run into the archive; what keeps it from that is said, and changes nothing of how the run ended."""
    try:
        with _reported_when_slow():
            note = _entered(archive, folder)
    except Exception as error:
        note = f"the run is not in the archive: {text_of(error)}; `hil archive rebuild` enters it"
    from hil.archive.begun import forget_begun

    forget_begun(folder)
    if note:
        write(f"hil: {note}\n", WAITS_S)


@contextmanager
def _reported_when_slow() -> Iterator[None]:
    """What the command still does is said when that takes longer than a glance: the run itself is over."""
    text = "100%  the run is over and its folder is closed; it is being entered into the archive …\n"
    timer = threading.Timer(_SLOW_S, write, (text, 0.0))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _entered(archive: str, folder: Path) -> str:
    from hil.record.run_folder.header import HEADER_FILE

    if not (folder / HEADER_FILE).is_file():
        return ""
    from hil.archive.pending import enter_or_keep

    return enter_or_keep(archive_place(archive), folder)


def _kept(folder: Path) -> str:
    from hil.record.run_folder.header import HEADER_FILE

    return f"what was recorded is kept in {folder}" if (folder / HEADER_FILE).is_file() else ""
