"""What makes sense together in a bench file: each rule is a small function that yields its faults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from hil.arrays import ROUNDING
from hil.bench.check_channels import channel_faults, emergency_stop_faults, terminals_used_once
from hil.bench.check_interlocks import interlock_faults, known_channel
from hil.bench.device import DeviceInUse, mixes, model_path
from hil.bench.draft import Draft
from hil.bench.fault import Fault
from hil.bench.file import CONDITIONS
from hil.catalog import find, models
from hil.daq.address import address_fault
from hil.errors import HilError


def faults_of(draft: Draft, devices: Mapping[str, DeviceInUse], folder: Path) -> Iterator[Fault]:
    """Everything that does not make sense together. Nothing is said about entries that have faults already."""
    yield from _plant(draft, folder)
    yield from _valve_limits(draft)
    yield from _devices_that_mix(draft, devices)
    yield from _addresses(devices)
    yield from _roles(draft)
    yield from terminals_used_once(draft)
    for name, channel in draft.channels.items():
        yield from channel_faults(name, channel, draft, devices)
        yield from emergency_stop_faults(name, channel, draft, devices)
    for name, interlock in draft.interlocks.items():
        yield from interlock_faults(name, interlock, draft, devices)
    for i, instrument in enumerate(draft.instruments):
        if instrument.channel:
            yield from known_channel(("instruments", i, "channel"), instrument.channel, draft)
    yield from _named_procedures(draft)
    yield from _samples_in_a_block(draft)
    yield from _shutdown_order(draft)
    for name in draft.simulation.get("instruments", {}):
        yield from known_channel(("simulation", "instruments", name), name, draft)


def _plant(draft: Draft, folder: Path) -> Iterator[Fault]:
    if draft.valve is None:
        return
    plant = model_path(draft.valve.plant, folder)
    try:
        if plant.endswith(".json"):
            if not Path(plant).is_file():
                yield Fault(("valve", "plant"), f"no model file {plant}; it is looked for beside the bench file")
        elif plant not in models():
            find("plants", plant)
    except HilError as error:
        yield Fault(("valve", "plant"), str(error))


def _valve_limits(draft: Draft) -> Iterator[Fault]:
    limits = draft.valve.limits if draft.valve else None
    for name, channel in draft.channels.items():
        safe = channel.safe
        if limits is None or safe is None or channel.role != "command":
            continue
        if not limits.low <= safe <= limits.high:
            text = f"{limits.low:g} … {limits.high:g} leaves out the safe value {safe:g} of '{name}'"
            yield Fault(("valve", "limits"), text)


def _samples_in_a_block(draft: Draft) -> Iterator[Fault]:
    if draft.sample_rate_hz is not None and draft.sample_rate_hz * draft.protection.block_s < 1.0 - ROUNDING:
        yield Fault(
            ("protection", "block_s"),
            f"{draft.protection.block_s:g} s, but at sample_rate_hz = {draft.sample_rate_hz:g} a sample comes each "
            f"{1.0 / draft.sample_rate_hz:.4g} s; inputs cannot be judged more often than that",
        )


def _shutdown_order(draft: Draft) -> Iterator[Fault]:
    place, order = ("protection", "shutdown_order"), draft.protection.shutdown_order
    for name in order:
        yield from known_channel(place, name, draft)
        if name in draft.channels and not draft.channels[name].is_output:
            yield Fault(place, f"'{name}' is an input; only outputs are made safe")
    if len(set(order)) < len(order):
        yield Fault(place, "an output is named twice")


def _named_procedures(draft: Draft) -> Iterator[Fault]:
    for section, named in (("acceptance", draft.acceptance), ("presets", draft.presets)):
        for name in named:
            try:
                find("procedures", name)
            except HilError as error:
                yield Fault((section, name), str(error))


def _devices_that_mix(draft: Draft, devices: Mapping[str, DeviceInUse]) -> Iterator[Fault]:
    if len(draft.devices) < 2:
        return
    for name, device in devices.items():
        if not mixes(device.module):
            yield Fault(
                ("devices", name),
                "times its samples by itself and cannot share a bench with other devices; those that the host polls "
                "over a link can",
            )


def _addresses(devices: Mapping[str, DeviceInUse]) -> Iterator[Fault]:
    for name, device in devices.items():
        if text := address_fault(str(getattr(device.settings, "address", ""))):
            yield Fault(("devices", name, "address"), text)


def _roles(draft: Draft) -> Iterator[Fault]:
    adjusted = [(role, True) for role in CONDITIONS]
    for role, wants_output in (("command", True), ("response", False), *adjusted):
        having = [name for name, channel in draft.channels.items() if channel.role == role]
        if not having and role not in CONDITIONS and not any(place[0] == "channels" for place in draft.faulty):
            yield Fault(("channels",), f'no channel has role = "{role}"; exactly one needs it')
        for name in having[1:]:
            yield Fault(("channels", name, "role"), f"'{having[0]}' is the {role} already; exactly one is")
        for name in having:
            channel = draft.channels[name]
            if channel.is_output != wants_output and channel.by_hand is None:
                text = "an output, with a safe value" if wants_output else "an input, without a safe value"
                text += ", or an input with by_hand" if role in CONDITIONS else ""
                yield Fault(("channels", name, "role"), f"the {role} is {text}")
