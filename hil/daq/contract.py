"""What a DAQ backend is: promises, waveforms, blocks.

The contract is in blocks, because the hardware, not the host, times samples wherever it can. What a backend
cannot promise it says in its `Promises`, which are written into recordings and read by estimators; nobody
guesses.

A driver (`drivers/NAME.py`) or simulated device (`sim_devices/NAME.py`) provides four names:

    Settings                                  what its table in the bench file may say (pydantic)
    faults(settings) -> [(place, text)]       what is wrong with them beyond their types: keys, and a remedy
    terminals(settings) -> {name: Terminal}   what it has to connect to; opens nothing
    open_link(settings, wiring) -> Link       a device that the host asks over a link, open (see `hil.daq.link`); or
    open_daq(settings, wiring) -> Daq         one that times itself, open; every output is left where it was found

It may provide more, by which `hil check` warns and a run is refused before anything is opened:

    needs(settings) -> (package, …)           what must be installed, by the names under which it is imported
    watchdog_levels(settings) -> {name: raw}  where the device's own watchdog puts outputs, as far as that is known
    has_watchdog(settings) -> bool            whether the device has one; as `watchdog_s` may be said if not given
    not_read_back(settings) -> {name, …}      outputs of which the device cannot be asked where they stand
    has_checksum(settings) -> bool            whether answers have one: then no garbled one may be believed
    has_numbers(settings) -> bool             whether answers have that of their request: then none to another one may
    read_back_requests(wiring) -> int         requests that ask where they all stand, 0 where it reports them by itself;
                                              at most one for each output if not given
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, Protocol

import numpy as np

from hil.daq.channel import InputChannel, OutputChannel
from hil.errors import RangeError
from hil.record.recording import Array


@dataclass(frozen=True, slots=True)
class Promises:
    """What a backend keeps. Data, so that nobody guesses.

    Attributes:
        timing: who times the samples: the device's own clock (`hardware`), a simulated device's clock that
            does not wait (`virtual`), or the host that asks for each one (`polled`).
        simultaneous: inputs are sampled at one instant; otherwise `skew_s` lies between neighbours, in the
            order of the wiring.
        read_at: share of a sample between the update of the outputs and the reading of the first input.
        holds_on_stop: outputs keep their last value when a task stops (so they must be driven safe).
        lowest_rate_hz, highest_rate_hz: what can be asked for; the actual rate is coerced.
        clock_hz: rates are whole divisions of it; None when any rate can be had.
        watchdog_s: the device itself makes outputs safe when it hears nothing for so long; None: it does not.
        latency_s: measured delay of the link, where one is known.
        sample_s: how long a sample has taken of late, driving and reading; None where the device times samples.
        blind_s: on a link that has fallen behind its rate, how long the next sample will take, as the last one
            did; else 0.
        delays_s: by input, the measured time from the update of the outputs to its reading, where the link and
            not the sample clock decides it: the median of late.
        delay_channels: by input, the name under which every block has that time for each sample
            (`Block.delays_s`); inputs that are read in one exchange share a name.
    """

    timing: Literal["hardware", "virtual", "polled"]
    simultaneous: bool
    skew_s: float
    read_at: float
    holds_on_stop: bool
    lowest_rate_hz: float
    highest_rate_hz: float
    clock_hz: float | None = None
    watchdog_s: float | None = None
    latency_s: float | None = None
    sample_s: float | None = None
    blind_s: float = 0.0
    delays_s: Mapping[str, float] | None = None
    delay_channels: Mapping[str, str] | None = None

    @property
    def delay_names(self) -> tuple[str, ...]:
        """The names of `delay_channels`, each once."""
        return tuple(dict.fromkeys((self.delay_channels or {}).values()))

    def sampling(self, inputs: Iterable[str], rate_hz: float) -> dict[str, Any]:
        """These promises as a recording keeps them: also when each input was read.

        `delay_s` is, by input name, the time from the update of the outputs to the reading of that input.
        """
        names = list(inputs)
        delays = {name: self.read_at / rate_hz + i * self.skew_s for i, name in enumerate(names)}
        if self.delays_s is not None:
            delays = {name: self.delays_s[name] for name in names}
        return {**asdict(self), "rate_hz": rate_hz, "delay_s": delays}


@dataclass(frozen=True, slots=True)
class Waveform:
    """Samples for outputs, started together on one clock; outputs not named hold their level.

    `outputs` has one array of shape (n,) for each name, n ≥ 1. Without any output it says by `count` how often the
    inputs are read: a bench is looked at so, its devices opened with their inputs alone.

    Raises:
        RangeError: no sample, or arrays of different lengths.
    """

    rate_hz: float
    outputs: Mapping[str, Array]
    count: int = 0

    def __post_init__(self) -> None:
        lengths = {name: len(values) for name, values in self.outputs.items()} or {"inputs alone": self.count}
        if len(set(lengths.values())) != 1 or 0 in lengths.values():
            raise RangeError(f"outputs of one waveform need the same number of samples, at least one: {lengths}")

    def __len__(self) -> int:
        return len(next(iter(self.outputs.values()))) if self.outputs else self.count

    def slices(self, samples: int) -> Iterator[Waveform]:
        """The waveform in pieces of at most `samples`."""
        for first in range(0, len(self), samples):
            piece = {name: values[first : first + samples] for name, values in self.outputs.items()}
            yield Waveform(self.rate_hz, piece, min(samples, len(self) - first))


@dataclass(frozen=True, slots=True)
class Block:
    """Samples that came back: when they were taken, what was read, and what was driven.

    An input that was not measured is no finite number, and never one at the end of its range: NaN where the device
    has no valid reading, plus or minus infinity where the reading stands at the end of its range or beyond.

    Attributes:
        time_s: stamps the samples really had, on the device's clock since it was opened; they go on
            increasing from task to task. Shape (n,).
        inputs, outputs: every channel by name, shape (n,).
        late: samples that a polled backend missed.
        delays_s: for each name in `Promises.delay_channels`, how long after the stamp each sample was read, shape
            (n,); empty where the sample clock says when.
        invalid_reasons: by input, why samples of it are no measurement, in the device's words; where it has any.
    """

    time_s: Array
    inputs: Mapping[str, Array]
    outputs: Mapping[str, Array]
    late: int = 0
    delays_s: Mapping[str, Array] = field(default_factory=dict)
    invalid_reasons: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def columns(self) -> Mapping[str, Array]:
        """Everything that is kept beside the stamps, by name."""
        return {**self.outputs, **self.inputs, **self.delays_s}

    def values(self, name: str) -> Array:
        """Samples of an input or an output."""
        return self.inputs[name] if name in self.inputs else self.outputs[name]


def joined(blocks: Sequence[Block]) -> Block:
    """Blocks of one task as one."""
    if len(blocks) == 1:
        return blocks[0]
    return Block(
        np.concatenate([block.time_s for block in blocks]),
        _joined([block.inputs for block in blocks]),
        _joined([block.outputs for block in blocks]),
        sum(block.late for block in blocks),
        _joined([block.delays_s for block in blocks]),
        {name: why for block in blocks for name, why in block.invalid_reasons.items()},
    )


def _joined(pieces: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


@dataclass(frozen=True, slots=True)
class ReadBack:
    """What a device says of one of its outputs when it is asked.

    Attributes:
        at: where the output stands, in its unit; None when the device did not say.
        can: whether this device can be asked at all.
        why: why it did not say, where it can be asked.
        rescue: what makes the output safe when nobody reaches the device, such as its own watchdog; empty: nothing.
        late_s: so long an earlier command that was not answered may still arrive and move it.
        is_away: it says that it is not at its safe value, and not where it stands.
    """

    at: float | None = None
    can: bool = True
    why: str = ""
    rescue: str = ""
    late_s: float = 0.0
    is_away: bool = False


CANNOT_BE_ASKED = ReadBack(can=False)


@contextmanager
def closing_blocks(blocks: Iterator[Block]) -> Iterator[Iterator[Block]]:
    """Blocks of a task whose reader may leave early: the task then ends at once, not when memory is tidied."""
    try:
        yield blocks
    finally:
        if isinstance(blocks, Generator):
            blocks.close()


class Daq(Protocol):
    """A backend: NI, Modbus, serial, CAN, or a simulated plant.

    Errors (all from `hil.errors`): `RangeError` before the first sample; afterwards `LinkError`,
    `DeviceLostError`, `OutputUnderflowError`, `OverrunError`. Blocks read before an error are handed over
    before it is raised.

    One in virtual time may have a `roll_back(block_samples)`, called between two blocks of a task: the last one is
    taken back, and what it covered is played anew in blocks of so many samples. It is None where time is real.

    One of several devices may have a `look(input) -> Block`: a reading of that input now, asked of its device alone,
    with no task at work; also after another device failed.
    """

    @property
    def promises(self) -> Promises:
        """What this backend keeps."""
        ...

    @property
    def outputs(self) -> Mapping[str, OutputChannel]:
        """The outputs in use, by name, with the range that the device really gives them."""
        ...

    @property
    def inputs(self) -> Mapping[str, InputChannel]:
        """The inputs in use, by name, in the order in which they are scanned."""
        ...

    @property
    def levels(self) -> Mapping[str, float]:
        """Where each output stands now, as far as the device tells. Never raises."""
        ...

    def actual_rate_hz(self, asked_hz: float) -> float:
        """The rate that the device will really use when asked for one.

        Raises:
            RangeError: outside what the device can do.
        """
        ...

    def play(self, waveform: Waveform, block_samples: int | None = None) -> Iterator[Block]:
        """Finite acquisition: outputs and inputs start together, one input sample for each output sample.

        The whole waveform is the device's before the first sample, so it cannot run dry. Blocks come back as
        they are read, of `block_samples` at most. Outputs hold their last value afterwards. `waveform.rate_hz`
        must be an actual rate.
        """
        ...

    def stream(self, waveforms: Iterable[Waveform]) -> Iterator[Block]:
        """Continuous acquisition: one uninterrupted task, a block back for each waveform, more if samples come late.

        The next waveform is asked for while the current one plays; memory stays bounded. All have one rate
        and name the same outputs.
        """
        ...

    def make_safe(self) -> None:
        """Stop what plays and put every output at its safe value now. May be called at any time, again too.

        An output that cannot be reached keeps no other from it; it is raised when all have been tried.
        """
        ...

    def read_back(self) -> Mapping[str, ReadBack]:
        """What the device answers now when it is asked where each output stands. Never raises.

        Only what the device says counts, never what it was told before. Asked while nothing plays. A device that
        cannot be asked says `CANNOT_BE_ASKED`, which is then what the operator is told.
        """
        ...

    def close(self) -> None:
        """Make safe and let go of the device. May be called twice."""
        ...
