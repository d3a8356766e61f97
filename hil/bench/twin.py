"""Simulated twins of a bench's devices: served where its drivers look, or behind a driver to examine it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import BaseModel

from hil.bench.device import own_settings, simulation_of
from hil.bench.examined import examined_device
from hil.bench.read import BenchFile
from hil.catalog import find
from hil.daq.conformance import Subject
from hil.errors import SettingError, UnknownNameError


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
        if str(device.settings.get("address", "")).startswith("usb:"):
            raise SettingError(
                f"device '{name}': no twin is plugged in at {device.settings['address']}; in a copy of the file say a "
                f'path, such as address = "/tmp/{name}"'
            )
    twins = {name: _twin_of(device.driver) for name, device in devices.items()}
    wirings = {name: device.wiring(file.bench.channels) for name, device in file.devices.items()}
    world = next(iter(twins.values())).world(simulation_of(list(devices), file.bench, folder), wirings)
    served: dict[str, Any] = {}
    try:
        for name, twin in twins.items():
            settings = own_settings(devices[name], folder)
            served[name] = twin.serve(settings, world.side(name), twin.quirks(quirks.get(name, {})))
    except BaseException:
        for started in served.values():
            started.close()
        raise
    return served


@contextmanager
def subject(
    file: BenchFile,
    folder: Path,
    driver: str,
    hardware: bool = False,
    reach: float = 1.0,
    measured_by: Mapping[str, str] | None = None,
    device_name: str = "",
) -> Iterator[Subject]:
    """A device of a bench with this driver, ready to be examined; simulated ones are served meanwhile.

    Args:
        file: the bench.
        folder: that of the bench file.
        driver: name of the driver.
        hardware: the device itself is examined.
        reach: the share of the room between safe values and limits that outputs may use.
        measured_by: by output, the input that measures it.
        device_name: which of several; the first one if not said.

    Raises:
        SettingError: the bench has no device with this driver, or none of that name, or an input cannot
            measure what it is said to.
    """
    using = [name for name, device in file.bench.devices.items() if device.driver.replace("-", "_") == driver]
    if not using:
        raise SettingError(f'{file.path}: no device with driver = "{driver}"; say --bench with one that has it')
    if device_name and device_name not in using:
        raise SettingError(
            f"{file.path}: no device '{device_name}' with driver = \"{driver}\"; there are: {', '.join(using)}"
        )
    chosen = device_name or using[0]
    device = file.devices[chosen]
    examined = examined_device(file, device.name, reach, measured_by or {})
    if hardware:
        yield examined
        return
    twin = _twin_of(driver)
    wirings = {name: other.wiring(file.bench.channels) for name, other in file.devices.items()}
    side = twin.world(simulation_of(list(file.devices), file.bench, folder), wirings).side(chosen)
    served = twin.serve(own_settings(file.bench.devices[chosen], folder), side, twin.quirks({}))

    def spoil(**quirks: Any) -> None:
        served.behaviour.quirks = twin.quirks(quirks)

    try:
        yield replace(
            examined, another_address=_nowhere(device.settings, served.where), side=side, spoil=spoil, responses=()
        )
    finally:
        served.close()


def _twin_of(driver: str) -> ModuleType:
    try:
        return find("devices", driver).load()
    except UnknownNameError:
        raise SettingError(
            f"driver '{driver}' has no simulated device: nothing is served for it; `hil run … --rehearse` plays a run "
            f"without the device, `hil check-driver … --hardware` examines the device itself"
        ) from None


def _nowhere(settings: BaseModel, where: str) -> BaseModel:
    """The same settings, with which nothing is found."""
    if "port" in type(settings).model_fields and "address" not in type(settings).model_fields:
        return settings.model_copy(update={"port": 1})
    return settings.model_copy(update={"address": _unused_address(where)})


def _unused_address(address: str) -> str:
    """An address of the same kind where nobody answers."""
    if address.startswith("virtual:"):
        return f"{address}-nobody"
    head, colon, port = address.rpartition(":")
    return f"{head.rpartition('127')[0]}127.0.0.1:1" if colon and port.isdecimal() else f"{address}-nobody"
