"""`hil check`: every fault of a bench file at once."""

from __future__ import annotations

import shlex
from dataclasses import replace
from typing import TYPE_CHECKING

import typer

from hil.cli.options import Archive, Bench, Json, option
from hil.cli.printed import printed
from hil.errors import FileError, LinkError

if TYPE_CHECKING:
    from hil.bench.device import DeviceInUse
    from hil.bench.read import BenchFile
    from hil.safety.outputs import Outputs

_REFERENCE = "bench_reference"


def command(
    bench: Bench,
    strict: bool = option(False, "--strict", help="Exit status 2 also when there are warnings."),
    live: bool = option(
        False, "--live", help="Read every input too: delays, rates, noise, and what can be measured here."
    ),
    reference: str = option(
        "",
        "--reference",
        "SN",
        "Drive a known valve or a loop-back for two minutes; exit status 1 where it differs from its first time.",
    ),
    archive: Archive = "",
    as_json: Json = False,
) -> None:
    """Check a bench file: every fault with its line, every missing protection, and what to do about it.

    Nothing is driven, unless by --reference.
    """
    from datetime import UTC, datetime

    from hil.bench.find import find_bench
    from hil.bench.protection_coverage.missing import missing_protection
    from hil.bench.read import read_bench
    from hil.cli.faults import each_reported
    from hil.session.stated_for_procedures import check_stated

    if live and reference:
        raise typer.BadParameter("drives the bench; --live reads it: one after the other", param_hint="--reference")
    path = find_bench(bench)
    with each_reported(path, as_json=as_json):
        found = read_bench(path)
        check_stated(found)
    warnings = missing_protection(found, datetime.now(UTC).date())
    if not as_json:
        typer.echo("\n".join([*_described(found), *(f"warning: {text}" for text in warnings)]))
    elif not live and not reference:
        printed(_document(found, warnings), "", as_json)
    if live:
        warnings += _looked_at(found, as_json)
    if strict and warnings:
        raise FileError(f"{path}: {len(warnings)} warning{'s' if len(warnings) > 1 else ''}, and --strict allows none")
    if reference:
        _held_against_first(found, reference, archive, as_json=as_json)


def _looked_at(found: BenchFile, as_json: bool) -> list[str]:
    """What can be measured on the bench, printed; returns what is not plausible about it."""
    from hil.bench.manual.live import look_at
    from hil.catalog import entries
    from hil.cli.live import print_live
    from hil.safety.interrupt import terminable
    from hil.session.feasibility import infeasibility
    from hil.session.procedure import load_procedure

    with terminable():
        seen = look_at(found)
        names = [entry.name for entry in entries("procedures")]
        away = " and ".join(seen.silent)
        infeasible = {
            name: f"{away} must answer first" if away else infeasibility(load_procedure(name), found, seen.rate_hz)
            for name in names
        }
    print_live(found, seen, infeasible, as_json)
    if seen.silent:
        raise LinkError("; ".join(seen.silent.values()))
    return list(seen.remarks)


def _held_against_first(bench: BenchFile, serial: str, archive: str, *, as_json: bool) -> None:
    """Run the procedure and compare; leaves with status 1 where a figure differs from that of the first run."""
    from hil import api
    from hil.archive.place import DEFAULT_FOLDER
    from hil.cli.commands.compare import print_comparison
    from hil.cli.progress import shown
    from hil.cli.run_end import entered, safely
    from hil.cli.searches import not_entered
    from hil.session.labels import new_folder
    from hil.session.previous_run import is_here
    from hil.session.run_comparison import compare_runs

    folder = new_folder(DEFAULT_FOLDER, _REFERENCE, serial)

    def run(output_states: Outputs) -> None:
        with shown() as progress:
            api.run(_REFERENCE, bench, folder, serial=serial, progress=progress, outputs=output_states, archive=archive)

    safely(run, folder, archive, as_json=as_json)
    entered(archive, folder)
    found = api.find_runs(serial=serial, procedure=_REFERENCE, archive=archive, values=False, notes=not_entered)
    others = (one for one in found if one.bench == bench.bench.name and one.outcome == "completed" and is_here(one))
    first = next((one.folder for one in others if one.folder != folder.resolve()), None)
    if first is None:
        printed({"schema": "hil.run-comparison/1", "runs": [folder.name], "differences": []}, "", as_json)
        typer.echo(f"{folder}: the first on this bench; those that come are held against it", err=as_json)
        return
    comparison = compare_runs(first, folder)
    print_comparison(comparison, as_json)
    trend = f"hil trend NAME --serial {shlex.quote(serial)} --procedure {_REFERENCE}"
    typer.echo(f"held against {first}; over time: {trend}", err=as_json)
    if any(one.meaning == "differs" for one in comparison.differences):
        raise typer.Exit(1)


def _document(found: BenchFile, warnings: list[str]) -> dict[str, object]:
    from hil.bench.protection import emergency_stops

    bench = found.bench
    channels = [
        {"name": name, "terminal": entry.terminal, "role": entry.role, "unit": entry.unit, "range": _range(found, name),
         "limits": [entry.limits.low, entry.limits.high] if entry.limits else None,
         "safe": entry.safe if entry.limits else None}
        for name, entry in bench.channels.items()
    ]  # fmt: skip
    interlocks = [{"name": name, "action": entry.action} for name, entry in bench.interlocks.items()]
    interlocks += [{"name": lock.name, "action": lock.action} for lock in emergency_stops(bench)]
    document = {
        "file": found.path,
        "bench": bench.name,
        "valve": bench.valve.name,
        "sample_rate_hz": bench.sample_rate_hz,
    }
    lists: dict[str, object] = {"channels": channels, "interlocks": interlocks, "late_s": _late_s(found),
             "read_back_requests_per_s": _read_backs_per_s(found), "warnings": warnings}  # fmt: skip
    return {"schema": "hil.check/1", **document, **lists}


def _range(found: BenchFile, name: str) -> tuple[float, float]:
    """What a channel can show, in its unit."""
    entry = found.bench.channels[name]
    terminal = found.terminal_of(entry)
    low, high = entry.range_at(terminal)
    return low, high


def _links(found: BenchFile) -> dict[str, DeviceInUse]:
    """The devices that drive outputs over a link."""
    from hil.bench.device import mixes
    from hil.bench.protection_coverage.devices import driving

    return {name: device for name, device in driving(found) if mixes(device.module)}


def _late_s(found: BenchFile) -> dict[str, float]:
    """For each of them, how late what was sent to it may arrive."""
    return {name: device.late_s for name, device in _links(found).items()}


def _read_backs_per_s(found: BenchFile) -> dict[str, float]:
    """For each of them, requests a second at most by which outputs are read back while they are driven."""
    from hil.daq.device_link import READ_BACK_EVERY_S

    per_s = {}
    for name, device in _links(found).items():
        wiring, module = device.wiring(found.bench.channels), device.module
        silent = getattr(module, "not_read_back", lambda _settings: ())(device.settings)
        asked = {key: output for key, output in wiring.outputs.items() if output.terminal not in silent}
        requests = getattr(module, "read_back_requests", lambda wiring: len(wiring.outputs))
        per_s[name] = requests(replace(wiring, outputs=asked)) / READ_BACK_EVERY_S
    return per_s


def _read_back_text(per_s: float, rate_hz: float) -> str:
    if not per_s:
        return "no requests to read outputs back while driving"
    return f"at most {per_s:g} requests a second to read outputs back while driving, beside samples at {rate_hz:g} Hz"


def _described(found: BenchFile) -> list[str]:
    from hil.bench.protection import emergency_stops
    from hil.units import behind_a_number

    bench = found.bench
    lines = [f"{found.path}: no faults", f"{bench.name}: {bench.valve.name}, {bench.sample_rate_hz:g} Hz"]
    for name, entry in bench.channels.items():
        low, high = _range(found, name)
        limits = entry.limits
        allowed = f", limits {limits.low:g} … {limits.high:g}, safe at {entry.safe:g}" if limits else ""
        allowed += f", witness {entry.witness}" if entry.witness else ""
        role = "" if entry.role == "other" else f" ({entry.role})"
        lines.append(f"  {entry.terminal:5} {name}{role}: {low:g} … {high:g}{behind_a_number(entry.unit)}{allowed}")
    lines += [f"  {name}: late_s = {late_s:g}, the longest that a lost command may be on its way"
              for name, late_s in _late_s(found).items()]  # fmt: skip
    lines += [f"  {name}: {_read_back_text(per_s, bench.sample_rate_hz)}"
              for name, per_s in _read_backs_per_s(found).items()]  # fmt: skip
    lines += [f"  {entry.action:8} {name}" for name, entry in bench.interlocks.items()]
    lines += [f"  {lock.action:8} {lock.name}: pressed below {lock.allowed.low:g}" for lock in emergency_stops(bench)]
    return lines
