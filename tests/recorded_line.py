"""What was really asked of a device on Modbus TCP."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from hil.bench.read import BenchFile, read_bench
from tests.observer import Line


class RecordedLine(Line):
    """A TCP port in front of another one; `asked` has every piece that went to the device."""

    @property
    def can_frames(self) -> list[tuple[int, list[int]]]:
        """Identifier and data of what was sent on a bus over socketcand."""
        sent = [words.split() for words in b"".join(self.asked).decode().split("<") if "send " in words]
        return [(int(words[1], 16), [int(byte, 16) for byte in words[3:-1]]) for words in sent]

    @property
    def modbus_functions(self) -> set[int]:
        """The functions that were asked for, as Modbus TCP has them; whole frames are sent at once."""
        found, data = set(), b"".join(self.asked)
        while data:
            length = int.from_bytes(data[4:6], "big")
            found.add(data[7])
            data = data[6 + length :]
        return found


@contextmanager
def recorded(file: BenchFile, port: int) -> Iterator[tuple[BenchFile, RecordedLine]]:
    """A bench file whose device at a port is reached through a line."""
    line = RecordedLine(port)
    path = file.path.with_name("through.toml")
    path.write_text(file.text.replace(f":{port}", f":{line.port}"), encoding="utf-8")
    try:
        yield read_bench(path), line
    finally:
        line.close()
