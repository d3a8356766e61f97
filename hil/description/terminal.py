"""What every description says of a terminal, and rows of terminals that are alike."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Annotated, Generic, Self, TypeVar

from pydantic import AfterValidator, Field, FiniteFloat, field_validator, model_validator

from hil.daq.calibration import Scale
from hil.daq.channel import Direction, Kind, Terminal
from hil.errors import UnitError
from hil.strict import Strict
from hil.units import check_unit

_KINDS: Mapping[str, Kind] = {"V": "voltage", "mV": "voltage", "A": "current", "mA": "current"}
_NUMBER = "{n}"


def _are_counts(given: dict[str, str]) -> dict[str, str]:
    for text in given:
        if text.lower() != "nan" and not re.fullmatch(r"0[xX][0-9a-fA-F]+|-?\d+", text):
            raise ValueError(f'\'{text}\' is no count: a number such as "0x8000" or "-9999", or "nan"')
    return given


Invalid = Annotated[dict[str, str], AfterValidator(_are_counts)]
"""Counts that are no measurement, as a device says them, and what they mean; `nan` too."""


def counts_of(invalid: Mapping[str, str]) -> dict[int, str]:
    """Those that are whole numbers."""
    return {int(count, 0): means for count, means in invalid.items() if count.lower() != "nan"}


def nan_of(invalid: Mapping[str, str]) -> str:
    """What a number that is none means; empty where that is not said."""
    return next((means for count, means in invalid.items() if count.lower() == "nan"), "")


class DescribedTerminal(Strict):
    """A terminal, or `count` of them that are alike, with `{n}` in the name.

    Attributes:
        direction: `in` is read, `out` is driven.
        unit: of its values, `range` included; `1` for what has none.
        range: the lowest and highest value that it takes or reads.
        kind: as in `hil.daq.channel.Terminal`; by the unit if not given, volts and amperes being terminals of an I/O
            module and all else a value that the device measures by itself.
        over: how far beyond its range an input still measures, as a share of the span.
        close: how far an output may stand from where it was driven, in `unit`; for what is written exactly, 0.
        count: how many there are of it; `first` is the number of the first.
    """

    direction: Direction
    unit: str = "1"
    range: tuple[FiniteFloat, FiniteFloat]
    kind: Kind | None = None
    over: float = Field(0.0, ge=0.0, le=1.0)
    close: float | None = Field(None, ge=0.0)
    count: int = Field(1, ge=1, le=4096)
    first: int = Field(0, ge=0)

    @field_validator("unit")
    @classmethod
    def _unit(cls, given: str) -> str:
        try:
            check_unit(given)
        except UnitError as error:
            raise ValueError(str(error)) from None
        return given

    @field_validator("range")
    @classmethod
    def _ordered(cls, given: tuple[float, float]) -> tuple[float, float]:
        if given[0] >= given[1]:
            raise ValueError(f"low {given[0]:g} must be below high {given[1]:g}")
        return given

    @property
    def terminal(self) -> Terminal:
        """As a bench connects to it."""
        low, high = self.range
        return Terminal(self.direction, self.is_of, self.unit, low, high, self.over)

    @property
    def is_of(self) -> Kind:
        """Its kind, said or by its unit."""
        return self.kind or _KINDS.get(self.unit, "value")

    @property
    def is_read_back(self) -> bool:
        """Whether the device can be asked where an output stands."""
        return True

    def of_row(self, i: int) -> Self:
        """The terminal `i` of a row, from 0, by itself."""
        return self.model_copy(update={"count": 1, "first": self.first + i})


class ScaledTerminal(DescribedTerminal, Scale):
    """A terminal whose values are slope · number + offset, the number as the device has it."""

    slope: FiniteFloat = 1.0
    offset: FiniteFloat = 0.0

    @field_validator("slope")
    @classmethod
    def _not_flat(cls, given: float) -> float:
        if given == 0.0:
            raise ValueError("0 makes every reading the same")
        return given


class PartTerminal(ScaledTerminal):
    """A terminal in a count of the device, or in a part of one.

    Attributes:
        bit, bits: the bit, or lowest and highest bit, of what holds more than this.
        invalid: counts that are no measurement, and what they mean; `nan` too.
    """

    bit: int | None = Field(None, ge=0, le=63)
    bits: tuple[int, int] | None = None
    invalid: Invalid = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_part(self) -> Self:
        if self.bit is not None and self.bits is not None:
            raise ValueError("bit or bits, not both")
        return self

    @property
    def is_of(self) -> Kind:
        """Its kind; one bit is digital where nothing else is said."""
        return "digital" if self.kind is None and self.bit is not None else super().is_of

    @property
    def field(self) -> tuple[int, int] | None:
        """Lowest bit and number of bits, of what does not fill its count."""
        if self.bit is not None:
            return self.bit, 1
        return None if self.bits is None else (self.bits[0], self.bits[1] - self.bits[0] + 1)


def each(name: str, terminal: DescribedTerminal) -> Iterator[tuple[str, int]]:
    """The names of the terminals that an entry stands for, and the place of each among them."""
    for i in range(terminal.count):
        yield name.replace(_NUMBER, str(terminal.first + i)), i


class Flagged(Strict):
    """A bit, or a whole count, that tells something: it is so when the masked value is `equals`.

    Attributes:
        bit: of the count, 0 is the lowest.
        mask: bits that are looked at, where it is more than one.
        equals: what they are when it is so; not 0 if not given.
        means: in words.
    """

    bit: int | None = Field(None, ge=0, le=31)
    mask: int | None = Field(None, ge=1, le=0xFFFFFFFF)
    equals: int | None = Field(None, ge=0, le=0xFFFFFFFF)
    means: str = ""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.bit is not None and self.mask is not None:
            raise ValueError("bit or mask, not both")
        if self.bit is not None and (self.equals or 0) > 1:
            raise ValueError("a bit equals 0 or 1")
        return self

    @property
    def highest_bit(self) -> int:
        """That is looked at."""
        return max(self.bit or 0, (self.mask or 0).bit_length() - 1)

    def is_so(self, count: int) -> bool:
        """Whether a count says it."""
        seen = count >> self.bit & 1 if self.bit is not None else count & (self.mask or 0xFFFFFFFF)
        return bool(seen) if self.equals is None else seen == self.equals


_T = TypeVar("_T", bound=DescribedTerminal)


class DescribedDevice(Strict, Generic[_T]):
    """What every description says of its device.

    Attributes:
        summary: what it is, in one line.
        source: the manual or file that it comes from, and its edition.
    """

    summary: str
    source: str = ""
    terminals: dict[str, _T] = Field(min_length=1)

    @cached_property
    def by_name(self) -> dict[str, _T]:
        """Every terminal by its own name, rows laid out."""
        return {one: terminal.of_row(i) for name, terminal in self.terminals.items() for one, i in each(name, terminal)}

    @property
    def ports(self) -> dict[str, Terminal]:
        """What a bench can connect to."""
        return {name: terminal.terminal for name, terminal in self.by_name.items()}

    @property
    def outputs(self) -> list[str]:
        """Names of outputs."""
        return [one for name, t in self.terminals.items() if t.direction == "out" for one, _ in each(name, t)]

    def needless(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Sections about outputs, where there is none."""
        for section in ("watchdog", "safe_mode", "enable"):
            if getattr(self, section, None) is not None and not self.outputs:
                yield (section,), "there is no output that it could be for; take this away"


def name_faults(terminals: Mapping[str, DescribedTerminal]) -> Iterator[tuple[tuple[str, ...], str]]:
    """A row without a number in its name, one alone with it, a name that stands twice."""
    seen: set[str] = set()
    for name, terminal in terminals.items():
        if terminal.count > 1 and _NUMBER not in name:
            yield (
                ("terminals", name, "count"),
                f"{terminal.count} terminals need {_NUMBER} in their name, such as ai{_NUMBER}",
            )
        for one, _ in each(name, terminal):
            if one in seen and (terminal.count == 1 or _NUMBER in name):
                yield ("terminals", name), f"there is a terminal '{one}' already"
            seen.add(one)
