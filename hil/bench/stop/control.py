"""`control.json` in a run folder: where the run is stopped, and the tokens that this takes."""

from __future__ import annotations

import hmac
import json
import secrets
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hil.bench.stop.press import StopSwitch
from hil.bench.stop.stop_service import By
from hil.record.durable import write_whole
from hil.system import system

CONTROL_FILE = "control.json"
SCHEMA = "hil.control/1"


@dataclass(frozen=True, slots=True)
class Tokens:
    """Who knows one may ask for what it is for: anybody for a stop, an operator for a hold."""

    stop: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    hold: str = field(default_factory=lambda: secrets.token_urlsafe(32))


@dataclass(frozen=True, slots=True)
class Control:
    """Where a listener is, and in which process.

    Attributes:
        listener: the process.
        urls: where it is reached: on this computer first, then where consoles are reached from others.
        tokens: that it takes.
    """

    listener: By
    urls: tuple[str, ...]
    tokens: Tokens

    @property
    def url(self) -> str:
        """Where it is reached on this computer."""
        return self.urls[0]

    def as_dict(self, run: Path) -> dict[str, Any]:
        """As the file has it."""
        return {
            "schema": SCHEMA, "run": run.absolute().name, "pid": system.pid(), "listener": self.listener,
            "stop_url": f"{self.url}/stop", "token": self.tokens.stop,
            "stop_urls": [f"{url}/stop" for url in self.urls],
            "hold_url": f"{self.url}/hold", "hold_token": self.tokens.hold,
            "started_utc": system.utc().isoformat(timespec="seconds"),
        }  # fmt: skip

    def as_strings(self) -> dict[str, str]:
        """What another process needs to say the same."""
        return {"urls": " ".join(self.urls), "stop": self.tokens.stop, "hold": self.tokens.hold}


def asking(account: str, control: Mapping[str, Any]) -> dict[str, str]:
    """What a request to a listener says of the account that asks, so that the listener can believe it.

    Args:
        account: who is logged in at the console; empty: nobody, and nothing is said.
        control: as the run's control file has it, which this user alone can read.
    """
    token = str(control.get("hold_token", ""))
    return {"account": account, "vouched": vouched(account, token)} if account and token else {}


def vouched(account: str, token: str) -> str:
    """Who knows a token vouches with this for an account."""
    return hmac.new(token.encode(), account.encode(), "sha256").hexdigest()


def control_of(given: Mapping[str, str]) -> Control | None:
    """What a watchdog told of its listener; None when it has none."""
    if "urls" not in given:
        return None
    return Control("watchdog", tuple(given["urls"].split()), Tokens(given["stop"], given["hold"]))


@contextmanager
def published(
    control: Control | None, run: Path, still_needed: Callable[[], bool], note: Callable[..., None]
) -> Iterator[None]:
    """The control file in the run folder while inside, readable by this user alone.

    A run that cannot write it goes on: it says so in an event, and no console shows a button for it. Stop may have been
    pressed before anybody listened: that is asked once the file is there, so that no press falls between the two.

    Args:
        control: where the listener is; None: there is none.
        run: the run folder.
        still_needed: asked afterwards; a watchdog that goes on trying can still be asked what it came to.
        note: takes an event.

    Raises:
        Halted: stop is pressed for the folder in which the run lies.
    """
    path = run / CONTROL_FILE
    if control is not None:
        try:
            write_whole(path, json.dumps(control.as_dict(run), indent=1) + "\n", 0o600)
        except OSError as error:
            note("no stop from a console", why=f"{path}: cannot be written: {error.strerror}")
    try:
        StopSwitch(run.absolute().parent).check()
        yield
    finally:
        if not still_needed():
            withdraw(run)


def withdraw(run: Path) -> None:
    """Take the file away: nobody listens there any more."""
    with suppress(OSError):
        (run / CONTROL_FILE).unlink()
