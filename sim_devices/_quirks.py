"""What real devices do that a data sheet does not promise: late, silent, garbled … answers, on demand."""

from __future__ import annotations

import math
import random

from pydantic import Field, PositiveFloat

from hil.strict import Strict


class Quirks(Strict):
    """Misbehaviour on demand. It begins `after` so many answers and lasts for `answers` of them.

    Attributes:
        late_s: an answer comes so much later.
        silent: it does not come at all.
        garbled: one bit of it is flipped.
        cut: only its first half comes.
        again: the answer before comes once more, a moment ahead of it.
        word_order: the words of floating-point numbers come in the other order.
        not_a_number: inputs read NaN (0 where the protocol has none).
        stuck: inputs keep their last value.
        frozen: outputs stay where they are, whatever they are told; the device agrees to everything.
        sticks: the valve stays where it is when its output goes to its safe value; the device itself obeys.
        reboot: instead of an answer the device starts anew: outputs at their power-on values, no watchdog armed.
        baud: the line carries so many bits a second, ten for each byte; always on.
        after, answers: when it begins, and for how many answers; without end if not given.
    """

    late_s: float = Field(default=0.0, ge=0.0)
    silent: bool = False
    garbled: bool = False
    cut: bool = False
    again: bool = False
    word_order: bool = False
    not_a_number: bool = False
    stuck: bool = False
    frozen: bool = False
    sticks: bool = False
    reboot: bool = False
    baud: PositiveFloat | None = None
    after: int = Field(default=0, ge=0)
    answers: int | None = Field(default=None, ge=1)


class Behaviour:
    """Quirks as they happen, answer by answer. `quirks` may be exchanged while the device runs."""

    def __init__(self, quirks: Quirks) -> None:
        self._bits = random.Random(1)  # repeatable, not secret
        self.quirks = quirks

    @property
    def quirks(self) -> Quirks:
        """Those in force."""
        return self._quirks

    @quirks.setter
    def quirks(self, quirks: Quirks) -> None:
        self._quirks, self._answers = quirks, 0

    def next_answer(self) -> Quirks:
        """Those that apply to the next answer."""
        quirks, number = self._quirks, self._answers
        self._answers += 1
        last = math.inf if quirks.answers is None else quirks.after + quirks.answers
        return quirks if quirks.after <= number < last else Quirks(baud=quirks.baud)

    def mangled(self, answer: bytes, quirks: Quirks) -> bytes:
        """An answer as the line delivers it."""
        if quirks.silent or quirks.reboot or not answer:
            return b""
        if quirks.cut:
            return answer[: len(answer) // 2]
        if quirks.garbled:
            bit = self._bits.randrange(8 * len(answer))
            flipped = answer[bit // 8] ^ (1 << bit % 8)
            return answer[: bit // 8] + bytes([flipped]) + answer[bit // 8 + 1 :]
        return answer
