"""What a passport's attachments unpack to, no further than is allowed: 4 MB of a stranger may hold gigabytes."""

from __future__ import annotations

import math
import zlib
from typing import Any

from hil.errors import FileError

STRANGERS_BYTES = 1 << 28
"""What the attachments of a signer who is not known may unpack to, all together: 268 MB."""

_PLAIN, _FLATE = "", "/FlateDecode"


class LargeError(FileError):
    """The attachments unpack to more than is allowed."""


def unpacked(attached: Any, most_bytes: float) -> bytes:
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
