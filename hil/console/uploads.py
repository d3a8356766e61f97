"""Recordings that a browser sends: kept under names of our own, of kinds that are read, up to a size."""

from __future__ import annotations

import re
import secrets
import shutil
from pathlib import Path

from starlette.datastructures import FormData, UploadFile
from starlette.exceptions import HTTPException
from starlette.requests import Request

from hil.errors import SettingError
from hil.record.read import formats

MOST_BYTES = 64 * 1024 * 1024
MOST_FILES = 8
_MOST_FIELDS = 200
_KEPT = 20  # uploads before the oldest is forgotten


async def form_of(request: Request, files: int = 0) -> FormData:
    """The form of a request.

    Args:
        request: of a page.
        files: that it may bring; its size is said beforehand then.

    Raises:
        SettingError: it is malformed, too large, or does not say how large it is.
    """
    length = request.headers.get("content-length", "")
    if files and not length.isdigit():
        raise SettingError("an upload needs its Content-Length")
    if files and int(length) > MOST_BYTES:
        raise SettingError(f"{int(length) / 2**20:.0f} MiB; {MOST_BYTES // 2**20} MiB may be uploaded at a time")
    try:
        form = await request.form(max_files=files, max_fields=_MOST_FIELDS)
    except HTTPException as error:
        raise SettingError(f"the form cannot be read: {error.detail}") from None
    except (ValueError, LookupError) as error:  # of the parser, or a character set that does not exist
        raise SettingError(f"the form cannot be read: {error}") from None
    for name, value in form.multi_items():
        if isinstance(value, str) and "\0" in name + value:  # no name, path or argument of a program has one
            raise SettingError(f"{name!r:.60} holds a null character; text is allowed")
    return form


def kept(files: list[UploadFile], state: Path) -> list[Path]:
    """Write files under plain names into a new folder of their own.

    Raises:
        SettingError: a kind of file that is no recording.
    """
    folder = state / "uploads" / secrets.token_hex(8)
    names = [_plain(file.filename or "") for file in files]
    folder.mkdir(parents=True)
    found = []
    for number, (file, name) in enumerate(zip(files, names, strict=True)):
        path = folder / f"{number}-{name}"
        with path.open("xb") as written:
            shutil.copyfileobj(file.file, written)
        found.append(path)
    _forget(folder.parent)
    return found


def _plain(name: str) -> str:
    """Of a browser's file name the last part, letters and digits; its ending must be that of a recording."""
    last = re.split(r"[/\\]", name)[-1]
    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", last).lstrip(".-")[-80:]
    if not any(plain.lower().endswith(ending) for ending in formats()):
        raise SettingError(f"{last:.60}: no recording by its name; known endings: {', '.join(sorted(formats()))}")
    return plain


def _forget(folder: Path) -> None:
    newest = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime_ns)
    for old in newest[:-_KEPT]:
        shutil.rmtree(old, ignore_errors=True)
