"""Making the devices of a bench safe on a way of one's own, each by itself, whatever the others do."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

from hil.bench.heartbeat import GIVE_UP_S, units_of
from hil.bench.read import BenchFile
from hil.bench.stop.stop_service import StopService
from hil.daq.calibration import Calibration
from hil.daq.contract import Daq
from hil.errors import reason
from hil.safety.outputs import Output, Outputs, State, announcement
from hil.system import system

_AGAIN_S, _AGAIN_LATE_S = 0.05, 0.2
_HANGS_S = 10.0  # a driver that has not returned after so long is left to itself, and tried anew
LONGEST_S = GIVE_UP_S + _HANGS_S  # nothing is tried any more
_MOMENT_S = 1.0
_SILENCE = 1.5  # so many times as long as the device's own watchdog takes nothing is sent to who does not obey
_TELLS_S = 1.0  # what is not safe after so long is told at once, not when nothing is tried any more


@dataclass(slots=True)
class _Device:
    """A device on the way to its safe values: why it is not there, or that it is and what could not be asked.

    `wait_s`: it was read back there, and for so long an earlier command may still arrive. `moved`: it was found away
    from them when it was opened. `disobeys`: it answers that it stands elsewhere. `safe_s`: when it came to them,
    `until_s`: when nothing late can come any more, by the monotonic clock. `quiet_until_s`: until then nothing is sent
    to it, so that its own watchdog acts. `outputs`: what it said of each, in the units of the bench.
    """

    name: str
    failure: str = ""
    unasked: str = ""
    done: bool = False
    wait_s: float = 0.0
    moved: bool = False
    disobeys: bool = False
    safe_s: float = 0.0
    until_s: float = -math.inf
    quiet_until_s: float = -math.inf
    outputs: dict[str, Output] = field(default_factory=dict)


def tried_once(file: BenchFile) -> list[str]:
    """Make every device safe; why some could not be."""
    devices = [_Device(name) for name in file.devices]
    for device in devices:
        _make_safe(file, device)
    return [device.failure for device in devices if device.failure]


class FailSafeShutdown:
    """Makes every device of a bench safe, each as soon as it can be reached, and so until nothing late can come.

    What the program that is dead had sent may still be on its way to each of them (see `hil.daq.link.Late`). Devices at
    different addresses are tried side by side, so that none waits for the time-outs of another.

    Args:
        file: the bench.
        service: told what each device says.
    """

    def __init__(self, file: BenchFile, service: StopService) -> None:
        self._file, self._service = file, service
        self._begun_s = system.now_s()
        self._lines: dict[str, list[_Device]] = {}
        self._workers: list[Any] = []
        for name, device in file.devices.items():
            address = str(getattr(device.settings, "address", name))
            until_s = self._begun_s + device.late_s
            self._lines.setdefault(address, []).append(_Device(name, f"{name}: no answer yet", until_s=until_s))

    def one_attempt(self) -> None:
        """One try, for as long as a moment: while the bench is still that of a program that was killed."""
        _wait(self._begun(self._tried_all), self._begun_s + _MOMENT_S)

    def with_patience(self, not_yet: Callable[[], None] = lambda: None) -> None:
        """Try until all are safe, and until nothing late can come any more; gives up after `GIVE_UP_S`.

        Args:
            not_yet: called once: when only time is missing, or when some are not safe after a moment.
        """
        work = self._begun(self._with_patience)
        until_s = system.now_s() + _TELLS_S
        while self.left and not self.announcement and system.now_s() < until_s:
            _wait(work, min(until_s, system.now_s() + _AGAIN_S))
        if self.left:
            not_yet()
        _wait(work, self._begun_s + GIVE_UP_S + _HANGS_S)

    @property
    def announcement(self) -> str:
        """What may be said when only time is missing to call them safe; else empty."""
        known = {name: output for device in self._devices for name, output in device.outputs.items()}
        return announcement(known) if all(device.done or device.wait_s for device in self._devices) else ""

    @property
    def left(self) -> list[str]:
        """Why some could not be made safe."""
        return [device.failure for device in self._devices if not device.done]

    @property
    def outputs(self) -> dict[str, Output]:
        """What is known of every output of the bench, in its units; nothing of those whose device never answered."""
        known = {name: Output(State.UNKNOWN, unit) for name, unit in units_of(self._file).items()}
        return known | {name: output for device in self._devices for name, output in device.outputs.items()}

    @property
    def unasked(self) -> list[str]:
        """What could not be asked whether it is."""
        return [device.unasked for device in self._devices if device.unasked]

    @property
    def took_s(self) -> float:
        """After which time the last one came to its safe values; where one did not: for how long it was tried."""
        last_s = system.now_s() if self.left else max(device.safe_s for device in self._devices)
        return max(0.0, last_s - self._begun_s)

    @property
    def _devices(self) -> list[_Device]:
        return [device for line in self._lines.values() for device in line]

    def _begun(self, do: Callable[[list[_Device]], None]) -> list[Any]:
        """One thread for each line, begun. An earlier one ends first: else it would overwrite what this one found."""
        earlier = self._workers or [None] * len(self._lines)
        lines = zip(earlier, self._lines.values(), strict=True)
        self._workers = [system.thread(_after, thread, do, line) for thread, line in lines]
        for thread in self._workers:
            thread.start()
        return self._workers

    def _tried_all(self, line: list[_Device]) -> None:
        for i, device in enumerate(line):
            if not device.done and system.now_s() >= device.quiet_until_s:
                line[i] = _try_once(self._file, device)
                self._service.tell(line[i].outputs, "watchdog")
                self._leave_to_its_watchdog(line[i])

    def _leave_to_its_watchdog(self, device: _Device) -> None:
        """Send nothing for a while to a device that does not obey: what it hears keeps its own watchdog from acting.

        Behind a dead link it hears nothing, and is to be made safe as soon as that is back. So one that does not say
        where it stands is tried for longer than its watchdog takes.
        """
        silence_s = _SILENCE * (getattr(self._file.devices[device.name].settings, "watchdog_s", None) or math.inf)
        now_s, tried_from_s = system.now_s(), max(self._begun_s, device.quiet_until_s)
        in_vain = now_s - tried_from_s >= (_MOMENT_S if device.disobeys else silence_s)
        if in_vain and not (device.done or device.wait_s) and silence_s < 0.5 * GIVE_UP_S:
            device.quiet_until_s = now_s + silence_s

    def _with_patience(self, line: list[_Device]) -> None:
        self._tried_all(line)
        while not all(device.done for device in line) and system.now_s() - self._begun_s <= GIVE_UP_S:
            only_time = all(device.done or device.wait_s for device in line)
            system.sleep(_AGAIN_LATE_S if only_time else _AGAIN_S)
            self._tried_all(line)


def _after(earlier: Any, do: Callable[[list[_Device]], None], line: list[_Device]) -> None:
    if earlier is not None:
        earlier.join()
    do(line)


def _wait(threads: list[Any], until_s: float) -> None:
    for thread in threads:
        thread.join(max(0.0, until_s - system.now_s()))


def _try_once(file: BenchFile, device: _Device) -> _Device:
    """What came of one try, as long as a driver may take that returns."""
    attempt = _Device(device.name, until_s=device.until_s, quiet_until_s=device.quiet_until_s)
    thread = system.thread(_make_safe, file, attempt)
    thread.start()
    thread.join(_HANGS_S)
    if thread.is_alive():
        return replace(device, failure=f"{device.name}: its driver does not return")
    comes_now = (attempt.done or attempt.wait_s) and (attempt.moved or not device.wait_s)
    attempt.safe_s = system.now_s() if comes_now else device.safe_s
    attempt.outputs = attempt.outputs or _no_more_heard_of(device.outputs, attempt.failure)
    return attempt


def _no_more_heard_of(outputs: Mapping[str, Output], why: str) -> dict[str, Output]:
    """What is known of outputs whose device was read back safe too early, and is gone."""
    return {name: replace(output, confirmed_in_s=0.0, why=why) for name, output in outputs.items()}


def _make_safe(file: BenchFile, device: _Device) -> None:
    """Open a device with its outputs alone, so that no sensor can keep it from being made safe, and read them back.

    Whatever a driver throws concerns this device alone.
    """
    outputs = {channel: entry for channel, entry in file.bench.channels.items() if entry.is_output}
    output_states = Outputs()
    try:
        if any(entry.device == device.name for entry in outputs.values()):
            daq = file.devices[device.name].open(outputs, only_safe=True)
            device.moved = any(daq.levels.get(name) != channel.safe for name, channel in daq.outputs.items())
            _ask_to_be_safe(daq, output_states, max(0.0, device.until_s - system.now_s()))
    except BaseException as error:
        device.failure = f"{device.name}: {reason(error).removeprefix(f'{device.name}: ')}"
        return
    finally:
        device.outputs = _in_bench_units(file, output_states)
    if not output_states.settled:
        device.failure = f"{device.name}: {output_states.text.removeprefix('NOT SAFE: ')}"
        device.wait_s = output_states.wait_s
        device.disobeys = any(output.state is State.DRIVEN for output in output_states.by_name.values())
        return
    unasked = [name for name, output in output_states.by_name.items() if not output.can]
    device.failure, device.done = "", True
    device.unasked = f"{device.name}: {', '.join(unasked)} cannot be read back" if unasked else ""


def _ask_to_be_safe(daq: Daq, output_states: Outputs, late_s: float) -> None:
    output_states.opened(daq.outputs)
    try:
        output_states.make_safe(daq, late_s=late_s)
    finally:
        with suppress(Exception):  # what is known of the outputs stands, however it lets go
            daq.close()


def _in_bench_units(file: BenchFile, output_states: Outputs) -> dict[str, Output]:
    """What a device said at its terminals, as the bench file calibrates them."""
    lines = {name: entry.line for name, entry in file.bench.channels.items()}
    return {name: _in_units_of(lines[name], output) if name in lines else output
            for name, output in output_states.by_name.items()}  # fmt: skip


def _in_units_of(line: Calibration, output: Output) -> Output:
    return replace(output, unit=line.unit, at=None if output.at is None else line.value_at(output.at))
