"""The text of makers' files: register tables, EDS, DCF and DBC."""

from __future__ import annotations


def makers_text(data: bytes) -> str:
    """What stands in a file: UTF-8, else the Windows code page of makers' editors; with plain ends of lines."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")
