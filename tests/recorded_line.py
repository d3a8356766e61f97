"""What was really asked of a device on Modbus TCP."""

from __future__ import annotations

from tests.observer import Line


class RecordedLine(Line):
    """A TCP port in front of another one; `asked` has every piece that went to the device."""

    @property
    def modbus_functions(self) -> set[int]:
        """The functions that were asked for, as Modbus TCP has them; whole frames are sent at once."""
        found, data = set(), b"".join(self.asked)
        while data:
            length = int.from_bytes(data[4:6], "big")
            found.add(data[7])
            data = data[6 + length :]
        return found
