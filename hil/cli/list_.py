"""`hil list`: what is installed, one line each."""

from __future__ import annotations

import typer

from hil.catalog import KINDS, entries
from hil.errors import UnknownNameError


def command(
    kind: str = typer.Argument("", metavar="[drivers|devices|procedures|plants|effects]", help="Only one kind."),
) -> None:
    """List the installed drivers, devices, procedures, plants and effects."""
    if kind and kind not in KINDS:
        raise UnknownNameError("kind of entry", kind, KINDS)
    for name in (known for known in KINDS if kind in ("", known)):
        if not kind:
            typer.echo(f"{name}:")
        found = entries(name)
        width = max((len(entry.name) for entry in found), default=0)
        for entry in found:
            typer.echo(f"{'' if kind else '  '}{entry.name:{width}}  {entry.summary}")
