"""The one way to open a device: it stays the one that was opened first, whatever comes to have its name."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from types import ModuleType
from typing import Any

from pydantic import BaseModel

from hil.daq.address import Port
from hil.daq.channel import Wiring
from hil.daq.contract import Daq
from hil.daq.link import Link
from hil.daq.polled import PolledDaq
from hil.errors import HardwareError


def opened_alone(module: ModuleType, settings: BaseModel, wiring: Wiring) -> Daq:
    """A device as a DAQ by itself: as its driver makes one, else its link in a loop."""
    if hasattr(module, "open_daq"):
        daq: Daq = module.open_daq(settings, wiring)
        return daq
    return PolledDaq({"device": module.open_link(settings, wiring)}, {"device": wiring})


@dataclass(slots=True)
class Pin:
    """Which device it is that a bench names: its port, and what it says that it is, as they were at the first opening.

    Another device that has its name is refused before anything is written to it, where its port tells or its driver
    asks; its own port is looked for by the serial number of its adapter. One that does not say what it is, and did
    before, is told its safe values all the same, and nothing that it says is believed.

    Attributes:
        module, settings: its driver, and how that reaches it.
        identity: what it said that it is.
    """

    module: ModuleType
    settings: BaseModel
    identity: str = ""
    _port: Port = field(init=False)

    def __post_init__(self) -> None:
        self._port = Port(str(getattr(self.settings, "address", "")))

    def link(self, wiring: Wiring) -> Link:
        """Its link.

        Raises:
            DeviceLostError: it is not there, or another one is.
            LinkError: it does not answer.
        """
        link: Link = self.module.open_link(self._found(), self._known(wiring))
        self._recognise(link, str(getattr(link, "identity", "")), wiring)
        return link

    def daq(self, wiring: Wiring) -> Daq:
        """The device alone as a DAQ. Raises as `link`."""
        daq = opened_alone(self.module, self._found(), self._known(wiring))
        for identity in getattr(daq, "identities", {}).values():
            self._recognise(daq, identity, wiring)
        return daq

    def doubt(self, identity: str) -> str:
        """Why nothing is believed of who says that it is this; empty where there is no doubt."""
        if not self.identity or identity == self.identity:
            return ""
        answer = f"another device answers: it says that it is {identity}" if identity else "it does not say what it is"
        return f"{answer}; {self.identity} was opened before"

    def _known(self, wiring: Wiring) -> Wiring:
        return replace(wiring, known_as=self.identity)

    def _found(self) -> BaseModel:
        """Its settings, with the path at which its adapter is now where its name leads to another one."""
        path, has_moved = self._port.now()
        return self.settings.model_copy(update={"address": path}) if has_moved else self.settings

    def _recognise(self, opened: Any, identity: str, wiring: Wiring) -> None:
        try:
            self._known(wiring).refuse_another(identity)
        except HardwareError:
            with suppress(Exception):
                opened.close()
            raise
        self.identity = self.identity or identity
