"""`hil audit`: who moved what on the benches of this computer, and whether a line is missing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from hil.cli.options import Json, option
from hil.cli.printed import printed
from hil.errors import FileError

if TYPE_CHECKING:
    from hil.bench.audit import Link

group = typer.Typer()
_FILE = option(None, "--file", "FILE", "The trail; else that of this account.")
_AT_FRONT = ("utc", "act", "previous")


@group.callback(invoke_without_command=True)
def _audit(
    context: typer.Context,
    file: Path | None = _FILE,
    kept: str = option("", "--head", "SHA256", "A head that was kept elsewhere: is its line still in the trail?"),
    as_json: Json = False,
) -> None:
    """Print the audit trail and check its chain. Exit 1: a line was changed or taken out."""
    if context.invoked_subcommand is not None:
        return
    from hil.bench.audit import chain

    path = _path(file)
    found = list(chain(path)) if path.exists() else []
    about = _head_text(found[-1]) if found else "no lines yet"
    holds = not kept or any(link.sha256 == kept.lower() for link in found)
    words = [_text(link.line) for link in found]
    words += [f"{path}: each line follows the one before it; {about}"]
    if kept:
        words += [f"the line {kept} is {'in it' if holds else 'not in it: the trail is not the one it was'}"]
    document = {"schema": "hil.audit/1", "file": path, "lines": [link.line for link in found]}
    document |= {"head": found[-1].sha256 if found else None, "kept_head_is_in_it": holds if kept else None}
    printed(document, "\n".join(words), as_json)
    raise typer.Exit(0 if holds else 1)


@group.command("head")
def _head(file: Path | None = _FILE, as_json: Json = False) -> None:
    """Print the last line's hash, to be kept where nobody of this computer can change it."""
    import socket

    from hil.bench.audit import head

    path = _path(file)
    found = head(path)
    if found is None:
        raise FileError(f"{path}: there is no line yet, so there is no head")
    document = {"schema": "hil.audit-head/1", "computer": socket.gethostname(), "file": path}
    document |= {"line": found.number, "utc": found.line.get("utc"), "sha256": found.sha256}
    printed(document, f"audit trail of {socket.gethostname()}: {_head_text(found)}", as_json)


def _path(given: Path | None) -> Path:
    from hil.bench.audit import Audit

    if given is not None and not given.is_file():
        raise FileError(f"{given}: there is no such audit trail")
    return given or Audit().path


def _head_text(link: Link) -> str:
    return _one_line(f"line {link.number} of {link.line.get('utc')}: {link.sha256}")


def _text(line: Mapping[str, Any]) -> str:
    """Time, who, act, and everything else that the line says."""
    who = [value for key, value in line.items() if key not in _AT_FRONT and isinstance(value, str) and value]
    if operator := line.get("operator"):
        who[-1] = f"operator {operator}"
    details = line.get("details")
    who = who or ["nobody known"]
    more = [f"{key} {_value(value)}" for key, value in details.items()] if isinstance(details, Mapping) else []
    return _one_line("  ".join([str(line.get("utc", "")), ", ".join(who), str(line.get("act", "")), "; ".join(more)]))


def _value(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _one_line(text: str) -> str:
    """Text of others as text: nothing in it steers the terminal."""
    return "".join(one if one.isprintable() else f"\\x{ord(one):02x}" for one in text)
