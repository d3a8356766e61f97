"""`hil jog`: one output by hand, through the guard, and back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from hil.cli.options import Archive, Bench, Json, Notes, Operator, Resets, Serial, argument, option

if TYPE_CHECKING:
    from hil.safety.outputs import Outputs
    from hil.session.outcome import Outcome

CONTEXT = {"ignore_unknown_options": True}  # a value may begin with a minus


def command(
    bench: Bench,
    channel: str = argument(..., "CHANNEL", "The output."),
    value: str = argument(..., "VALUE", "Where it goes: 20, '50 %', '-3.5 bar'."),
    for_time: str = option("2s", "--for", "TIME", "How long it stands there: 2s, '200 ms'."),
    out: Path | None = option(None, "--out", help="Run folder; default: runs/jog-<time>."),
    serial: Serial = "",
    operator: Operator = "",
    notes: Notes = [],  # noqa: B006 — typer makes a new one
    archive: Archive = "",
    resets: Resets = [],  # noqa: B006 — typer makes a new one
    as_json: Json = False,
) -> None:
    """One output to a value and back, by hand: through limits, ramp, interlocks, watchdog and read-back.

    It goes back to its safe value when the time is over, on any key, on a signal, and when a link is lost. What every
    input did is shown, and recorded as a run.
    """
    from hil import api
    from hil.api.bench import bench_of
    from hil.archive.place import DEFAULT_FOLDER
    from hil.cli.key import any_key
    from hil.cli.places import check_folder
    from hil.cli.progress import shown
    from hil.cli.quantity import quantity
    from hil.cli.run_end import ended
    from hil.errors import SettingError
    from hil.session.labels import labelled, labels_of, new_folder
    from hil.session.manual_output import output_of
    from hil.session.procedure import load_procedure

    found = bench_of(bench)
    place = quantity(value, found.bench.channels[output_of(found, channel)].unit, "VALUE")
    for_s = quantity(for_time, "s", "--for")
    if for_s <= 0.0:
        raise SettingError(f"--for {for_time}: a time longer than 0 s was expected")
    found, labels = labelled(found, load_procedure("jog"), labels_of(serial, operator, notes))
    folder = out or new_folder(DEFAULT_FOLDER, "jog", labels.serial)
    check_folder(folder)

    def run(output_states: Outputs) -> Outcome:
        with any_key() as pressed, shown() as progress:
            typer.echo(f"jog {channel} on {found.bench.name}, recording into {folder}; any key ends it", err=as_json)
            return api.jog(
                found, channel, place, folder, for_s=for_s, serial=labels.serial, operator=labels.operator,
                notes=labels.notes, resets=resets, wanted=lambda: not pressed(), progress=progress,
                outputs=output_states,
            )  # fmt: skip

    ended(run, folder, archive, as_json=as_json)
