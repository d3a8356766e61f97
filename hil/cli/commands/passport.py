"""`hil passport`: one signed file that a unit takes along."""

from __future__ import annotations

from pathlib import Path

from hil.cli.options import Json, Language, argument, option
from hil.cli.printed import printed


def command(
    runs: list[Path] = argument(..., "RUN...", "Run folders of one unit."),
    out: Path = option(..., "--out", "FILE.pdf", "The passport."),
    no_names: bool = option(False, "--no-names", help="Leave out who ran the tests, in every file inside."),
    no_model: bool = option(False, "--no-model", help="Do not identify the unit; page one says so."),
    model: Path | None = option(None, "--model", "MODEL.json", "Model of the type; states what these data excluded."),
    evaluated_anew: bool = option(
        False,
        "--evaluated-anew",
        help="Where another version found something else: take what is found now, and say so.",
    ),
    power: bool = option(
        False, "--power", help="Say for each limit the least faults that would have broken it; takes minutes."
    ),
    key: Path | None = option(
        None, "--key", "FILE", "The lab's key with its certificate, PEM or PKCS #12; else this machine's."
    ),
    language: Language = "",  # noqa: ARG001 — its callback takes it
    as_json: Json = False,
) -> None:
    """Put runs of one unit into one signed PDF: the certificate, the recordings, and the unit's model."""
    from hil import api
    from hil.cli.places import check_distinct, check_file
    from hil.cli.progress import shown
    from hil.passport.power import as_dict, notes, rows
    from hil.record.simulated import marked

    check_distinct(runs)
    check_file(out)
    with shown() as progress:
        found = api.issue_passport(
            runs, out, names=not no_names, identify=not no_model, model=model, key=key, evaluated_anew=evaluated_anew,
            power=power, progress=progress,
        )  # fmt: skip
    unit, signer, says = found.unit, found.signer, found.understood.says
    unfinished = "" if unit.finished else "; a test did not end as planned"
    judged = f"{unit.verdict or 'not judged'}{unfinished}"
    words = (
        f"passport: {found.path}\n"
        f"unit: {unit.valve}, {unit.serial}: {marked(judged, simulated=unit.simulated)}\n"
        f"signed by: {signer.name}, {signer.fingerprint}\n"
        f"model: {says}"
    )
    moved = [f"{run.folder}: {text}" for run in unit.runs for text in run.moved]
    caught = [f"would have failed: {limit}: {name} ({stage}) {size}, {failed}" for limit, name, stage, size, failed
              in rows(found.powers)]  # fmt: skip
    caught += map(str, notes(found.powers))
    words = "\n".join((words, *(f"evaluated anew: {text}" for text in moved), *caught))
    document = {"file": found.path, "valve": unit.valve, "serial": unit.serial, "verdict": unit.verdict,
            "simulated": unit.simulated}  # fmt: skip
    document |= {"signer": signer.name, "fingerprint": signer.fingerprint, "model": says, "moved": moved}
    document |= {"power": as_dict(found.powers)["runs"]} if power else {}
    printed({"schema": "hil.issued/1", **document}, words, as_json)
