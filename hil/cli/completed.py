"""What a shell offers where a command line is completed: names that are installed, and files where none fits."""

from __future__ import annotations


def procedures_like(incomplete: str) -> list[str]:
    """Installed procedures whose names begin so."""
    from hil.catalog import entries

    return sorted(entry.name for entry in entries("procedures") if entry.name.startswith(incomplete))


def benches_like(incomplete: str) -> list[str]:
    """Installed benches whose names begin so."""
    from hil.bench.find import benches

    return sorted(name for name in benches() if name.startswith(incomplete))
