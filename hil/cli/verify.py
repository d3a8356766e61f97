"""`hil verify`: whether a passport is as it was signed, and by whom."""

from __future__ import annotations

import json
from pathlib import Path

import typer


def command(
    file: Path = typer.Argument(..., metavar="FILE", help="Passport."),
    trust: list[Path] = typer.Option(
        [], "--trust", metavar="CERT", help="Certificate of a signer who is known, or of who vouches for him."
    ),
    as_json: bool = typer.Option(False, "--json", help="Print JSON, schema hil.verified/1."),
) -> None:
    """Exit 0: unchanged, by a known signer; 1: changed, or by an unknown signer; 2: no passport."""
    from hil.passport.key import own_certificates, read_certificates
    from hil.passport.verify import verify_file

    known = [*own_certificates(), *(one for path in trust for one in read_certificates(path))]
    found = verify_file(file, known)
    if as_json:
        told = {"file": str(file), "sentence": found.sentence, "signer": found.signer or None}
        status = {"status": found.exit_status, "fingerprint": found.fingerprint or None,
                  "simulated": found.simulated}  # fmt: skip
        typer.echo(json.dumps({"schema": "hil.verified/1", **told, **status}, indent=1, ensure_ascii=False))
        raise typer.Exit(found.exit_status)
    typer.echo(f"{file}: {found.sentence}")
    if found.simulated:
        typer.echo("SIMULATED: the runs inside were recorded on a simulated device; this says nothing of a real valve")
    if found.signer:
        typer.echo(f"signer: {found.signer}")
        typer.echo(f"SHA-256 of the certificate: {found.fingerprint}")
    raise typer.Exit(found.exit_status)
