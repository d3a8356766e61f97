"""The pages and their attachments as one PDF/A-3b, by typst."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from hil.errors import InputError, StorageError, reason
from hil.passport.attached import CONTENT_FILE, Attached
from hil.record.plain import plain

STANDARD: Literal["a-3b"] = "a-3b"


def compiled(page: Mapping[str, Any], pictures: Sequence[tuple[str, bytes]], inside: Sequence[Attached],
             content: Mapping[str, Any], place: Path) -> bytes:  # fmt: skip
    """The PDF, not signed yet.

    Args:
        page: what the template shows.
        pictures: (caption, SVG).
        inside: files that it carries.
        content: of `passport.json`, without the list of files.
        place: an empty folder to work in.

    Raises:
        InputError: typst refuses.
        StorageError: the folder cannot be written.
    """
    import typst

    try:
        drawn = [{"caption": caption, "file": f"picture-{i}.svg"} for i, (caption, _) in enumerate(pictures)]
        for one, (_, svg) in zip(drawn, pictures, strict=True):
            (place / one["file"]).write_bytes(svg)
        listed = [one.as_dict() for one in inside]
        write_plain(place / CONTENT_FILE, {**content, "files": listed})
        every = [*inside, Attached(CONTENT_FILE, place / CONTENT_FILE, "data", "what is inside, with checksums")]
        shown = [{**one.as_dict(), "at": _linked(one, place)} for one in every]
        write_plain(place / "page.json", {**page, "pictures": drawn, "files": shown})
        template = files("hil.passport").joinpath("certificate.typ").read_bytes()
        (place / "certificate.typ").write_bytes(template)
        return typst.compile(place / "certificate.typ", root=place, pdf_standards=STANDARD, ignore_system_fonts=True)
    except OSError as error:
        raise StorageError(f"{place}: the passport cannot be made: {error.strerror}") from error
    except RuntimeError as error:
        raise InputError(f"the pages of the passport cannot be set: {reason(error):.300}") from error


def _linked(one: Attached, place: Path) -> str:
    """The file under its name inside, as typst reads it."""
    at = place / one.name
    if at != one.path:
        at.parent.mkdir(parents=True, exist_ok=True)
        at.symlink_to(one.path.resolve())
    return one.name


def write_plain(path: Path, content: Mapping[str, Any]) -> None:
    """Write values as indented JSON."""
    path.write_text(json.dumps(plain(content), ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
