"""The twin of a bench: the same bench file, its devices replaced by a simulated one in virtual time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import ModuleType
from typing import Any

from pydantic import BaseModel, ValidationError

from hil.bench.device import DeviceInUse, simulation_of
from hil.bench.file import Bench, Device
from hil.bench.read import BenchFile
from hil.catalog import find
from hil.daq.channel import Terminal
from hil.errors import SettingError

_IN_PROCESS = "in_process"
_TWIN = "twin"
_LEAST_CLOCK_HZ = 1000.0
_BITS, _NOISE = 24, 1e-3  # of a twin: readings never stand quite still, as no real one does


def twin_of(file: BenchFile, seed: int | None = None) -> BenchFile:
    """The bench with the simulated plant behind every channel: same channels, limits and interlocks, virtual time.

    A bench that is simulated in the process keeps its simulated device as it is described.

    Args:
        file: the bench.
        seed: of the noise; that of the bench file if not given.

    Raises:
        SettingError: its plant cannot be simulated; names what is missing.
    """
    module = find("devices", _IN_PROCESS).load()
    simulation = simulation_of(list(file.devices), file.bench, file.path.parent)
    simulation |= {} if seed is None else {"seed": seed}
    alone = next(iter(file.devices.values()))
    if alone.module is module:
        settings = _checked(file, module, {**alone.settings.model_dump(), "simulation": simulation, "time": "virtual"})
        return replace(file, devices={alone.name: replace(alone, settings=settings)})
    rate_hz = file.bench.sample_rate_hz
    clock_hz = rate_hz * max(1, math.ceil(_LEAST_CLOCK_HZ / rate_hz))
    settings = _checked(
        file, module, {"simulation": simulation, "clock_hz": clock_hz, "bits": _BITS, "noise_v": _NOISE}
    )
    device = DeviceInUse(_TWIN, module, settings, _terminals(file))
    return replace(file, bench=_rewired(file.bench), devices={_TWIN: device})


def _checked(file: BenchFile, module: ModuleType, given: Mapping[str, Any]) -> BaseModel:
    try:
        settings: BaseModel = module.Settings.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        raise _not_simulated(file, ".".join(map(str, first["loc"])), first["msg"]) from None
    for place, text in module.faults(settings):
        raise _not_simulated(file, ".".join(map(str, place)), text)
    return settings


def _not_simulated(file: BenchFile, place: str, text: str) -> SettingError:
    return SettingError(f"{file.path}: there is no twin of this bench: {place}: {text}")


def _terminals(file: BenchFile) -> dict[str, Terminal]:
    """Every terminal in use, under a name that tells its device."""
    return {
        f"{channel.device} {channel.terminal}": file.terminal_of(channel) for channel in file.bench.channels.values()
    }


def _rewired(bench: Bench) -> Bench:
    channels = {
        name: channel.model_copy(update={"device": _TWIN, "terminal": f"{channel.device} {channel.terminal}"})
        for name, channel in bench.channels.items()
    }
    return bench.model_copy(update={"devices": {_TWIN: Device(simulated=_IN_PROCESS)}, "channels": channels})
