"""`hil list`: what is installed, one line each."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import typer

from hil.catalog import KINDS, entries, models, tables
from hil.cli.options import Json, argument
from hil.errors import UnknownNameError

_FILES = ("benches", "descriptions", "models", "tables")


def command(
    kind: str = argument("", "KIND", "Only this kind, such as plants."),
    as_json: Json = False,
) -> None:
    """List the installed drivers, devices, procedures, plants, effects, benches, descriptions, models and tables."""
    if kind and kind not in (*KINDS, *_FILES):
        raise UnknownNameError("kind of entry", kind, (*KINDS, *_FILES))
    kinds = [known for known in (*KINDS, *_FILES) if kind in ("", known)]
    if as_json:
        listed = {name: [{"name": entry, "summary": summary} for entry, summary in _lines(name)] for name in kinds}
        typer.echo(json.dumps({"schema": "hil.installed/1", **listed}, indent=1, ensure_ascii=False))
        return
    for name in kinds:
        if not kind:
            typer.echo(f"{name}:")
        found = dict(_lines(name))
        width = max(map(len, found), default=0)
        for entry, summary in found.items():
            typer.echo(f"{'' if kind else '  '}{entry:{width}}  {summary}".rstrip())


def _lines(kind: str) -> Iterator[tuple[str, str]]:
    """(name, what it is) of every entry of a kind."""
    if kind == "benches":
        from hil.bench.find import benches

        yield from ((name, _first_words(path, "name = ")) for name, path in benches().items())
    elif kind == "descriptions":
        from hil.description.find import descriptions

        yield from ((name, _first_words(path, "summary = ")) for name, path in descriptions().items())
    elif kind == "models":
        yield from ((name, _first_words(path, '"title": ')) for name, path in models().items())
    elif kind == "tables":
        yield from ((name, str(path)) for name, path in tables().items())
    else:
        yield from ((entry.name, entry.summary) for entry in entries(kind))  # type: ignore[arg-type]


def _first_words(path: Path, key: str) -> str:
    """What stands behind the first occurrence of a key, read as text: listing opens nothing else."""
    with path.open(encoding="utf-8") as file:
        line = next((line for line in file if line.strip().startswith(key)), "")
    return line.strip().removeprefix(key).strip().rstrip(",").strip('"')
