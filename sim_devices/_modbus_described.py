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
class Block:
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

    def __init__(self, side: Side, description: ModbusDescription, settings: Mapping[str, Any]) -> None:
        super().__init__(side)
        self._description = description
        self._level = settings.get("watchdog_level")
        self._set_s = settings.get("watchdog_s") if description.watchdog and not description.watchdog.arm else None
        order = str(settings.get("word_order") or description.modbus.byte_order)
        self._blocks = [
            Block(
                one,
                Counts(description, terminal, order),
                description.place_of(terminal, i),
                _back(description, terminal, i),
            )
            for name, terminal in description.terminals.items()
            for one, i in each(name, terminal)
        ]
        self._outputs = [block for block in self._blocks if block.counts.terminal.direction == "out"]
        self._inputs = {
            spot: block for block in self._blocks if block not in self._outputs for spot in block.spots(block.first)
        }
        self._written = {spot: block for block in self._outputs for spot in block.spots(block.first)}
        self._parts = {spot for spot in self._written if sum(spot in s.spots(s.first) for s in self._outputs) > 1}
        self._read_back = {
            to: at for s in self._outputs if s.back and s.back != s.first
            for at, to in zip(s.spots(s.first), s.spots(s.back), strict=True)
        }  # fmt: skip
        self._memory: dict[Spot, int] = {}
        self._flags = [(description.wire(flag), flag) for flag in _all_flags(description)]
        self._steps = {description.wire(write): write for write in _all_writes(description)}
        self._safe_mode: set[str] = set()
        self._tripped = False
        self._enabled = description.enable is None
        self._expired = False
        for block in self._outputs:
            self._store(block, side.standing(block.name))

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
        self._tripped, self._enabled, self._expired = False, self._description.enable is None, False
        for block in self._outputs:
            low, high = block.counts.terminal.range
            self._goes_to(block, min(max(0.0, low), high))

    def heard(self) -> None:
        """A valid request came."""
        super().heard()
        self._expired = False

    def tick(self) -> None:
        """Outputs go where the watchdog puts them when nothing was asked for its time."""
        time_s = self._watchdog_s()
        if time_s is None or self._expired or self.silent_s <= time_s:
            return
        self._expired, self._tripped = True, self._description.faults is not None
        if self._description.enable is not None:
            self._enabled = False
        for block in self._outputs:
            if self._description.safe_mode is not None:
                self._safe_mode.add(block.name)
                self._side_goes_to(block, self._safe_level(block))
            else:
                self._goes_to(block, self._safe_level(block))

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
        for block in self._blocks:
            if block not in self._outputs and spot in block.spots(block.first):
                words = block.counts.encoded(readings.get(block.name, 0.0), self.side.quirks.word_order)
                word |= words[spot[1] - block.first[1]]
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
        mode = self._description.safe_mode
        block = self._block_of_flag(spot, self._description.wire(mode.status)) if mode is not None else None
        return None if block is None else int(block.name in self._safe_mode)

    def _is_so(self, flag: Flag) -> bool:
        enable, faults = self._description.enable, self._description.faults
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
            for block in self._outputs:
                if spot == list(block.spots(block.first))[-1]:  # a number in several registers counts when it is whole
                    self._obey(block)
        elif (cleared := self._cleared(spot)) is not None and count:
            self._safe_mode.discard(cleared.name)
            self._obey(cleared)
        self._look_at_steps(spot)

    def _look_at_steps(self, spot: Spot) -> None:
        """A sequence is done when its last write came and all of it stands."""
        description = self._description
        armed = description.watchdog is not None and self._is_last(description.watchdog.arm, spot)
        if description.faults is not None and (
            self._is_last(description.faults.clear, spot) or (armed and not description.faults.clear)
        ):
            self._tripped = False  # where nothing else clears it, arming the watchdog anew does
        if description.enable is not None and self._is_last(description.enable.disable, spot):
            self._enabled = False
        if description.enable is not None and self._is_last(description.enable.write, spot) and not self._tripped:
            self._enabled = True
            for block in self._outputs:
                self._obey(block)

    def _is_last(self, writes: tuple[Write, ...], spot: Spot) -> bool:
        if not writes or self._description.wire(writes[-1]) != spot:
            return False
        last = {self._description.wire(write): write.value for write in writes}
        return all(self._memory.get(at) == value for at, value in last.items() if isinstance(value, int))

    def _obey(self, block: Block) -> None:
        if self._enabled and block.name not in self._safe_mode and not self._tripped:
            words = [self._memory[spot] for spot in block.spots(block.first)]
            self.side.drive({block.name: block.counts.decoded(words)})

    def _goes_to(self, block: Block, value: float) -> None:
        self._store(block, value)
        self._side_goes_to(block, value)

    def _side_goes_to(self, block: Block, value: float) -> None:
        self.side.drive({block.name: value})

    def _store(self, block: Block, value: float) -> None:
        spots = list(block.spots(block.first))
        around = [self._memory.get(spot, 0) for spot in spots]
        self._memory.update(zip(spots, block.counts.encoded(value, around=around), strict=True))

    def _watchdog_s(self) -> float | None:
        """Its time, None while it is not armed."""
        watchdog = self._description.watchdog
        if watchdog is None or not watchdog.arm:
            return None if self._set_s is None else float(self._set_s)
        last = {self._description.wire(write): write.value for write in watchdog.arm}
        if not all(self._memory.get(at) == value for at, value in last.items() if isinstance(value, int)):
            return None
        for at, value in last.items():
            if isinstance(value, str) and value in TIMES:
                return self._memory.get(at, 0) / TIMES[value] or None
        return None

    def _safe_level(self, block: Block) -> float:
        """Where the watchdog puts an output: where it was set to, by the description, or where that was written."""
        if self._level is not None:
            return float(self._level)
        watchdog = self._description.watchdog
        if watchdog is not None and watchdog.expires_to is not None:
            return watchdog.expires_to
        for spot, terminal in self._settings_of_safe():
            if terminal == block.name:
                words = [self._memory.get((spot[0], spot[1] + i), 0) for i in range(block.counts.words)]
                return block.counts.decoded(words)
        low, high = block.counts.terminal.range
        return min(max(0.0, low), high)

    def _settings_of_safe(self) -> Iterator[tuple[Spot, str]]:
        """Where safe values are written, and of which output."""
        for write in self._description.watchdog.arm if self._description.watchdog else ():
            if terminal := safe_of(write.value):
                yield self._description.wire(write), terminal

    def _setting(self, spot: Spot) -> Block | None:
        """The output whose safe value a register is part of."""
        for (table, first), terminal in self._settings_of_safe():
            block = next(block for block in self._outputs if block.name == terminal)
            if table == spot[0] and first <= spot[1] < first + block.counts.words:
                return block
        return None

    def _cleared(self, spot: Spot) -> Block | None:
        """The output whose safe mode a coil ends."""
        mode = self._description.safe_mode
        return None if mode is None else self._block_of_flag(spot, self._description.wire(mode.clear))

    def _block_of_flag(self, spot: Spot, first: Spot) -> Block | None:
        """The output of a flag, which follow in the order of the outputs' registers."""
        lowest = min(block.first[1] for block in self._outputs)
        for block in self._outputs:
            if spot == (first[0], first[1] + block.first[1] - lowest):
                return block
        return None


def _back(description: ModbusDescription, terminal: ModbusTerminal, i: int) -> Spot | None:
    return description.read_back_of(terminal, i) if terminal.direction == "out" else None


def _all_flags(description: ModbusDescription) -> Iterator[Flag]:
    yield from description.faults.flags if description.faults else ()
    yield from [description.enable.ready] if description.enable and description.enable.ready else []
    for terminal in description.terminals.values():
        yield from (flag.of_row(i) for flag in terminal.status for i in range(terminal.count))


def _all_writes(description: ModbusDescription) -> Iterator[Write]:
    yield from description.watchdog.arm if description.watchdog else ()
    yield from (*description.enable.write, *description.enable.disable) if description.enable else ()
    yield from description.faults.clear if description.faults else ()


def _bits(flag: Flag, so: bool) -> int:
    """What a flag adds to its register, when it is so and when it is not."""
    mask = 1 << flag.bit if flag.bit is not None else flag.mask or 0xFFFF
    lowest = mask & -mask
    if flag.equals is None:
        return lowest if so else 0
    expected = flag.equals << flag.bit if flag.bit is not None else flag.equals
    return expected if so else (0 if expected else lowest)
