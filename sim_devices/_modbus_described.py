"""A Modbus device that is what its description says, with a plant behind its registers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from hil.description.modbus import TIMES, Flag, ModbusDescription, ModbusTerminal, Write, safe_of
from hil.description.modbus_place import Table
from hil.description.terminal import each
from sim_devices._described_counts import Counts
from sim_devices._field import Side
from sim_devices._modbus_bank import Bank
from sim_devices._modbus_frames import Refused

Spot = tuple[Table, int]


@dataclass(frozen=True, slots=True)
class Seat:
    """A terminal in the address space: its first register, and where an output is read back."""

    name: str
    counts: Counts
    first: Spot
    back: Spot | None

    def spots(self, first: Spot) -> Iterator[Spot]:
        """Its registers from there on."""
        table, address = first
        return ((table, address + i) for i in range(self.counts.words))


class DescribedBank(Bank):
    """Registers and coils of a description, and what it says of watchdog, safe mode, enabling and faults.

    Outputs obey when they are enabled and not in safe mode. A watchdog is armed by the writes of the description, or
    was set at the device itself (`watchdog_s`, `watchdog_level` of the settings). When it expires the outputs go where
    it puts them, and stay there until they are written, or until safe mode or the fault it raised is cleared.
    """

    def __init__(self, side: Side, told: ModbusDescription, settings: Mapping[str, Any]) -> None:
        super().__init__(side)
        self._told = told
        self._level = settings.get("watchdog_level")
        self._set_s = settings.get("watchdog_s") if told.watchdog and not told.watchdog.arm else None
        order = str(settings.get("word_order") or told.modbus.byte_order)
        self._seats = [
            Seat(one, Counts(told, terminal, order), told.place_of(terminal, i), _back(told, terminal, i))
            for name, terminal in told.terminals.items()
            for one, i in each(name, terminal)
        ]
        self._outputs = [seat for seat in self._seats if seat.counts.terminal.direction == "out"]
        self._inputs = {
            spot: seat for seat in self._seats if seat not in self._outputs for spot in seat.spots(seat.first)
        }
        self._written = {spot: seat for seat in self._outputs for spot in seat.spots(seat.first)}
        self._parts = {spot for spot in self._written if sum(spot in s.spots(s.first) for s in self._outputs) > 1}
        self._read_back = {
            to: at for s in self._outputs if s.back and s.back != s.first
            for at, to in zip(s.spots(s.first), s.spots(s.back), strict=True)
        }  # fmt: skip
        self._memory: dict[Spot, int] = {}
        self._flags = [(told.wire(flag), flag) for flag in _all_flags(told)]
        self._steps = {told.wire(write): write for write in _all_writes(told)}
        self._safe_mode: set[str] = set()
        self._tripped = False
        self._enabled = told.enable is None
        self._expired = False
        for seat in self._outputs:
            self._store(seat, side.standing(seat.name))

    def input(self, address: int) -> int:
        """An input register."""
        return self._read(("input", address))

    def holding(self, address: int) -> int:
        """A holding register."""
        return self._read(("holding", address))

    def output(self, address: int) -> int:
        """What a write to a holding register changes."""
        spot: Spot = ("holding", address)
        return self._memory[spot] if spot in self._written else self._read(spot)

    def coil(self, address: int) -> bool:
        """A coil."""
        return bool(self._read(("coil", address)))

    def discrete(self, address: int) -> bool:
        """A discrete input."""
        return bool(self._read(("discrete", address)))

    def may_write(self, address: int, count: int) -> None:
        """Outputs within their counts, and what the description writes."""
        self._check_writable(("holding", address), count)

    def write(self, address: int, count: int) -> None:
        """An output, or what the description writes."""
        self._put(("holding", address), count)

    def write_coil(self, address: int, on: bool) -> None:
        """An output, or what the description writes."""
        self._check_writable(("coil", address), int(on))
        self._put(("coil", address), int(on))

    def restart(self) -> None:
        """Outputs at zero or as near as they come, nothing armed, enabled or in safe mode."""
        self._memory.clear()
        self._safe_mode.clear()
        self._tripped, self._enabled, self._expired = False, self._told.enable is None, False
        for seat in self._outputs:
            low, high = seat.counts.terminal.range
            self._goes_to(seat, min(max(0.0, low), high))

    def heard(self) -> None:
        """A valid request came."""
        super().heard()
        self._expired = False

    def tick(self) -> None:
        """Outputs go where the watchdog puts them when nothing was asked for its time."""
        time_s = self._watchdog_s()
        if time_s is None or self._expired or self.silent_s <= time_s:
            return
        self._expired, self._tripped = True, self._told.faults is not None
        if self._told.enable is not None:
            self._enabled = False
        for seat in self._outputs:
            if self._told.safe_mode is not None:
                self._safe_mode.add(seat.name)
                self._side_goes_to(seat, self._safe_level(seat))
            else:
                self._goes_to(seat, self._safe_level(seat))

    def _read(self, spot: Spot) -> int:
        if (flagged := self._flag_word(spot)) is not None:
            return flagged
        if spot in self._read_back:
            return self._memory[self._read_back[spot]]
        if spot in self._inputs:
            return self._input_word(spot)
        if spot in self._written and self._written[spot].back is not None:
            return self._memory[spot]
        if spot in self._steps:
            return self._memory.get(spot, 0)
        raise Refused(2)

    def _input_word(self, spot: Spot) -> int:
        """What all inputs in a register say together."""
        word = 0
        readings = self.side.read()
        for seat in self._seats:
            if seat not in self._outputs and spot in seat.spots(seat.first):
                words = seat.counts.encoded(readings.get(seat.name, 0.0), self.side.quirks.word_order)
                word |= words[spot[1] - seat.first[1]]
        return word

    def _flag_word(self, spot: Spot) -> int | None:
        """A register of flags; None where none stands."""
        here = [flag for place, flag in self._flags if place == spot]
        if not here:
            return self._safe_flag(spot)
        if spot in self._inputs or spot in self._written:  # a status bit beside a reading is not raised
            return None
        return sum({_bits(flag, self._is_so(flag)) for flag in here})

    def _safe_flag(self, spot: Spot) -> int | None:
        mode = self._told.safe_mode
        seat = self._seat_of_flag(spot, self._told.wire(mode.status)) if mode is not None else None
        return None if seat is None else int(seat.name in self._safe_mode)

    def _is_so(self, flag: Flag) -> bool:
        enable, faults = self._told.enable, self._told.faults
        if enable is not None and flag == enable.ready:
            return self._enabled
        return faults is not None and flag == faults.flags[0] and self._tripped

    def _check_writable(self, spot: Spot, count: int) -> None:
        if spot in self._written:
            counts = self._written[spot].counts
            if counts.words == 1 and spot not in self._parts and not counts.takes([count]):
                raise Refused(3)
        elif spot not in self._steps and self._setting(spot) is None and self._cleared(spot) is None:
            raise Refused(2)

    def _put(self, spot: Spot, count: int) -> None:
        self._memory[spot] = count
        if spot in self._written:
            for seat in self._outputs:
                if spot == list(seat.spots(seat.first))[-1]:  # a number in several registers counts when it is whole
                    self._obey(seat)
        elif (seat_ := self._cleared(spot)) is not None and count:
            self._safe_mode.discard(seat_.name)
            self._obey(seat_)
        self._look_at_steps(spot)

    def _look_at_steps(self, spot: Spot) -> None:
        """A sequence is done when its last write came and all of it stands."""
        told = self._told
        armed = told.watchdog is not None and self._is_last(told.watchdog.arm, spot)
        if told.faults is not None and (self._is_last(told.faults.clear, spot) or (armed and not told.faults.clear)):
            self._tripped = False  # where nothing else clears it, arming the watchdog anew does
        if told.enable is not None and self._is_last(told.enable.disable, spot):
            self._enabled = False
        if told.enable is not None and self._is_last(told.enable.write, spot) and not self._tripped:
            self._enabled = True
            for seat in self._outputs:
                self._obey(seat)

    def _is_last(self, writes: tuple[Write, ...], spot: Spot) -> bool:
        if not writes or self._told.wire(writes[-1]) != spot:
            return False
        last = {self._told.wire(write): write.value for write in writes}
        return all(self._memory.get(at) == value for at, value in last.items() if isinstance(value, int))

    def _obey(self, seat: Seat) -> None:
        if self._enabled and seat.name not in self._safe_mode and not self._tripped:
            words = [self._memory[spot] for spot in seat.spots(seat.first)]
            self.side.drive({seat.name: seat.counts.decoded(words)})

    def _goes_to(self, seat: Seat, value: float) -> None:
        self._store(seat, value)
        self._side_goes_to(seat, value)

    def _side_goes_to(self, seat: Seat, value: float) -> None:
        self.side.drive({seat.name: value})

    def _store(self, seat: Seat, value: float) -> None:
        for spot, word, own in zip(
            seat.spots(seat.first), seat.counts.encoded(value), seat.counts.own_bits(), strict=True
        ):
            self._memory[spot] = self._memory.get(spot, 0) & ~own | word

    def _watchdog_s(self) -> float | None:
        """Its time, None while it is not armed."""
        watchdog = self._told.watchdog
        if watchdog is None or not watchdog.arm:
            return None if self._set_s is None else float(self._set_s)
        last = {self._told.wire(write): write.value for write in watchdog.arm}
        if not all(self._memory.get(at) == value for at, value in last.items() if isinstance(value, int)):
            return None
        for at, value in last.items():
            if isinstance(value, str) and value in TIMES:
                return self._memory.get(at, 0) / TIMES[value] or None
        return None

    def _safe_level(self, seat: Seat) -> float:
        """Where the watchdog puts an output: where it was set to, by the description, or where that was written."""
        if self._level is not None:
            return float(self._level)
        watchdog = self._told.watchdog
        if watchdog is not None and watchdog.expires_to is not None:
            return watchdog.expires_to
        for spot, terminal in self._settings_of_safe():
            if terminal == seat.name:
                words = [self._memory.get((spot[0], spot[1] + i), 0) for i in range(seat.counts.words)]
                return seat.counts.decoded(words)
        low, high = seat.counts.terminal.range
        return min(max(0.0, low), high)

    def _settings_of_safe(self) -> Iterator[tuple[Spot, str]]:
        """Where safe values are written, and of which output."""
        for write in self._told.watchdog.arm if self._told.watchdog else ():
            if terminal := safe_of(write.value):
                yield self._told.wire(write), terminal

    def _setting(self, spot: Spot) -> Seat | None:
        """The output whose safe value a register is part of."""
        for (table, first), terminal in self._settings_of_safe():
            seat = next(seat for seat in self._outputs if seat.name == terminal)
            if table == spot[0] and first <= spot[1] < first + seat.counts.words:
                return seat
        return None

    def _cleared(self, spot: Spot) -> Seat | None:
        """The output whose safe mode a coil ends."""
        mode = self._told.safe_mode
        return None if mode is None else self._seat_of_flag(spot, self._told.wire(mode.clear))

    def _seat_of_flag(self, spot: Spot, first: Spot) -> Seat | None:
        """The output of a flag, which follow in the order of the outputs' registers."""
        lowest = min(seat.first[1] for seat in self._outputs)
        for seat in self._outputs:
            if spot == (first[0], first[1] + seat.first[1] - lowest):
                return seat
        return None


def _back(told: ModbusDescription, terminal: ModbusTerminal, i: int) -> Spot | None:
    return told.read_back_of(terminal, i) if terminal.direction == "out" else None


def _all_flags(told: ModbusDescription) -> Iterator[Flag]:
    yield from told.faults.flags if told.faults else ()
    yield from [told.enable.ready] if told.enable and told.enable.ready else []
    for terminal in told.terminals.values():
        yield from (flag.of_row(i) for flag in terminal.status for i in range(terminal.count))


def _all_writes(told: ModbusDescription) -> Iterator[Write]:
    yield from told.watchdog.arm if told.watchdog else ()
    yield from (*told.enable.write, *told.enable.disable) if told.enable else ()
    yield from told.faults.clear if told.faults else ()


def _bits(flag: Flag, so: bool) -> int:
    """What a flag adds to its register, when it is so and when it is not."""
    mask = 1 << flag.bit if flag.bit is not None else flag.mask or 0xFFFF
    lowest = mask & -mask
    if flag.equals is None:
        return lowest if so else 0
    said = flag.equals << flag.bit if flag.bit is not None else flag.equals
    return said if so else (0 if said else lowest)
