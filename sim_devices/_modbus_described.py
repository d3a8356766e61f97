"""A Modbus device that is what its description says, with a plant behind its registers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from hil.daq.channel import Pwm
from hil.description.modbus import TIMES, Flag, ModbusDescription, Place, Write, safe_of
from sim_devices._described_counts import Counts
from sim_devices._field import Side, nearest_zero
from sim_devices._modbus_bank import Bank
from sim_devices._modbus_frames import Refused

Spot = tuple[str, int]
"""Table, and address on the wire."""


@dataclass(frozen=True, slots=True)
class Block:
    """A terminal in the address space: its registers, and those where an output is read back; empty where it is not."""

    name: str
    counts: Counts
    spots: tuple[Spot, ...]
    back: tuple[Spot, ...]


class DescribedBank(Bank):
    """Registers and coils of a description, and what it says of watchdog, safe mode, enabling and faults.

    Outputs obey when they are enabled and not in safe mode. A watchdog is armed by the writes of the description, or
    was set at the device itself (`watchdog_s`, `watchdog_level` of the settings). When it expires the outputs go where
    it puts them, and stay there until they are written, or until safe mode or the fault it raised is cleared.
    """

    def __init__(self, side: Side, description: ModbusDescription, settings: Mapping[str, Any]) -> None:
        super().__init__(side)
        described = description.on_the_wire
        watchdog, self._faults, self._enable = described.watchdog, described.faults, described.enable
        self._arm = watchdog.arm if watchdog else ()
        self._level = settings.get("watchdog_level")
        if self._level is None and watchdog:
            self._level = watchdog.expires_to
        self._set_s = settings.get("watchdog_s") if watchdog and not self._arm else None
        order = str(settings.get("word_order") or described.modbus.byte_order)
        blocks = {name: (terminal.direction, self._block(name, Counts(terminal, order)))
                  for name, terminal in described.terminals.items()}  # fmt: skip
        self._outputs = [block for direction, block in blocks.values() if direction == "out"]
        self._inputs = [block for direction, block in blocks.values() if direction == "in"]
        self._written = {spot: block for block in self._outputs for spot in block.spots}
        self._parts = {spot for spot in self._written if sum(spot in block.spots for block in self._outputs) > 1}
        self._read_back = {back: spot for block in self._outputs
                           for spot, back in zip(block.spots, block.back, strict=False) if spot != back}  # fmt: skip
        self._safe_at = {name: spots_from(write, blocks[name][1].counts.words) for write in self._arm
                         if (name := safe_of(write.value))}  # fmt: skip
        mode = described.safe_mode
        self._says_safe, self._ends_safe = (self._row(mode.status), self._row(mode.clear)) if mode else ({}, {})
        self._memory: dict[Spot, int] = {}
        self._flags = [(spot_of(flag), flag) for flag in _all_flags(described)]
        self._steps = {spot_of(write) for write in _all_writes(described)}
        self._safe_mode: set[str] = set()
        self._tripped = self._expired = False
        self._enabled = described.enable is None
        self._pwm: dict[str, Pwm] = {}
        for block in self._outputs:
            if block.counts.terminal.sets:
                self._goes_to(block, nearest_zero(*block.counts.terminal.range))
            else:
                self._store(block, side.standing(block.name))

    def input(self, address: int) -> int:
        """An input register."""
        return self._read(("input", address))

    def holding(self, address: int) -> int:
        """A holding register."""
        return self._read(("holding", address))

    def output(self, address: int) -> int:
        """What a write to a holding register changes."""
        spot = ("holding", address)
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
        self._tripped, self._enabled, self._expired = False, self._enable is None, False
        for block in self._outputs:
            self._goes_to(block, nearest_zero(*block.counts.terminal.range))

    def heard(self) -> None:
        """A valid request came."""
        super().heard()
        self._expired = False

    def tick(self) -> None:
        """Outputs go where the watchdog puts them when nothing was asked for its time."""
        time_s = self._watchdog_s()
        if time_s is None or self._expired or self.silent_s <= time_s:
            return
        self._expired, self._tripped = True, self._faults is not None
        self._enabled &= self._enable is None
        for block in self._outputs:
            if block.counts.terminal.sets:
                continue
            if self._says_safe:
                self._safe_mode.add(block.name)
                self.side.drive({block.name: self._safe_level(block)})
            else:
                self._goes_to(block, self._safe_level(block))

    def _block(self, name: str, counts: Counts) -> Block:
        terminal = counts.terminal
        spots = spots_from(terminal, counts.words)
        back = spots_from(terminal.read_back, counts.words) if isinstance(terminal.read_back, Place) else ()
        return Block(name, counts, spots, back)

    def _row(self, first: Place) -> dict[Spot, Block]:
        """By output, in the order of their registers, a coil in a row that begins with that of the first one."""
        lowest = min(block.spots[0][1] for block in self._outputs)
        return {(str(first.table), first.address + block.spots[0][1] - lowest): block for block in self._outputs}

    def _read(self, spot: Spot) -> int:
        flags = [flag for place, flag in self._flags if place == spot]
        inputs = [block for block in self._inputs if spot in block.spots]
        if flags and not inputs and spot not in self._written:  # a status bit beside a reading is not raised
            return sum({_bits(flag, self._is_so(flag)) for flag in flags})
        if not flags and spot in self._says_safe:
            return int(self._says_safe[spot].name in self._safe_mode)
        if spot in self._read_back:
            return self._memory[self._read_back[spot]]
        if inputs:
            return self._input_word(spot, inputs)
        if spot in self._written and self._written[spot].back:
            return self._memory[spot]
        if spot in self._steps:
            return self._memory.get(spot, 0)
        raise Refused(2)

    def _input_word(self, spot: Spot, blocks: list[Block]) -> int:
        """What all inputs in a register say together."""
        word, readings = 0, self.side.read()
        for block in blocks:
            words = block.counts.encoded(readings.get(block.name, 0.0), self.side.quirks.word_order)
            word |= words[block.spots.index(spot)]
        return word

    def _is_so(self, flag: Flag) -> bool:
        if self._enable is not None and flag == self._enable.ready:
            return self._enabled
        return self._faults is not None and flag == self._faults.flags[0] and self._tripped

    def _check_writable(self, spot: Spot, count: int) -> None:
        if spot in self._written:
            counts = self._written[spot].counts
            if counts.words == 1 and spot not in self._parts and not counts.takes([count]):
                raise Refused(3)
        elif spot not in self._steps | self._ends_safe.keys() and not any(spot in at for at in self._safe_at.values()):
            raise Refused(2)

    def _put(self, spot: Spot, count: int) -> None:
        self._memory[spot] = count
        if spot in self._written:
            for block in self._outputs:
                if spot == block.spots[-1]:  # a number in several registers counts when it is whole
                    self._obey(block)
        elif spot in self._ends_safe and count:
            self._safe_mode.discard(self._ends_safe[spot].name)
            self._obey(self._ends_safe[spot])
        self._look_at_steps(spot)

    def _look_at_steps(self, spot: Spot) -> None:
        """A sequence is done when its last write came and all of it stands."""
        clear = self._faults.clear if self._faults else ()
        if self._is_last(clear or self._arm, spot):  # where nothing else clears it, arming the watchdog anew does
            self._tripped = False
        if self._enable is not None and self._is_last(self._enable.disable, spot):
            self._enabled = False
        if self._enable is not None and self._is_last(self._enable.write, spot) and not self._tripped:
            self._enabled = True
            for block in self._outputs:
                self._obey(block)

    def _is_last(self, writes: tuple[Write, ...], spot: Spot) -> bool:
        return bool(writes) and spot_of(writes[-1]) == spot and self._stand(writes)

    def _stand(self, writes: tuple[Write, ...]) -> bool:
        """Whether what was written last to each place is what these write there."""
        last = {spot_of(write): write.value for write in writes}
        return all(self._memory.get(at) == value for at, value in last.items() if isinstance(value, int))

    def _obey(self, block: Block) -> None:
        if self._enabled and block.name not in self._safe_mode and not self._tripped:
            self._drive(block, block.counts.decoded([self._memory[spot] for spot in block.spots]))

    def _goes_to(self, block: Block, value: float) -> None:
        self._store(block, value)
        self._drive(block, value)

    def _drive(self, block: Block, value: float) -> None:
        """An output, or what it is made with."""
        of, _, key = (block.counts.terminal.sets or "").rpartition(".")
        if not of:
            self.side.drive({block.name: value})
            return
        self._pwm[of] = replace(self._pwm.get(of, Pwm(0.0)), **{key: value})
        self.side.modulate(of, self._pwm[of])

    def _store(self, block: Block, value: float) -> None:
        around = [self._memory.get(spot, 0) for spot in block.spots]
        self._memory.update(zip(block.spots, block.counts.encoded(value, around=around), strict=True))

    def _watchdog_s(self) -> float | None:
        """Its time, None while it is not armed."""
        if not self._arm:
            return None if self._set_s is None else float(self._set_s)
        times = {str(write.value): spot_of(write) for write in self._arm if write.value in TIMES}
        for unit, spot in times.items() if self._stand(self._arm) else ():
            return self._memory.get(spot, 0) / TIMES[unit] or None
        return None

    def _safe_level(self, block: Block) -> float:
        """Where the watchdog puts an output: where it was set to, by the description, or where that was written."""
        if self._level is not None:
            return float(self._level)
        if block.name in self._safe_at:
            return block.counts.decoded([self._memory.get(spot, 0) for spot in self._safe_at[block.name]])
        return nearest_zero(*block.counts.terminal.range)


def spot_of(place: Any) -> Spot:
    """Where something of a description stands that has its addresses on the wire."""
    return str(place.table), int(place.address)


def spots_from(place: Any, count: int) -> tuple[Spot, ...]:
    """So many registers from there on."""
    table, first = spot_of(place)
    return tuple((table, first + i) for i in range(count))


def _all_flags(described: ModbusDescription) -> Iterator[Flag]:
    yield from described.faults.flags if described.faults else ()
    yield from [described.enable.ready] if described.enable and described.enable.ready else []
    for terminal in described.terminals.values():
        yield from terminal.status


def _all_writes(described: ModbusDescription) -> Iterator[Write]:
    yield from described.watchdog.arm if described.watchdog else ()
    yield from (*described.enable.write, *described.enable.disable) if described.enable else ()
    yield from described.faults.clear if described.faults else ()


def _bits(flag: Flag, so: bool) -> int:
    """What a flag adds to its register, when it is so and when it is not."""
    mask = 1 << flag.bit if flag.bit is not None else flag.mask or 0xFFFF
    lowest = mask & -mask
    if flag.equals is None:
        return lowest if so else 0
    expected = flag.equals << flag.bit if flag.bit is not None else flag.equals
    return expected if so else (0 if expected else lowest)
