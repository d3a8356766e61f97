"""The page of diagnosis: a model and recordings in, stages and causes out, the corrected model accepted or tested."""

from __future__ import annotations

import re
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from hil.archive.archive import Search, find_runs
from hil.archive.pending import catch_up
from hil.catalog import base_plant, models
from hil.console import uploads
from hil.console.console import Console
from hil.console.page import file_of, page
from hil.console.routes import jobs
from hil.console.routes.results import REPORT_HEADERS
from hil.console.site import NotHereError
from hil.console.uploads import form_of
from hil.errors import ArchiveError, HilError, SettingError, UnknownNameError
from hil.language.note import revived, translated
from hil.physics.model import load_model
from hil.physics.other_plant import plant_of_run
from hil.record.run_folder.header import read_header, stated
from hil.session.setting import value_text
from hil.untrusted import is_regular, read_untrusted_json

_RUNS = 40
_NAME = re.compile(r"^[A-Za-z0-9][A-Za-z0-9 ._+-]{0,60}$")


def show(request: Request) -> Response:
    """What can be diagnosed, and what was."""
    console, asked = Console.of(request), request.query_params
    known = {name: base_plant(str(path)) for name, path in _models(console).items()}
    runs = {name: _header(console, name) for name in _runs(console)}
    chosen = [runs[name] for name in asked.getlist("run") if name in runs]
    return page(
        request, "diagnose.html", models=known, model=asked.get("model") or _model_for(chosen, known),
        runs={name: plant_of_run(meta) for name, meta in runs.items()}, chosen=asked.getlist("run"),
        done=_done(console),
    )  # fmt: skip


def _header(console: Console, run: str) -> Mapping[str, Any]:
    try:
        return read_header(console.site.run(run)).meta
    except HilError:
        return {}


def _model_for(chosen: Sequence[Mapping[str, Any]], known: Mapping[str, str]) -> str:
    """The model of the valve that was recorded: the one that its bench names, else the only one of its plant."""
    named = {stated(meta, "valve", "plant") for meta in chosen}
    plants = {plant_of_run(meta) for meta in chosen}
    fitting = [name for name in known if {name} == named] or [n for n, plant in known.items() if {plant} == plants]
    return fitting[0] if len(fitting) == 1 else ""


async def begin(request: Request) -> Response:
    """Start a diagnosis, in a process of its own."""
    console, form = Console.of(request), await uploads.form_of(request, uploads.MOST_FILES)
    known = _models(console)
    model = str(form.get("model", ""))
    if not model:
        raise SettingError("a diagnosis needs a nominal model; choose that of the valve that was recorded")
    if model not in known:
        raise UnknownNameError("model", model, known)
    recordings = [console.site.run(str(name)) for name in form.getlist("run")]
    files = [one for one in form.getlist("file") if isinstance(one, UploadFile) and one.filename]
    recordings += await run_in_threadpool(uploads.kept, files, console.site.state) if files else []
    if not recordings:
        raise SettingError("a diagnosis needs at least one recording; choose a run or a file")
    name = console.new_name("diagnosis")
    out = console.site.state / "diagnoses" / name
    out.parent.mkdir(parents=True, exist_ok=True)
    arguments = ["diagnose", *map(str, recordings), "--model", str(known[model]), "--out", str(out)]
    for option in ("input", "output"):
        if channel := str(form.get(option, "")).strip():
            arguments.append(f"--{option}={channel}")
    return jobs.begin(request, "diagnosis", arguments, f"/diagnose/{name}", name)


def one(request: Request) -> Response:
    """A diagnosis: what it says, in short, its report, and what can be done now."""
    console, name = Console.of(request), request.path_params["diagnosis"]
    folder = _folder(console, name)
    diagnosis = read_untrusted_json(folder, "diagnosis.json")
    return page(
        request, "diagnosis.html", name=name, diagnosis=diagnosis,
        stated=lambda *texts: [translated(text) for text in revived(map(str, texts), diagnosis.get("codes"))],
        next_run=_next_run(diagnosis),
        corrected=is_regular(folder, "corrected.json"), accepted=request.query_params.get("accepted", ""),
    )  # fmt: skip


def report(request: Request) -> Response:
    """Its report."""
    folder = _folder(Console.of(request), request.path_params["diagnosis"])
    return file_of(folder, "report.html", "text/html", REPORT_HEADERS)


async def accept(request: Request) -> Response:
    """Take the corrected model among those of this lab, under a name."""
    console, name = Console.of(request), request.path_params["diagnosis"]
    wanted = str((await form_of(request)).get("name", "")).strip()
    await run_in_threadpool(_accept, console, _folder(console, name), wanted)
    console.audit(request, "accept model", {"diagnosis": name, "model": wanted})
    return RedirectResponse(f"/diagnose/{name}?{urlencode({'accepted': wanted})}", 303)


def _accept(console: Console, folder: Path, wanted: str) -> None:
    corrected = folder / "corrected.json"
    if not _NAME.match(wanted) or ".." in wanted:
        raise SettingError(f"name '{wanted:.60}': letters, digits, spaces, and . _ + - are allowed")
    load_model(corrected)
    target = console.site.benches / "models" / f"{wanted}.json"
    if wanted in _models(console):
        raise SettingError(f"name '{wanted}': there is a model of that name; say another")
    target.parent.mkdir(exist_ok=True)
    shutil.copyfile(corrected, target)


def _models(console: Console) -> dict[str, Path]:
    """Models by name: those of this lab, then the installed ones."""
    own = {path.stem: path for path in sorted((console.site.benches / "models").glob("*.json"))}
    return {**own, **{name: path for name, path in models().items() if name not in own}}


def _runs(console: Console) -> list[str]:
    """The newest runs of this console's folder."""
    try:
        catch_up(console.site.place)
        found = find_runs(console.site.place, Search())
    except ArchiveError:
        return []
    here = console.site.runs.resolve()
    return [entry.folder.name for entry in reversed(found) if entry.folder.parent == here][:_RUNS]


def _done(console: Console) -> list[str]:
    folder = console.site.state / "diagnoses"
    return sorted((path.parent.name for path in folder.glob("*/diagnosis.json")), reverse=True)[:20]


def _folder(console: Console, name: str) -> Path:
    folder = console.site.state / "diagnoses" / name
    if not re.fullmatch(r"diagnosis-[0-9T-]+", name) or not is_regular(folder, "diagnosis.json"):
        raise NotHereError(f"no diagnosis '{name:.80}'")
    return folder


def _next_run(diagnosis: dict[str, Any]) -> str:
    """The address at which the proposed test stands in the form of a run; it is driven through the guard like any."""
    test = diagnosis.get("next_test")
    if not test or not test.get("procedure"):
        return ""
    asked = {"procedure": test["procedure"], "why": test.get("why", "")}
    settings = {f"set.{name}": value_text(value) for name, value in (test.get("settings") or {}).items()}
    return f"/run?{urlencode({**asked, **settings})}"


ROUTES = [
    Route("/diagnose", show),
    Route("/diagnose/start", begin, methods=["POST"]),
    Route("/diagnose/accept/{diagnosis}", accept, methods=["POST"]),
    Route("/diagnose/{diagnosis}", one),
    Route("/diagnose/{diagnosis}/report", report),
]
