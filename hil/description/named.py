"""The part of a driver's settings that says which device it is: `model`, or a `description` in the bench file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from hil.bench.fault import BenchError
from hil.bench.lines import Place
from hil.description.find import description_file
from hil.description.read import checked, of_protocol, read_description
from hil.errors import HilError, SettingError


class Described(BaseModel):
    """Settings that name a description.

    Attributes:
        model: the name of an installed one, or a file beside the bench file (`acme-7.toml`).
        description: one that stands here.
    """

    model: str = ""
    description: dict[str, Any] | None = None


def description_of(settings: Described, protocol: str) -> Any:
    """The description that settings name: that of its protocol (`ModbusDescription` and the like).

    Raises:
        HilError: there is none, it has faults, or is of another protocol.
    """
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
        description_of(settings, protocol)
    except BenchError as error:
        yield from ((("model",), fault) for fault in error.faults)
    except HilError as error:
        yield ("model",), str(error)
