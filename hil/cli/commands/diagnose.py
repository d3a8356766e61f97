"""`hil diagnose`: where a model and recordings part, what physics was left out, and the corrected model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperCommand

from hil.cli.options import Language, argument, option
from hil.cli.progress import shown
from hil.cli.reading import Inputs, Output, takes_reading, teller
from hil.record.reading import Reading

if TYPE_CHECKING:
    from hil.session.fleet import UnitAnswer


class Command(TyperCommand):
    """Takes several recordings behind one `--before`, and several folders behind one `--fleet`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Each word up to the next option is one more, unless no recording would be left to diagnose."""
        each = _each(_each(args, "--before"), "--fleet")
        kept = super().make_parser(ctx).parse_args(list(each))[0]
        return super().parse_args(ctx, each if kept.get("recordings") or "--fleet" in args else args)


def _each(args: Sequence[str], option: str) -> list[str]:
    made: list[str] = []
    is_behind = False
    for word in args:
        is_option = word.startswith("-")
        if is_behind and not is_option and made[-1] != option:
            made.append(option)
        is_behind = word == option if is_option else is_behind
        made.append(word)
    return made


@takes_reading
def command(
    recordings: list[Path] = argument(None, "RECORDING...", "Recordings of the unit."),
    model: Path | None = option(None, "--model", help="Nominal model file."),
    out: Path = option(..., "--out", help="Folder for diagnosis.json, corrected.json and report.html."),
    input_name: Inputs = [],  # noqa: B006 — typer makes a new one
    output_name: Output = "",
    bench: str = option(
        "", "--bench", "BENCH.toml", "Run the tests that are still needed on this bench, and conclude."
    ),
    bench_budget_s: float = option(60.0, "--bench-budget", "S", "Bench time that those tests may take, in s.", min=0.0),
    budget_s: float = option(
        math.inf,
        "--budget",
        "S",
        "Work after which no further search is begun: S times 10 million simulated samples; of each of a fleet.",
        min=0.0,
        show_default="none",
    ),
    question: str = option(
        "",
        "--question",
        "changed|left_out",
        "What has changed since identification, or what the model leaves out; by the recordings where not given.",
    ),
    before: list[Path] = option(
        [], "--before", "RECORDING", "Recordings of the same unit at the date of identification, up to the next option."
    ),
    fleet: list[Path] = option(
        [],
        "--fleet",
        "FOLDER",
        "Instead of recordings: a valve's folder of CSV files, with its own "
        "nominal.json or the --model; or several of them. Each gets a folder of its own in --out.",
    ),
    screen: bool = option(
        False,
        "--screen",
        help="Of a fleet, ask only whether each unit has changed since its model was identified: no cause, and one "
        "table in --out.",
    ),
    scheduler: str = option("", "--scheduler", "tcp://…", "Dask scheduler that does the fleet."),
    as_json: bool = option(False, "--json", help="Print diagnosis.json too, schema hil.diagnosis/1."),
    language: Language = "",  # noqa: ARG001 — its callback takes it
    *,
    reading: Reading,
) -> None:
    """Locate a mismatch, name the physics that was left out, model it, and show the fit improve."""
    from hil import api
    from hil.cli.places import check_distinct, check_folder

    check_folder(out)
    if fleet:
        if recordings or bench or before or question:
            raise typer.BadParameter(
                "a fleet has its recordings in its folders, they say what is asked, and it has no bench",
                param_hint="--fleet",
            )
        channels = (input_name, output_name)
        _diagnose_fleet(fleet, model, channels, out, scheduler, reading, budget_s, screen=screen, as_json=as_json)
        return
    if model is None or not recordings:
        raise typer.BadParameter("give --model and recordings, or folders by --fleet")
    if screen:
        raise typer.BadParameter("asks the units of a fleet (--fleet)", param_hint="--screen")
    if scheduler:
        raise typer.BadParameter(
            "spreads a fleet (--fleet) over machines; one valve is done on this one", param_hint="--scheduler"
        )
    check_distinct(recordings)
    from hil.report.terminal import where
    from hil.session.diagnosis import DIAGNOSIS_FILE, REPORT_FILE

    with shown() as progress:
        found = api.diagnose(
            model, recordings, inputs=input_name, output=output_name, out=out, bench=bench,
            bench_budget_s=bench_budget_s, budget_s=budget_s, question=question, before=before, reading=reading,
            notes=teller(aside=as_json), progress=progress,
        )  # fmt: skip
    if as_json:
        typer.echo((out / DIAGNOSIS_FILE).read_text(encoding="utf-8"), nl=False)
        return
    typer.echo("\n".join([found.diagnosis.as_text(), *where(out / REPORT_FILE)]))


def _diagnose_fleet(
    folders: list[Path], model: Path | None, channels: tuple[list[str], str], out: Path, scheduler: str,
    reading: Reading, budget_s: float, *, screen: bool, as_json: bool,
) -> None:  # fmt: skip
    from hil import api
    from hil.cli.printed import printed
    from hil.session.fleet import SCHEMA

    with shown() as progress:
        answers = api.diagnose_fleet(
            folders, model=model, inputs=channels[0], output=channels[1], out=out, scheduler=scheduler,
            budget_s=budget_s, screen=screen, reading=reading, notes=teller(aside=as_json), progress=progress,
        )  # fmt: skip
    units = [one.as_dict() for one in answers] if as_json else []
    printed({"schema": SCHEMA, "units": units}, _screened(answers) if screen else _diagnosed(answers), as_json)
    if any(one.error for one in answers):
        raise typer.Exit(2)


def _diagnosed(answers: Sequence[UnitAnswer]) -> str:
    return "\n".join(one.as_text() for one in answers)


def _screened(answers: Sequence[UnitAnswer]) -> str:
    """A row for each unit, and how many there are of each verdict."""
    from collections import Counter

    from hil.record.simulated import marked
    from hil.report.terminal import aligned

    rows = [("unit", "verdict", "z", "needed", "fit", "shows as")]
    for one in answers:
        if (found := one.screened) is None:
            rows.append((one.unit, "not screened", "", "", "", one.error))
        else:
            verdict = marked(found.verdict, simulated=found.simulated)
            fit = "" if found.fit is None else f"{found.fit:.2f} %"
            rows.append((one.unit, verdict, f"{found.z:.2f}", f"{found.needed:.2f}", fit, found.shows_as))
    counts = Counter("not screened" if one.screened is None else one.screened.verdict for one in answers)
    counted = ", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items()))
    return "\n".join([*aligned(rows), f"{len(answers)} units: {counted}"])
