"""What a passport holds, laid out as files: nothing that it names may lie outside the folder."""

from __future__ import annotations

import io
import math
import zlib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

from hil.errors import FileError, StorageError
from hil.untrusted import UNASKED_BYTES

PAGE_FILE = "passport.pdf"
STRANGERS_BYTES = UNASKED_BYTES
"""What the attachments of a signer who is not known may unpack to, all together: 268 MB."""

_PLAIN, _FLATE = "", "/FlateDecode"


def files_inside(
    content: bytes, most_bytes: float = math.inf, wanted: str = "**"
) -> Iterator[tuple[PurePosixPath, bytes]]:
    """(name, content) of every attachment.

    Args:
        content: of the passport.
        most_bytes: what they may unpack to, all together.
        wanted: a pattern of the names of those that are unpacked; the others are left out.

    Raises:
        LargeError: they unpack to more.
        FileError: not a PDF, or a name that is no path inside a folder.
    """
    import pikepdf

    try:
        pdf = pikepdf.open(io.BytesIO(content))
    except pikepdf.PdfError as error:
        raise FileError(f"the passport cannot be read as PDF: {error}") from None
    with pdf:
        for name, attached in pdf.attachments.items():
            if (place := _inside(name)).match(wanted):
                inside = _unpacked(attached.get_file(), most_bytes)
                most_bytes -= len(inside)
                yield place, inside


def lay_out(content: bytes, folder: Path, most_bytes: float = math.inf) -> list[Path]:
    """Write every attachment and the pages into a folder; returns the run folders.

    Raises:
        LargeError: the attachments unpack to more than `most_bytes` all together; nothing was written.
        FileError: the folder holds something already, or a name leads out of it.
        StorageError: it cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise FileError(f"{folder}: is there already; name a new or empty folder")
    found = list(files_inside(content, most_bytes))  # every name is looked at before the first file is written
    try:
        for name, inside in [*found, (PurePosixPath(PAGE_FILE), content)]:
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("xb") as file:
                file.write(inside)
    except OSError as error:
        raise StorageError(f"{error.filename or folder}: cannot be written: {error.strerror}") from error
    runs = {
        folder / name.parts[0] / name.parts[1] for name, _ in found if name.parts[0] == "runs" and len(name.parts) > 2
    }
    return sorted(runs)


def _inside(name: str) -> PurePosixPath:
    parts = name.split("/")
    if any(part in ("", ".", "..") for part in parts) or not name.isprintable() or set(name) & set('\\:*?"<>|'):
        raise FileError(
            f"the passport names a file {name!r:.80}, which is no path inside a folder; nothing was written"
        )
    return PurePosixPath(*parts)


class LargeError(FileError):
    """The attachments unpack to more than is allowed."""


def _unpacked(attached: Any, most_bytes: float) -> bytes:
    """The content of an attachment of pikepdf.

    Raises:
        LargeError: it is larger than `most_bytes`; no more than that was unpacked.
        FileError: it is packed in a way that no passport of this program is.
    """
    stream = attached.obj
    ways = stream.get("/Filter", _PLAIN)
    found = bytes(stream.read_raw_bytes())
    for way in [_PLAIN] if not str(ways) else [ways] if str(ways).startswith("/") else list(ways):
        if str(way) == _FLATE:
            found = _inflated(found, most_bytes)
        elif str(way) != _PLAIN:
            raise FileError(f"the passport has an attachment packed as {way!s:.40}; none of this program is")
    if len(found) > most_bytes:
        raise LargeError(_sentence(most_bytes))
    return found


def _inflated(packed: bytes, most_bytes: float) -> bytes:
    try:
        found = zlib.decompressobj().decompress(packed, 0 if math.isinf(most_bytes) else int(most_bytes) + 1)
    except zlib.error as error:
        raise FileError(f"the passport has an attachment that does not unpack: {error}") from None
    if len(found) > most_bytes:
        raise LargeError(_sentence(most_bytes))
    return found


def _sentence(most_bytes: float) -> str:
    return f"its files unpack to more than {most_bytes / 1e6:.4g} MB"
