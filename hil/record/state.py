"""What is kept between runs: small files in the user's state folder, or in `HIL_STATE_DIR`."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

from hil.errors import storing
from hil.record.durable import sync_folder, write_whole

OWNER_ALONE = 0o600
"""Mode of a file that nobody else reads."""


def state_folder() -> Path:
    """Where all of it lies."""
    return Path(os.environ.get("HIL_STATE_DIR") or platformdirs.user_state_dir("valve-hil"))


def state_path(kind: str, name: str, suffix: str) -> Path:
    """A file that belongs to something of that name."""
    plain = "".join(letter if letter.isalnum() else "-" for letter in name.lower()).strip("-")
    return state_folder() / kind / f"{plain}{suffix}"


def keep(path: Path, content: str, refused: str = "cannot be written", mode: int = 0o666) -> None:
    """Write such a file and its folder, whole or not at all; it outlives a power cut.

    Raises:
        StorageError: what could not be done, as `refused` says it.
    """
    with storing(path, refused):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, content, mode)
        sync_folder(path.parent)
