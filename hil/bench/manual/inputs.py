"""Every input of a bench, device by device, each opened with its inputs alone: nothing is driven or made safe."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress

from hil.bench.device import DeviceInUse
from hil.bench.lease import leased
from hil.bench.manual.reading import Followed, Reading
from hil.bench.protection_coverage.packages import check_packages
from hil.bench.read import BenchFile
from hil.daq.contract import Block, Daq, Waveform
from hil.errors import DeviceLostError, HardwareError, SettingError, UnknownNameError
from hil.system import system

_AGAIN_S = 1.0  # after a failure a device is opened again


@contextmanager
def inputs_of(file: BenchFile, names: Collection[str] = ()) -> Iterator[Inputs]:
    """The inputs of a bench, or those named, to be looked at; devices without any of them are not opened.

    Raises:
        UnknownNameError: a channel that the bench does not have.
        SettingError: a channel that is an output, a bench without inputs, or a package that is not installed.
        InUseError: another program drives this bench.
    """
    check_packages(file)
    chosen = _chosen(file, names)
    with leased(file):
        looked = Inputs(file, chosen)
        try:
            yield looked
        finally:
            looked.close()


def _chosen(file: BenchFile, names: Collection[str]) -> list[str]:
    inputs = [name for name, channel in file.bench.channels.items() if not channel.is_output]
    for name in names:
        if name not in file.bench.channels:
            raise UnknownNameError("channel", name, inputs)
        if name not in inputs:
            raise SettingError(f"channel '{name}' is an output; what is looked at are inputs: {', '.join(inputs)}")
    if not inputs:
        raise SettingError(f"{file.path}: no channel is an input, so there is nothing to look at")
    return [name for name in inputs if not names or name in names]


class Inputs:
    """Inputs that are looked at, each device in a thread of its own: one that hangs keeps no other from being read.

    Args:
        file: the bench.
        names: of the inputs.

    Attributes:
        followed: each of them, with what it read in the last second.
    """

    def __init__(self, file: BenchFile, names: Collection[str]) -> None:
        self.followed = {name: Followed(name, file) for name in names}
        by_device: dict[str, dict[str, Followed]] = {}
        for name, followed in self.followed.items():
            by_device.setdefault(followed.entry.device, {})[name] = followed
        self._devices = {name: _Looked(file, file.devices[name], inputs) for name, inputs in by_device.items()}
        self._pool = ThreadPoolExecutor(max_workers=len(self._devices), thread_name_prefix="hil-look")
        self._under_way: dict[str, Future[None]] = {}

    @property
    def failures(self) -> Mapping[str, str]:
        """Why a device does not answer, by device; empty when all do."""
        return {name: device.failure for name, device in self._devices.items() if device.failure}

    @property
    def devices(self) -> Mapping[str, Daq | None]:
        """Each device with its inputs, where it is open."""
        return {name: device.daq for name, device in self._devices.items()}

    def look(self, duration_s: float) -> list[Reading]:
        """Read for so long, and say how every input stands. A device that takes longer is not waited for."""
        for name, device in self._devices.items():
            if name not in self._under_way or self._under_way[name].done():
                self._under_way[name] = self._pool.submit(device.step, duration_s)
        wait(self._under_way.values(), None if self._is_virtual else 2.0 * duration_s + 0.2)
        by_name = {
            reading.name: reading for device in self._devices.values() for reading in device.readings(duration_s)
        }
        return [by_name[name] for name in self.followed]

    @property
    def _is_virtual(self) -> bool:
        return all(device.is_virtual for device in self._devices.values())

    def close(self) -> None:
        """Let go of the devices."""
        self._pool.shutdown(wait=True, cancel_futures=True)
        for device in self._devices.values():
            device.close()


class _Looked:
    """One device, opened with inputs alone and opened again after a failure."""

    def __init__(self, file: BenchFile, device: DeviceInUse, followed: Mapping[str, Followed]) -> None:
        self._device, self._followed = device, followed
        self._channels = {name: one.entry for name, one in followed.items()}
        self._rate_hz = file.bench.sample_rate_hz
        self._came_s = self._failed_s = -float("inf")
        self._begun_s = system.now_s()
        self.is_virtual = file.is_simulated
        self.daq: Daq | None = None
        self.failure = ""

    def step(self, duration_s: float) -> None:
        """Read for so long; what goes wrong is kept in words, and the device opened again a second later."""
        if system.now_s() - self._failed_s < _AGAIN_S:
            system.sleep(duration_s)
            return
        try:
            self.daq = self.daq or self._device.open(self._channels, looked_at=True)
            for block in self.daq.play(self._waveform(self.daq, duration_s)):
                self._take_block(block)
        except HardwareError as error:
            self.failure, self._failed_s = str(error), system.now_s()
            self.close()
        else:
            self.failure = ""

    def readings(self, duration_s: float) -> list[Reading]:
        """How each input stands; one of a device that tells nothing any more is stale."""
        age_s = system.now_s() - max(self._came_s, self._begun_s)
        late = age_s > max(1.0, 3.0 * duration_s)
        silent = self.failure or (f"no answer for {age_s:.1f} s" if late and not self.is_virtual else "")
        return [followed.reading(age_s, silent) for followed in self._followed.values()]

    def close(self) -> None:
        """Let go of it."""
        daq, self.daq = self.daq, None
        if daq is not None:
            with suppress(HardwareError):  # nothing was driven
                daq.close()

    def _waveform(self, daq: Daq, duration_s: float) -> Waveform:
        promised = daq.promises
        asked_hz = max(min(self._rate_hz, promised.highest_rate_hz), promised.lowest_rate_hz)
        rate_hz = daq.actual_rate_hz(asked_hz)
        return Waveform(rate_hz, {}, max(1, round(duration_s * rate_hz)))

    def _take_block(self, block: Block) -> None:
        if not len(block):
            raise DeviceLostError(f"{self._device.name}: no samples came")
        for name, followed in self._followed.items():
            followed.take(block.time_s, block.inputs[name], block.invalid_reasons.get(name, ""))
        self._came_s = system.now_s()
