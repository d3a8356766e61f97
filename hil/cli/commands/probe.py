"""`hil probe`: who is on a line, asked with reads that change nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.cli.options import Json, argument, option
from hil.cli.printed import printed

if TYPE_CHECKING:
    from hil.daq.probe import Found


def command(
    kind: str = argument(..., "modbus|can|scpi", "What is spoken on the line."),
    address: str = argument(..., "ADDRESS", "As in bench files: host:port, /dev/ttyUSB0, …"),
    options: list[str] = option(
        [], "--set", "NAME=VALUE", "Such as baud=9600, parity=E, units=1..16, bitrate=500000; again for more."
    ),
    as_json: Json = False,
) -> None:
    """Who is on a line: unit numbers and identification, node numbers and identity objects, `*IDN?`.

    Only reads are sent: registers and identification on Modbus, SDO uploads on CANopen, requests for claimed
    addresses on J1939, `*IDN?` on SCPI. Exit status 3 when nobody answers.
    """
    from hil.cli.progress import shown
    from hil.daq.probe import probe_of
    from hil.errors import LinkError
    from hil.safety.interrupt import terminable
    from hil.session.setting import split_assignments

    probe, chosen = probe_of(kind, address, split_assignments(options))
    with terminable(), shown() as progress:
        found = probe.who(chosen, progress)
    document = {"schema": "hil.probe/1", "kind": kind, "address": address, "found": found}
    printed(document, "\n".join(map(_line, found)), as_json)
    if not found:
        listed = ", ".join(f"{name} = {value}" for name, value in chosen if name not in ("address", "units"))
        raise LinkError(f"{address}: nobody answers ({listed}); check wiring, power and these settings")


def _line(found: Found) -> str:
    return f"{found.place}: {', '.join(f'{name} {text}' for name, text in found.answers.items())}".rstrip(": ")
