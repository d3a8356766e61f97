"""`hil report`: the report of a run, made again."""

from __future__ import annotations

from pathlib import Path

import typer

from hil.cli.options import Json, Language, Limits, argument, option


def command(
    run: Path = argument(..., "RUN", "Run folder."),
    limits: Limits = [],  # noqa: B006 — typer makes a new one
    open_page: bool = option(False, "--open", help="Show the page in the browser."),
    as_json: Json = False,
    language: Language = "",  # noqa: ARG001 — its callback takes it
) -> None:
    """Evaluate a run once more and write its report again, also of a run that was stopped or tripped."""
    from hil.cli.run_end import say_outcome
    from hil.session.limit import split_limits
    from hil.session.results import report_again

    outcome = report_again(run, split_limits(limits))
    say_outcome(outcome, as_json=as_json)
    if open_page:
        typer.launch(str(outcome.report))
    raise typer.Exit(outcome.exit_status)
