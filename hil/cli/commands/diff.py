"""`hil diff`: what changed in a unit between two dates, in physics."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hil.cli.options import Json, argument, option
from hil.cli.printed import printed
from hil.cli.reading import Inputs, Output, takes_reading, teller
from hil.record.reading import Reading
from hil.report.number import with_std, with_unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.passport.change import Change, Size, Unchanged
    from hil.passport.difference import DateDifference


@takes_reading
def command(
    old: Path = argument(..., "OLD", "Passport, run folder or folder with recordings."),
    new: Path = argument(..., "NEW", "The same of a later date."),
    model: Path | None = option(None, "--model", "MODEL.json", "Model of the type, where no passport holds one."),
    budget_s: float = option(
        120.0,
        "--budget",
        "S",
        "Work after which no further search is begun: S times 10 million simulated samples; of long recordings "
        "as much is taken as it allows. inf: no end.",
        min=0.0,
    ),
    as_json: Json = False,
    input_name: Inputs = [],  # noqa: B006 — typer makes a new one
    output_name: Output = "",
    *,
    reading: Reading,
) -> None:
    """What changed between two dates: by cause, of the valve or of the bench, and what stayed within which limit."""
    from hil import api
    from hil.cli.progress import shown

    noted: list[str] = []
    with shown() as progress:
        found = api.diff(old, new, model=model, inputs=input_name, output=output_name, budget_s=budget_s,
                         reading=reading, notes=teller(aside=as_json, kept=noted), progress=progress)  # fmt: skip
    printed(found.as_dict(), _text(found, noted), as_json)


def _text(found: DateDifference, noted: Sequence[str] = ()) -> str:
    from hil.record.simulated import marked

    lines = [marked(found.verdict, simulated=found.simulated), *(f"  {_sentence(change)}" for change in found.changes)]
    if found.unchanged:
        lines.append("  unchanged within these limits (95 %):")
        width = max(len(one.name) for one in found.unchanged)
        lines += [f"    {one.name:{width}}  {_kept(one)}" for one in found.unchanged]
    if found.cannot_tell:
        lines.append("  cannot be told:")
        width = max(len(one.name) for one in found.cannot_tell)
        lines += [f"    {one.name:{width}}  known only within {_limit(one)}" for one in found.cannot_tell]
    return "\n".join([*lines, *(f"  note: {note}" for note in found.notes if note not in noted)])


def _sentence(change: Change) -> str:
    from hil.report.terminal import typed

    whose = {"valve": "the valve's", "bench": "the bench's", "open": "the valve's or the bench's"}[change.of]
    share = "" if change.share is None else f", {100.0 * change.share:.0f} % of the change"
    sizes = f"{_size(change.before)} → {_size(change.after)} {change.unit}"
    return typed(f"{change.name} ({change.stage}, {whose}): {sizes}{share}")


def _kept(one: Unchanged) -> str:
    return f"none at {_limit(one)} or less" if one.is_place else _limit(one)


def _limit(one: Unchanged) -> str:
    return with_unit(one.limit, one.unit, 2)


def _size(size: Size) -> str:
    return "none" if size.value is None else with_std(size.value, size.std)
