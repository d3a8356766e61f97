"""Simulated twins of a bench's devices: served where its drivers look, or behind a driver to examine it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hil.bench.device import simulation_of
from hil.bench.read import BenchFile
from hil.catalog import find
from hil.daq.conformance import Subject
from hil.errors import SettingError


def serve(file: BenchFile, folder: Path, quirks: dict[str, dict[str, str]]) -> dict[str, Any]:
    """Start the twin of every device of a bench, one plant behind them all; by name, to be closed by the caller.

    Raises:
        SettingError: a device that cannot be served, or a simulation that cannot be run.
    """
    devices = file.bench.devices
    for name, device in devices.items():
        if not device.driver:
            raise SettingError(
                f"device '{name}' is simulated = \"{device.simulated}\", within the program that runs the bench; only "
                f'devices with driver = "…" are served'
            )
    twins = {name: find("devices", device.driver).load() for name, device in devices.items()}
    wirings = {name: device.wiring(file.bench.channels) for name, device in file.devices.items()}
    world = next(iter(twins.values())).world(simulation_of(list(devices), file.bench, folder), wirings)
    served: dict[str, Any] = {}
    try:
        for name, twin in twins.items():
            settings = devices[name].settings
            served[name] = twin.serve(settings, world.side(name), twin.quirks(quirks.get(name, {})))
    except BaseException:
        for started in served.values():
            started.close()
        raise
    return served


@contextmanager
def subject(file: BenchFile, folder: Path, driver: str, hardware: bool = False) -> Iterator[Subject]:
    """The first device of a bench with this driver, ready to be examined; simulated ones are served meanwhile.

    Raises:
        SettingError: the bench has no device with this driver, or an output may not be moved by half its range.
    """
    using = [name for name, device in file.bench.devices.items() if device.driver.replace("-", "_") == driver]
    if not using:
        raise SettingError(f'{file.path}: no device with driver = "{driver}"; say --bench with one that has it')
    device = file.devices[using[0]]
    wiring = device.wiring(file.bench.channels)
    if hardware:
        yield Subject(device.module, device.settings, wiring)
        return
    twin = find("devices", driver).load()
    wirings = {name: other.wiring(file.bench.channels) for name, other in file.devices.items()}
    side = twin.world(simulation_of(list(file.devices), file.bench, folder), wirings).side(using[0])
    served = twin.serve(file.bench.devices[using[0]].settings, side, twin.quirks({}))

    def spoil(**quirks: Any) -> None:
        served.behaviour.quirks = twin.quirks(quirks)

    elsewhere = device.settings.model_copy(update={"address": _elsewhere(served.where)})
    try:
        yield Subject(device.module, device.settings, wiring, elsewhere, side, spoil)
    finally:
        served.close()


def _elsewhere(address: str) -> str:
    """An address of the same kind where nobody answers."""
    if address.startswith("virtual:"):
        return f"{address}-nobody"
    head, colon, port = address.rpartition(":")
    return f"{head.rpartition('127')[0]}127.0.0.1:1" if colon and port.isdecimal() else f"{address}-nobody"
