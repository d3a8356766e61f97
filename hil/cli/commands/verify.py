"""`hil verify`: whether a passport is as it was signed, and by whom; whether an FMU does what it was exported for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from hil.cli.options import Json, argument, option
from hil.cli.printed import printed

if TYPE_CHECKING:
    from datetime import datetime

    from hil.passport.evaluate import Evaluated
    from hil.passport.verify import Verified


def command(
    file: Path = argument(..., "FILE", "Passport, or an FMU (which is executed)."),
    trust: list[Path] = option(
        [], "--trust", "CERT", "Certificate of a signer who is known, or of who vouches for him."
    ),
    revoked: Path | None = option(
        None,
        "--revoked",
        "FILE",
        "Revoked certificates: SHA-256, date and reason on each line; else revoked.txt of this machine.",
    ),
    received: str = option(
        "", "--received", "DATE", "You had the file by then: trusted where a key was revoked later."
    ),
    evaluate: bool = option(
        False, "--evaluate", help="Evaluate the runs inside anew, and hold page one, certificate and data together."
    ),
    as_json: Json = False,
) -> None:
    """Exit 0: unchanged, by a known signer; 1: changed, or by an unknown signer; 2: no passport.

    FILE.fmu is run on the trajectories that it carries: 0: it reproduces them; 1: not; 2: it has none, or does not run.
    With --evaluate also 1 where the samples inside do not give what the passport says, or nobody can tell here.
    """
    if file.suffix.lower() == ".fmu":
        raise typer.Exit(_verify_fmu(file, as_json))
    from hil.passport.key import own_certificates, read_certificates
    from hil.passport.revoked import read_revocations
    from hil.passport.verify import Trust, verify_file

    known = [*own_certificates(), *(one for path in trust for one in read_certificates(path))]
    found = verify_file(file, Trust(known, read_revocations(revoked), _received(received)))
    evaluated = _evaluated(file, found) if evaluate and found.is_as_signed else None
    status = max(found.exit_status, 1 if evaluated is not None and evaluated.faults else 0)
    document = {
        "schema": "hil.verified/1", "file": file, "sentence": found.sentence, "signer": found.signer or None,
        "signed_utc": found.signed_utc, "status": status, "fingerprint": found.fingerprint or None,
        "simulated": found.simulated, "evaluated": evaluated,
    }  # fmt: skip
    words = [f"{file}: {found.sentence}"]
    if found.simulated:
        words += ["SIMULATED: the runs inside were recorded on a simulated device; this says nothing of a real valve"]
    if found.signer:
        words += [f"signer: {found.signer}", f"SHA-256 of the certificate: {found.fingerprint}"]
        words += [f"signed: {_when(found)}"]
    words += [] if evaluated is None else _lines(evaluated)
    printed(document, "\n".join(words), as_json, indent=1)
    raise typer.Exit(status)


def _verify_fmu(file: Path, as_json: bool) -> int:
    from hil import api

    found = api.verify_fmu(file)
    document = {"schema": "hil.verified-fmu/1", "file": file, **found.as_dict()}
    printed(document, f"{file}: {found.as_text()}", as_json, indent=1)
    return 1 if found.faults else 0


def _received(text: str) -> datetime | None:
    from hil.errors import SettingError
    from hil.passport.revoked import moment_of

    try:
        return moment_of(text) if text else None
    except ValueError:
        raise SettingError(f"--received {text}: a date was expected, as 2026-11-25 or 2026-11-25T14:30") from None


def _when(found: Verified) -> str:
    from hil.report.local_time import local_text

    if found.signed_utc is None:
        return "the signer's computer does not say when"
    return f"{local_text(found.signed_utc)}, as the signer's computer said; no third party vouches for it"


def _evaluated(file: Path, found: Verified) -> Evaluated:
    from hil.passport.evaluate import evaluate_passport
    from hil.record.gathered import whole

    return evaluate_passport(whole(file), found.most_bytes)


def _lines(found: Evaluated) -> Iterator[str]:
    yield from found.notes
    if found.faults:
        yield from (f"does not follow from the samples: {fault}" for fault in found.faults)
        return
    runs = "1 run" if found.runs == 1 else f"{found.runs} runs"
    yield (
        f"evaluated anew: {found.values} values of {runs}, each within 1 % of its ±; page one, certificate and data "
        "say the same (the model inside was not identified again)"
    )
