"""The page on which a run is prepared: unit, operator, procedure, settings; rehearse, then start."""

from __future__ import annotations

import datetime as dt
import math
import shutil
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from hil.bench.protection import envelopes_of
from hil.bench.protection_coverage.calibration import overdue
from hil.bench.read import BenchFile
from hil.catalog import entries
from hil.console.console import Console
from hil.console.envelope import COARSE_KEPT, FINE_S, Envelope
from hil.console.form import NOTES, faults_of, fields_of, given_of, setting_named_in
from hil.console.page import keep_bench, kept_bench, page
from hil.console.process import Started
from hil.console.routes.results import searched
from hil.console.uploads import form_of
from hil.errors import HilError, InUseError, SettingError
from hil.record.folder import read
from hil.report.number import number, unit_text
from hil.session.labels import labelled, labels_of, new_folder
from hil.session.limit import checked_limits, split_limits
from hil.session.preset import DEFAULT, preset_names, preset_settings
from hil.session.procedure import Procedure, load_procedure
from hil.session.rehearsal import is_of_rehearsal
from hil.session.setting import value_text

_HAND = "jog"  # moves one output by hand from the command line; not a test of a unit
_FIRST = "frequency_response"
_MOST_UNITS = 20


def show(request: Request) -> Response:
    """The form of a procedure on a bench, filled with what the address says."""
    console, asked = Console.of(request), request.query_params
    files = list(console.site.bench_files())
    procedure = load_procedure(asked.get("procedure") or _FIRST)
    given = {key.removeprefix("set."): value for key, value in asked.items() if key.startswith("set.")}
    bench = asked.get("bench") or kept_bench(request, files) or next(iter(files), "")
    file = _file(console, bench)
    presets, preset = _presets(file, procedure, asked.get("preset", "")) if file else ([], {})
    given = {**preset, **given}
    fields = [{**asdict(field), "value": given.get(field.name, field.default)} for field in fields_of(procedure)]
    shown = page(
        request, "run.html", benches=files, bench=bench, allowed=_allowed(file) if file else [],
        overdue=[*overdue(file.bench, dt.date.today())] if file else [], today=_today(console), notes=NOTES,
        asked=asked, measured=[one.name for one in procedure.measurements],
        procedures=_listed(), procedure=procedure, fields=fields,
        presets=presets, preset=asked.get("preset") or DEFAULT, serial=asked.get("serial", ""),
        operator=asked.get("operator", ""), why=asked.get("why", ""),
    )  # fmt: skip
    return keep_bench(shown, bench)


def _file(console: Console, bench: str) -> BenchFile | None:
    """The bench; None where its file cannot be read."""
    try:
        return console.site.bench(bench)
    except HilError:
        return None


def _presets(file: BenchFile, procedure: Procedure, name: str) -> tuple[list[str], dict[str, str]]:
    """The presets of a bench for a procedure, and the settings of one as they would be typed."""
    names = preset_names(file, procedure)
    found = preset_settings(file, procedure, name if name in names else "")
    return names, {setting: value_text(value) for setting, value in found.items()}


def _allowed(file: BenchFile) -> list[str]:
    """The range of each output of a bench, as its file has it."""
    return [
        f"{name} {number(limits.low, 6)} … {number(limits.high, 6)} {unit_text(file.bench.channels[name].unit)}"
        for name, limits in envelopes_of(file.bench).items()
    ]


def _today(console: Console) -> list[dict[str, str | None]]:
    """The units that were tried today, each with its last run, the newest first."""
    found, _fault = searched(console, since=dt.date.today().isoformat())
    newest = {entry.serial: entry for entry in reversed(found)}
    return [
        {"serial": serial, "verdict": entry.verdict, "run": entry.folder.name}
        for entry in found if (serial := entry.serial) and newest[serial] is entry
    ][:_MOST_UNITS]  # fmt: skip


async def check(request: Request) -> Response:
    """What is wrong with the form as it stands: by setting, in words."""
    form = await _form(request)
    procedure = load_procedure(form.get("procedure", ""))
    faults = faults_of(procedure, given_of(procedure, form))
    try:
        _limits(procedure, form)
    except SettingError as error:
        faults["limits"] = str(error)
    return JSONResponse({"faults": faults})


def _limits(procedure: Procedure, form: Mapping[str, str]) -> list[str]:
    """The limits that were typed, one a line. Raises `SettingError` for one that cannot be taken."""
    found = [line.strip() for line in form.get("limits", "").splitlines() if line.strip()]
    checked_limits(procedure.measurements, split_limits(found))
    return found


async def begin_rehearsal(request: Request) -> Response:
    """Play the procedure on the simulated valve, in a process of its own."""
    console, form = Console.of(request), await _form(request)
    return JSONResponse(await run_in_threadpool(_begin_rehearsal, console, form))


def rehearsal(request: Request) -> Response:
    """How a rehearsal stands; when it is over, what would be driven, against the envelope."""
    console, name = Console.of(request), request.path_params["name"]
    made = console.started.get(name)
    if made is None or not name.startswith("rehearsal-"):
        raise SettingError(f"no rehearsal '{name:.60}'; rehearse again")
    if made.exit_status is None:
        return JSONResponse({"state": "running", "text": made.last_line})
    procedure = load_procedure(request.query_params.get("procedure", ""))
    if made.exit_status:
        text = made.last_line
        return JSONResponse({"state": "refused", "text": text, "setting": setting_named_in(procedure, text)})
    file = console.site.bench(request.query_params.get("bench", ""))
    return JSONResponse({"state": "rehearsed", "text": _message(made), **_planned(_kept(console, name), file)})


async def begin(request: Request) -> Response:
    """Start the run, in a process of its own; answers with its name."""
    console, form = Console.of(request), await _form(request)
    folder, about, arguments = await run_in_threadpool(_prepared, console, form)
    # before anything moves: what cannot be written down is not done; that it drives, the run writes itself
    console.audit(request, "ask for a run", about, operator=form.get("operator", "").strip())
    await run_in_threadpool(console.begin_run, arguments, folder.name, request.scope.get("hil.account", ""))
    return JSONResponse({"run": folder.name})


def _begin_rehearsal(console: Console, form: Mapping[str, str]) -> dict[str, str]:
    procedure, _file, arguments = _run_asked(console, form)
    name = console.new_name("rehearsal")
    folder = _kept(console, name)
    shutil.rmtree(folder.parent, ignore_errors=True)  # those before it
    folder.parent.mkdir(parents=True, exist_ok=True)
    console.start([*arguments, "--rehearse-only", "--out", str(folder)], name)
    return {"rehearsal": name, "procedure": procedure.name}


def _prepared(console: Console, form: Mapping[str, str]) -> tuple[Path, dict[str, Any], list[str]]:
    """The folder of a run that may begin, what the audit trail says of it, and its arguments."""
    procedure, file, arguments = _run_asked(console, form)
    if not file.is_simulated and (driving := console.run_on(file.bench.name)) is not None:
        raise InUseError(f"bench '{file.bench.name}': run {driving.folder.name} drives it now", None)
    if (press := console.switch.pressed) is not None:
        raise SettingError(console.switch.text(press))
    console.watching.end(form["bench"])
    console.site.runs.mkdir(parents=True, exist_ok=True)
    folder = new_folder(console.site.runs, procedure.name, form.get("serial", "").strip(), console.started)
    about = {"run": folder.name, "bench": file.bench.name, "arguments": arguments}
    return folder, about, [*arguments, "--out", str(folder)]


def _kept(console: Console, name: str) -> Path:
    return console.site.state / "rehearsals" / name


def _run_asked(console: Console, form: Mapping[str, str]) -> tuple[Procedure, BenchFile, list[str]]:
    """The procedure, its bench, and the arguments of `hil` for it.

    Raises:
        SettingError, UnknownNameError, BenchError: something in the form cannot be taken.
    """
    procedure = load_procedure(form.get("procedure", ""))
    path = console.site.bench_path(form.get("bench", ""))
    file = console.site.bench(form.get("bench", ""))
    given = given_of(procedure, form)
    for name, why in faults_of(procedure, given).items():
        raise SettingError(f"setting {name}: {why}")
    notes = [f"{name}={text}" for name, _ in NOTES if (text := form.get(f"note.{name}", "").strip())]
    labels = labels_of(form.get("serial", ""), form.get("operator", ""), notes)
    labelled(file, procedure, labels)  # refuses here what the run itself would refuse: a certificate of no unit
    arguments = ["run", procedure.name, "--bench", str(path), *(f"--set={n}={value}" for n, value in given.items())]
    arguments += [f"--serial={labels.serial}"] if labels.serial else []
    arguments += [f"--operator={labels.operator}"] if labels.operator else []
    arguments += [f"--note={name}={text}" for name, text in labels.notes.items()]
    arguments += [f"--limit={text}" for text in _limits(procedure, form)]
    return procedure, file, arguments


async def _form(request: Request) -> dict[str, str]:
    return {key: value for key, value in (await form_of(request)).items() if isinstance(value, str)}


def _listed() -> list[tuple[str, str]]:
    """Each procedure with the first line that says what it is."""
    found = []
    for entry in entries("procedures"):
        try:
            found.append((entry.name, load_procedure(entry.name).doc.splitlines()[0]))
        except (HilError, IndexError):
            found.append((entry.name, ""))
    return [(name, doc) for name, doc in found if name != _HAND]


def _message(made: Started) -> str:
    return " ".join(line.strip() for line in made.lines if is_of_rehearsal(line))


def _planned(folder: Path, file: BenchFile) -> dict[str, Any]:
    """The outputs of a rehearsal over its time, with the limits in force."""
    recording = read(folder)
    envelopes = envelopes_of(file.bench)
    found = []
    for name, entry in file.bench.channels.items():
        if not entry.is_output or name not in recording.channels:
            continue
        drawn = Envelope(1, FINE_S, COARSE_KEPT, merges=True)
        drawn.take(recording.time_s, recording.channels[name].values[None, :])
        picture, limits = drawn.since(-math.inf), envelopes.get(name)
        found.append({"name": name, "unit": entry.unit, "t": picture["t"],
                      "low": picture["low"][0], "high": picture["high"][0],
                      "limits": [limits.low, limits.high] if limits else None})  # fmt: skip
    return {"seconds": recording.duration_s, "outputs": found}


ROUTES = [
    Route("/run", show),
    Route("/run/check", check, methods=["POST"]),
    Route("/run/rehearse", begin_rehearsal, methods=["POST"]),
    Route("/run/rehearsal/{name}", rehearsal),
    Route("/run/start", begin, methods=["POST"]),
]
