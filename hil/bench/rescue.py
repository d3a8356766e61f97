"""Making the devices of a bench safe on a way of one's own, each by itself, whatever the others do."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

from hil.bench.heartbeat import GIVE_UP_S, units_of
from hil.bench.read import BenchFile
from hil.bench.stop.desk import Desk
from hil.daq.calibration import Calibration
from hil.daq.contract import Daq
from hil.errors import reason
from hil.safety.outputs import Output, Outputs, State

_LATE_S = 1.0  # what the dead program had sent may still be on its way, and come after what is sent now
_AGAIN_S = 0.05
_HANGS_S = 10.0  # a driver that has not returned after so long is left to itself, and tried anew
_MOMENT_S = 1.0
_TELLS_S = 1.0  # what is not safe after so long is told at once, not when nothing is tried any more


@dataclass(slots=True)
class _Device:
    """A device on the way to its safe values: why it is not there, or that it is and what could not be asked.

    `moved`: it was found away from them when it was opened. `safe_s`: when it came to them, on the monotonic clock.
    `outputs`: what it said of each, in the units of the bench.
    """

    name: str
    failure: str = ""
    unasked: str = ""
    done: bool = False
    moved: bool = False
    safe_s: float = 0.0
    outputs: dict[str, Output] = field(default_factory=dict)


def tried_once(file: BenchFile) -> list[str]:
    """Make every device safe; why some could not be."""
    devices = [_Device(name) for name in file.devices]
    for device in devices:
        _make_safe(file, device)
    return [device.failure for device in devices if device.failure]


class Rescue:
    """Makes every device of a bench safe, each as soon as it can be reached, and so until nothing late can come.

    Devices at different addresses are tried side by side, so that none waits for the time-outs of another.

    Args:
        file: the bench.
        desk: told what each device says.
    """

    def __init__(self, file: BenchFile, desk: Desk) -> None:
        self._file, self._desk = file, desk
        self._begun_s = time.monotonic()
        self._lines: dict[str, list[_Device]] = {}
        for name, device in file.devices.items():
            address = str(getattr(device.settings, "address", name))
            self._lines.setdefault(address, []).append(_Device(name, f"{name}: no answer yet"))

    def at_once(self) -> None:
        """One try, for as long as a moment: while the bench is still that of a program that was killed."""
        _wait(self._begun(self._tried_all), self._begun_s + _MOMENT_S)

    def with_patience(self, not_yet: Callable[[], None] = lambda: None) -> None:
        """Try until all are safe, then look until none has moved for a while; gives up after `GIVE_UP_S`.

        Args:
            not_yet: called once when some are not safe after a moment.
        """
        work = self._begun(self._with_patience)
        _wait(work, time.monotonic() + _TELLS_S)
        if self.left:
            not_yet()
        _wait(work, self._begun_s + GIVE_UP_S + _HANGS_S)

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
        last_s = time.monotonic() if self.left else max(device.safe_s for device in self._devices)
        return max(0.0, last_s - self._begun_s)

    @property
    def _devices(self) -> list[_Device]:
        return [device for line in self._lines.values() for device in line]

    def _begun(self, do: Callable[[list[_Device]], None]) -> list[threading.Thread]:
        """One thread for each line, begun."""
        threads = [threading.Thread(target=do, args=(line,), daemon=True) for line in self._lines.values()]
        for thread in threads:
            thread.start()
        return threads

    def _tried_all(self, line: list[_Device]) -> None:
        for device in line:
            if not device.done:
                _tried(self._file, device)
                self._desk.tell(device.outputs, "watchdog")

    def _with_patience(self, line: list[_Device]) -> None:
        self._tried_all(line)
        while not all(device.done for device in line) and time.monotonic() - self._begun_s <= GIVE_UP_S:
            time.sleep(_AGAIN_S)
            self._tried_all(line)
        last_s = time.monotonic()
        while time.monotonic() - last_s < _LATE_S and time.monotonic() - self._begun_s <= GIVE_UP_S:
            time.sleep(_AGAIN_S)
            for device in line:
                if _looked_again(self._file, device):  # a late command of the dead program came after all
                    last_s = time.monotonic()
                    self._desk.tell(device.outputs, "watchdog")


def _wait(threads: list[threading.Thread], until_s: float) -> None:
    for thread in threads:
        thread.join(max(0.0, until_s - time.monotonic()))


def _looked_again(file: BenchFile, device: _Device) -> bool:
    """Whether a device that was safe had moved; one that is gone since has been safe, and stays told so."""
    again = _Device(device.name)
    _tried(file, again)
    if again.moved:
        device.failure, device.unasked, device.done = again.failure, again.unasked, again.done
        device.safe_s, device.outputs = again.safe_s, again.outputs
    return again.moved


def _tried(file: BenchFile, device: _Device) -> None:
    """One try, as long as a driver may take that returns."""
    attempt = _Device(device.name)
    thread = threading.Thread(target=_make_safe, args=(file, attempt), daemon=True)
    thread.start()
    thread.join(_HANGS_S)
    if thread.is_alive():
        device.failure = f"{device.name}: its driver does not return"
    else:
        device.failure, device.unasked, device.moved = attempt.failure, attempt.unasked, attempt.moved
        device.outputs = attempt.outputs
        if attempt.done and (attempt.moved or not device.done):
            device.safe_s = time.monotonic()
        device.done = attempt.done


def _make_safe(file: BenchFile, device: _Device) -> None:
    """Open a device with its outputs alone, so that no sensor can keep it from being made safe, and read them back.

    Whatever a driver throws concerns this device alone.
    """
    outputs = {channel: entry for channel, entry in file.bench.channels.items() if entry.is_output}
    known = Outputs()
    try:
        if any(entry.device == device.name for entry in outputs.values()):
            daq = file.devices[device.name].open(outputs, only_safe=True)
            device.moved = any(daq.levels.get(name) != channel.safe for name, channel in daq.outputs.items())
            _ask_to_be_safe(daq, known)
    except BaseException as error:
        device.failure = f"{device.name}: {reason(error).removeprefix(f'{device.name}: ')}"
        return
    finally:
        device.outputs = _in_bench_units(file, known)
    if not known.settled:
        device.failure = f"{device.name}: {known.text.removeprefix('NOT SAFE: ')}"
        return
    unasked = [name for name, output in known.known.items() if not output.can]
    device.failure, device.done = "", True
    device.unasked = f"{device.name}: {', '.join(unasked)} cannot be read back" if unasked else ""


def _ask_to_be_safe(daq: Daq, known: Outputs) -> None:
    known.opened(daq.outputs)
    try:
        known.make_safe(daq)
    finally:
        with suppress(Exception):  # what is known of the outputs stands, however it lets go
            daq.close()


def _in_bench_units(file: BenchFile, known: Outputs) -> dict[str, Output]:
    """What a device said at its terminals, as the bench file calibrates them."""
    lines = {name: entry.line for name, entry in file.bench.channels.items()}
    return {name: _in_units_of(lines[name], output) if name in lines else output
            for name, output in known.known.items()}  # fmt: skip


def _in_units_of(line: Calibration, output: Output) -> Output:
    return replace(output, unit=line.unit, at=None if output.at is None else line.value_at(output.at))
