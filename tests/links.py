"""Benches whose devices are served on real links, in this process, with the plant behind them."""

from __future__ import annotations

import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hil.bench.find import benches
from hil.bench.read import BenchFile, read_bench
from hil.bench.twin import serve


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def moved(text: str, folder: Path) -> str:
    """A bench file with every address at a place of its own: a free port, a name in a folder, a bus of that name."""
    text = re.sub(r"127\.0\.0\.1:\d+", lambda _: f"127.0.0.1:{free_port()}", text)
    return re.sub(r'"(/tmp|virtual:)/?([\w-]+)"', lambda m: f'"{m[1]}{folder.name}-{m[2]}"' if ":" in m[1] else
                  f'"{folder}/{m[2]}"', text)  # fmt: skip


@contextmanager
def served(
    bench: str, folder: Path, *changes: tuple[str, str], quirks: dict[str, dict[str, Any]] | None = None
) -> Iterator[tuple[BenchFile, dict[str, Any]]]:
    """A bench that packages bring along, by name, its text changed, and its devices by name."""
    text = benches()[bench].read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / f"{bench}.toml"
    path.write_text(moved(text, folder), encoding="utf-8")
    file = read_bench(path)
    devices = serve(file, folder, quirks or {})
    try:
        yield file, devices
    finally:
        for device in devices.values():
            device.close()
