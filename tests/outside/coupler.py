"""A WAGO coupler that shares no code with the program, and remembers where its output stood and when."""

from __future__ import annotations

import math
import random
import struct
import threading
import time
from typing import Any

from tests.foreign_line import ForeignLine, Tables, serial_frame
from tests.outside.serial_line import SerialLine

LAG_S = 0.15  # of the flow behind the output: it rises in ln 9 times that
READS = ("as it is", "late now and then", "unsteady", "beyond for 60 ms", "a spike of 60 ms")
FULL, READ_BACK = 0x7FFF, 0x0200
NEAR = 0.6  # % of full scale: nearer than that it stands at its safe value


class Coupler(Tables):
    """Four outputs, read back from 0x0200, and eight noisy inputs that follow the first.

    Args:
        serial: it is on a serial line, else on a network.

    Attributes:
        changes: (time, %) of the first output, each time that it was another one; time is that of the day, in s.
        garbles: answers are spoiled.
        late_s: answers come so much later.
        over: the supply pressure is beyond its limit.
        ignores: writing is acknowledged and moves nothing.
        reads: what is wrong with the flow that is read: a key of `READS`.
    """

    def __init__(self, serial: bool = False) -> None:
        super().__init__(holding=dict.fromkeys([*range(4), *range(READ_BACK, READ_BACK + 4)], 0))
        self.changes: list[tuple[float, float]] = [(time.time(), 0.0)]
        self.garbles = self.over = self.ignores = False
        self.late_s = 0.0
        self.reads, self._asked = READS[0], 0
        self._flow, self._flow_s = 0.0, time.monotonic()
        self._noise, self._lock = random.Random(1), threading.Lock()
        self._serial = serial
        self.line: ForeignLine | SerialLine = (
            SerialLine(self._answer, serial_frame) if serial else ForeignLine(self._answer)
        )

    @property
    def address(self) -> str:
        """Where a program finds it."""
        return f"127.0.0.1:{self.line.port}" if isinstance(self.line, ForeignLine) else self.line.address

    @property
    def percent(self) -> float:
        """Where the first output stands."""
        return self.changes[-1][1]

    def away_s(self, since_s: float) -> float | None:
        """When it was away from zero last, after a moment; None where it never was."""
        ends = [*[at_s for at_s, _ in self.changes[1:]], time.time()]
        away = [end_s for (_, at), end_s in zip(self.changes, ends, strict=True) if abs(at) > NEAR and end_s > since_s]
        return max(away, default=None)

    def poke(self) -> None:
        """Another master puts the output to zero."""
        self.on_tcp(struct.pack(">HHHBBHH", 1, 0, 6, 1, 6, 0, 0))

    def answered(self, request: bytes) -> bytes:
        with self._lock:
            self._measure()
            before = dict(self.holding)
            answer = super().answered(request)
            if self.ignores:
                self.holding = before
            self.holding.update((READ_BACK + i, self.holding[i]) for i in range(4))
            at = 100.0 * struct.unpack(">h", struct.pack(">H", self.holding[0]))[0] / FULL
            if at != self.percent:
                self.changes.append((time.time(), at))
        return answer

    def _answer(self, frame: bytes) -> bytes:
        answer = self.on_serial(frame) if self._serial else self.on_tcp(frame)
        time.sleep(self.late_s + self._delay_s())
        return answer[:8] + self._noise.randbytes(len(answer) - 8) if self.garbles else answer

    def _delay_s(self) -> float:
        self._asked += 1
        late_s = 0.12 if self._asked % 20 == 0 else 0.0
        return {READS[1]: late_s, READS[2]: 0.015 * self._noise.random()}.get(self.reads, 0.0)

    def _read_flow(self) -> float:
        """In % of full scale, behind the output by its lag."""
        now_s = time.monotonic()
        self._flow += (self.percent - self._flow) * -math.expm1((self._flow_s - now_s) / LAG_S)
        self._flow_s = now_s
        is_wrong = 0.9 < time.time() - self.changes[-1][0] < 0.96 and abs(self.percent) > NEAR
        return {READS[3]: 101.0, READS[4]: 97.0}.get(self.reads, self._flow) if is_wrong else self._flow

    def _measure(self) -> None:
        volts = [0.1 * self._read_flow(), 0.08 * self.percent, 8.0 if self.over else 4.0, *[0.0] * 5]
        counts = (round(FULL / 10.0 * (v + self._noise.gauss(0.0, 0.02))) for v in volts)
        self.inputs = dict(enumerate(max(-FULL, min(FULL, count)) & 0xFFFF for count in counts))

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        self.line.close()
