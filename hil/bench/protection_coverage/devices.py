"""Outputs that nothing makes safe when the program, the computer or the cable fails."""

from __future__ import annotations

import datetime as dt
import ipaddress
import math
import re
import socket
from collections.abc import Iterator, Mapping

from hil.bench.device import DeviceInUse
from hil.bench.read import BenchFile
from hil.daq.address import is_relayed, is_visa

_NEAR = 1e-3  # of a terminal's range: levels that differ by less are one


def watchdog_off(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """Devices with outputs whose own watchdog is there and off."""
    for name, device in driving(file):
        if _may_have_watchdog(device) and _watchdog_s(device) is None:
            yield (
                f"device '{name}': its own watchdog is off, so that its outputs stay where they are when the computer "
                f"stops or the cable is off: say watchdog_s = … under [devices.{name}]"
            )


def no_watchdog(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """Devices with outputs that have no watchdog, on a bench without an enable line."""
    if _has_enable_line(file):
        return
    for name, device in driving(file):
        if not _may_have_watchdog(device):
            yield (
                f"device '{name}': driver '{file.bench.devices[name].driver}' has no watchdog, its outputs stay where "
                f"they are when the program or the computer stops: put a relay into the valve's supply and give the "
                f"bench an enable line, a digital output with safe = 0 and on = 1"
            )


def watchdog_not_safe(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """Device watchdogs that would put an output elsewhere than at its safe value."""
    for name, device in driving(file):
        goes_to: Mapping[str, float] = getattr(device.module, "watchdog_levels", lambda _settings: {})(device.settings)
        for channel, output in device.wiring(file.bench.channels).outputs.items():
            level = goes_to.get(output.terminal, output.safe)
            if _watchdog_s(device) is None or abs(level - output.safe) <= _NEAR * (output.high - output.low):
                continue
            there = "lets it float" if math.isnan(level) else f"puts it at {level:g} {output.unit}"
            yield (
                f"channel '{channel}': the watchdog of device '{name}' {there}, but its safe value is {output.safe:g} "
                f"{output.unit}: connect the valve so that both are the same, or take another device"
            )


def no_watchdog_process(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """A bench with real devices that switched the watchdog process off."""
    if not file.bench.protection.watchdog_s and not file.is_simulated:
        yield (
            "watchdog_s = 0: no process makes outputs safe when the program is killed or hangs: take it away from "
            "[protection]"
        )


def open_to_others(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """Addresses of this computer that others can reach: what `hil devices` serves there listens to all of them."""
    for name, device in file.devices.items():
        host = _host(str(getattr(device.settings, "address", "")))
        if host and _is_own_and_open(host):
            yield (
                f"device '{name}': {host} is this computer as others see it, and what `hil devices` serves there "
                f"listens to the whole network: say 127.0.0.1, or the address of the device"
            )


def driving(file: BenchFile) -> Iterator[tuple[str, DeviceInUse]]:
    """Real devices that have outputs in use; simulated ones end with the program."""
    using = {channel.device for channel in file.bench.channels.values() if channel.is_output}
    for name, device in file.devices.items():
        if name in using and not file.bench.devices[name].simulated:
            yield name, device


def not_read_back(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """Outputs of which the device cannot be asked where they stand, as far as its driver knows."""
    for name, device in driving(file):
        silent = getattr(device.module, "not_read_back", lambda _settings: ())(device.settings)
        for channel, output in device.wiring(file.bench.channels).outputs.items():
            if output.terminal in silent:
                yield (
                    f"channel '{channel}': device '{name}' cannot be asked where {output.terminal} stands, so nobody "
                    f"knows whether it is safe: give an input that measures it an interlock, or take another device"
                )


def untried_transport(file: BenchFile, _day: dt.date) -> Iterator[str]:
    """Outputs behind USBTMC, GPIB or a gateway of VISA, of which no late write was ever seen."""
    for name, device in driving(file):
        address = str(getattr(device.settings, "address", ""))
        if is_visa(address) and is_relayed(device.settings):
            yield (
                f"device '{name}': whether a command can arrive late there, after the safe one, was never tried on "
                f"{address.partition('::')[0]}: put a relay into the valve's supply, or reach it by VXI-11, HiSLIP or "
                f"a socket"
            )


def _may_have_watchdog(device: DeviceInUse) -> bool:
    """Whether it has one that `watchdog_s` would arm."""
    has = getattr(device.module, "has_watchdog", lambda settings: "watchdog_s" in type(settings).model_fields)
    return bool(has(device.settings))


def _watchdog_s(device: DeviceInUse) -> float | None:
    watchdog_s: float | None = getattr(device.settings, "watchdog_s", None)
    return watchdog_s


def _has_enable_line(file: BenchFile) -> bool:
    for channel in file.bench.channels.values():
        kind = file.terminal_of(channel).kind
        if kind == "digital" and channel.on is not None and channel.on != channel.safe:
            return True
    return False


def _host(address: str) -> str:
    """The host of `127.0.0.1:502`, `socket://0.0.0.0:4001`, `can:[::]:502`, `bench-pc:502`; empty if there is none."""
    found = re.search(r"(?:^|[/:@])(?:\[([0-9a-fA-F:]+)\]|([^/:@\s]+)):\d+(?:[/?].*)?$", address)
    return (found[1] or found[2]) if found else ""


def _in_numbers(host: str) -> str:
    """An address as numbers, also short ones such as `0`, and this computer's name. No other name is looked up."""
    is_ours = host.lower() == socket.gethostname().lower()
    try:
        resolved = socket.getaddrinfo(host, None, flags=0 if is_ours else socket.AI_NUMERICHOST)
    except (OSError, UnicodeError):
        return ""
    return str(resolved[0][4][0])


def _is_own_and_open(host: str) -> bool:
    """Whether one could listen there, and others would reach it. Nothing is sent."""
    try:
        place = ipaddress.ip_address(_in_numbers(host))
    except ValueError:
        return False
    if place.is_loopback:
        return False
    with socket.socket(socket.AF_INET6 if place.version == 6 else socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((str(place), 0))
        except OSError:
            return False
    return True
