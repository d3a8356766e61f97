"""`hil devices`: the devices of a bench, simulated, in a process of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from hil.cli.options import Bench, option

if TYPE_CHECKING:
    from hil.bench.read import BenchFile


def command(
    bench: Bench,
    quirks: list[str] = option(
        [], "--quirk", "DEVICE.KEY=VALUE", "Misbehaviour on demand, such as io.late_s=0.3; again for more."
    ),
    for_s: float = option(0.0, "--for", "SECONDS", "End after so long; 0: at Ctrl-C."),
) -> None:
    """Serve the devices of a bench, simulated, where its drivers will look for them. Ctrl-C ends it.

    The plant of the bench runs behind them in real time. In another terminal, `hil run … --bench BENCH.toml`
    then drives them as it would drive real ones.
    """
    import threading
    from contextlib import ExitStack, suppress

    from hil.bench.find import find_bench
    from hil.bench.read import read_bench
    from hil.bench.twin import serve
    from hil.safety.interrupt import terminable

    path = find_bench(bench)
    found = read_bench(path)
    with suppress(KeyboardInterrupt), terminable(), ExitStack() as stack:
        for name, served in serve(found, path.parent, _chosen(quirks, found)).items():
            stack.callback(served.close)
            typer.echo(f"{name}: {found.bench.devices[name].driver} at {served.where}")
        typer.echo("simulated; Ctrl-C ends it")
        threading.Event().wait(for_s or None)


def _chosen(quirks: list[str], file: BenchFile) -> dict[str, dict[str, str]]:
    """Quirks by device."""
    from hil.errors import SettingError

    chosen: dict[str, dict[str, str]] = {}
    for text in quirks:
        place, equals, value = text.partition("=")
        device, dot, key = place.partition(".")
        if not equals or not dot or device not in file.devices:
            raise SettingError(f"--quirk {text}: say DEVICE.KEY=VALUE; devices here: {', '.join(file.devices)}")
        chosen.setdefault(device, {})[key] = value
    return chosen
