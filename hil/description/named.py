"""The part of a driver's settings that says which device it is: `model`, or a `description` in the bench file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, overload

from pydantic import BaseModel

from hil.bench.fault import BenchError
from hil.bench.lines import Place
from hil.daq.channel import Terminal
from hil.description.ascii_module import ModuleDescription
from hil.description.can import CanDescription
from hil.description.canopen import CanopenDescription
from hil.description.find import description_file
from hil.description.modbus import ModbusDescription
from hil.description.read import Description, checked, of_protocol, read_description
from hil.description.text import TextDescription
from hil.errors import HilError, SettingError


class Described(BaseModel):
    """Settings that name a description.

    Attributes:
        model: the name of an installed one, or a file beside the bench file (`acme-7.toml`).
        description: one that stands here.
    """

    model: str = ""
    description: dict[str, Any] | None = None


@overload
def description_of(settings: Described, protocol: Literal["modbus"]) -> ModbusDescription: ...


@overload
def description_of(settings: Described, protocol: Literal["canopen"]) -> CanopenDescription: ...


@overload
def description_of(settings: Described, protocol: Literal["can"]) -> CanDescription: ...


@overload
def description_of(settings: Described, protocol: Literal["ascii_module"]) -> ModuleDescription: ...


@overload
def description_of(settings: Described, protocol: Literal["text", "scpi"]) -> TextDescription: ...


def description_of(settings: Described, protocol: str) -> Description:
    """The description that settings name.

    Raises:
        HilError: there is none, it has faults, or is of another protocol.
    """
    return _described(settings, protocol)


def ports_of(settings: Described, protocol: str) -> dict[str, Terminal]:
    """The terminals of the description that settings name; none while it has faults."""
    try:
        return _described(settings, protocol).ports
    except HilError:
        return {}


def expired_levels(description: CanDescription | CanopenDescription) -> dict[str, float]:
    """Where all outputs of a device go when its watchdog expires, by terminal; nothing where that is not said."""
    return {} if description.watchdog is None else dict.fromkeys(description.outputs, description.watchdog.expires_to)


def _described(settings: Described, protocol: str) -> Description:
    if settings.description is None:
        if not settings.model:
            raise SettingError("model is missing: an installed description, or a file such as acme-7.toml")
        return of_protocol(read_description(description_file(settings.model)), protocol, settings.model)
    found, faults = checked({"protocol": protocol, **settings.description})
    if found is None:
        raise SettingError("; ".join(f"description.{'.'.join(map(str, f.place))}: {f.text}" for f in faults))
    return of_protocol(found, protocol, "description")


def description_faults(settings: Described, protocol: str) -> Iterator[tuple[Place, str]]:
    """What is wrong with what they name, with its place in the settings."""
    if settings.description is not None:
        if settings.model:
            yield ("model",), "model, or a description that stands here, not both"
        _, faults = checked({"protocol": protocol, **settings.description})
        yield from ((("description", *fault.place), fault.text) for fault in faults)
        return
    try:
        _described(settings, protocol)
    except BenchError as error:
        yield from ((("model",), fault) for fault in error.faults)
    except HilError as error:
        yield ("model",), str(error)
