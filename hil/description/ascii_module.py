"""An ASCII module in the ADAM-4000 style, in words: which it is, and its channels."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hil.description.terminal import DescribedDevice, DescribedTerminal


class ModuleDescription(DescribedDevice[DescribedTerminal]):
    """A module with outputs or inputs, all alike.

    Attributes:
        module_name: the name that it gives itself when it is asked ($AAM).
        type_code: the code of the input or output type that its channels must be set to, such as "08".
        terminals: one row, numbered as the module numbers its channels.
    """

    protocol: Literal["ascii_module"]
    module_name: str
    type_code: str = Field(pattern="[0-9A-F]{2}")
    terminals: dict[str, DescribedTerminal] = Field(min_length=1, max_length=1)

    @property
    def channels(self) -> DescribedTerminal:
        """What its channels are."""
        return next(iter(self.terminals.values()))
