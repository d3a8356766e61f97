"""Seal truths: their SHA-256 is published before any diagnosis starts, and checked again when it is scored."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path


class BrokenSealError(Exception):
    """A truth is not the one that was published."""


def fingerprint(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def publish(truths: Mapping[str, Path], seals: Path) -> str:
    """Write one line for each truth, as `sha256sum --check` reads them; returns the fingerprint of the list.

    Seals once published stay: a truth that has changed since is refused.
    """
    known = read(seals) if seals.exists() else {}
    for name, path in truths.items():
        found = fingerprint(path)
        if known.setdefault(name, found) != found:
            raise BrokenSealError(f"{path}: sealed as {known[name][:16]}…, now {found[:16]}…")
    seals.write_text("".join(f"{digest}  truth/{name}.json\n" for name, digest in sorted(known.items())))
    return fingerprint(seals)


def read(seals: Path) -> dict[str, str]:
    """Return the published fingerprints by case."""
    lines = (line.split("  truth/") for line in seals.read_text().splitlines())
    return {name.removesuffix(".json"): digest for digest, name in lines}


def verify(path: Path, published: str) -> None:
    """Raise if a truth is not the one that was published."""
    found = fingerprint(path)
    if found != published:
        raise BrokenSealError(f"{path}: sealed as {published[:16]}…, now {found[:16]}…")
