"""Stop and hold as the console's server asks for them, beside the pages: also where no page reaches a run."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from functools import partial
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlencode, urlsplit

from hil.bench.stop.consoles import LOOPBACK
from hil.bench.stop.control import asking
from hil.bench.stop.press import MOST_BYTES, Press
from hil.console.console import Console
from hil.errors import HilError, LinkError

_ANSWER_S = 1.5
_IN_PARALLEL = 8
_THREADS = ThreadPoolExecutor(_IN_PARALLEL, "stop")
_T = TypeVar("_T")


async def promptly(do: Callable[..., _T], *arguments: Any, **named: Any) -> _T:
    """Do it in a thread of its own kind, so that a stop waits for no page."""
    return await asyncio.get_running_loop().run_in_executor(_THREADS, partial(do, *arguments, **named))


def ask_listener(folder: Path, control: Mapping[str, Any], what: str, **fields: str) -> Any:
    """What the listener of a run answers.

    Args:
        folder: of the run.
        control: its control file, as far as it can be read.
        what: `stop` or `hold`.
        fields: sent along.

    Raises:
        LinkError: it has no listener, not on this computer, or it does not answer.
    """
    address = str(control.get(f"{what}_url", ""))
    if not address:
        raise LinkError(f"run {folder.name}: it does not say where it can be asked to {what}")
    try:
        place = urlsplit(address)
        port = place.port
    except ValueError:
        place, port = urlsplit(""), None
    if place.scheme != "http" or place.hostname not in LOOPBACK or port is None:
        raise LinkError(f"run {folder.name}: {what}_url {address:.80}: an address of this computer was expected")
    token = str(control.get("token" if what == "stop" else f"{what}_token", ""))
    line = HTTPConnection(place.hostname, port, timeout=_ANSWER_S)
    try:
        form = {"Content-Type": "application/x-www-form-urlencoded"}
        line.request("POST", f"/{what}", urlencode({"token": token, **fields}), form)
        return json.loads(line.getresponse().read(MOST_BYTES))
    except (OSError, HTTPException, ValueError, RecursionError) as error:
        raise LinkError(f"run {folder.name}: its listener does not answer: {error}") from None
    finally:
        line.close()


def press_stop(console: Console, account: str, asked: Collection[str] = ()) -> dict[str, Any]:
    """Stop every run under way, at its listener or, while it starts, before it drives.

    The switch is pressed first: a run that begins to listen meanwhile heeds it, and one that did so before is found.
    It stays pressed for runs that are starting, until these are over; and where there was nothing to stop, until
    somebody releases it.

    Args:
        console: whose runs.
        account: who is logged in; empty where nobody is.
        asked: runs that the page stops itself; they may have ended by now.

    Returns:
        `pressed`: what stays pressed, or None; `answers` of the listeners and `starting`: runs.

    Raises:
        StorageError: the switch cannot be pressed; what could be stopped was stopped all the same.
    """
    before, fault = console.switch.pressed, None
    pressed = Press(at_utc=datetime.now(UTC), account=account)
    try:
        pressed = console.switch.press(account)
    except HilError as error:
        fault = error
    runs = console.runs(anew=True)
    starting = [
        run["run"] for run in runs if run["run"] in console.starting and run["state"] in ("starting", "running")
    ]
    for name in starting:
        console.end_starting(name, pressed)
    answers = _answers(console, account)
    if fault is not None:
        raise fault
    if starting:
        console.switch.press(account, tuple(starting))
    elif (answers or any(run["run"] in asked for run in runs)) and (before is None or before.runs):
        console.switch.release()
    press = console.switch.pressed
    return {"pressed": press and press.model_dump(mode="json"), "answers": answers, "starting": starting}


def _answers(console: Console, account: str) -> dict[str, Any]:
    """What each listener says to an account, by run."""
    asked = [run for run in console.underway.look() if run.state != "ended" and "stop_url" in run.control]
    with ThreadPoolExecutor(_IN_PARALLEL) as pool:
        answers = pool.map(lambda run: _answer(run.folder, run.control, account), asked)
        return {run.folder.name: answer for run, answer in zip(asked, answers, strict=True)}


def _answer(folder: Path, control: Mapping[str, Any], account: str) -> Any:
    try:
        return ask_listener(folder, control, "stop", **asking(account, control))
    except LinkError as error:
        return {"state": "unconfirmed", "error": str(error)}
