"""The truth of a case: all that was concealed, and how large it shows. This is what is sealed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ..truth.catalog import PLANTS, all_laws
from ..truth.law import Hidden
from ..truth.noise import Colour
from ..truth.plant import Plant
from ..truth.simulate import Unit
from .label import Label, parse


@dataclass(frozen=True, slots=True)
class Truth:
    """A case.

    Attributes:
        unit: Base parameters of the healthy unit.
        changed_unit: Base parameters when the changed and the unseen recordings were made.
        hidden: Concealed laws.
        colour: Colour of the sensor's noise.
        key: First number of the case's recordings, for chance.
        intermediate: Whether channels between input and output are recorded too.
        sigma: Change of the output by each law alone, rms over the changed recordings, in noise deviations.
        distinct_sigma: What of it no change of base parameters can imitate (to first order).
        salt: Makes the seal unguessable.
    """

    label: Label
    seed: int
    unit: Mapping[str, float]
    changed_unit: Mapping[str, float]
    hidden: tuple[Hidden, ...]
    colour: Colour
    key: int
    intermediate: bool
    sigma: tuple[float, ...]
    distinct_sigma: tuple[float, ...]
    salt: str

    @property
    def plant(self) -> Plant:
        """The plant."""
        return PLANTS[self.label.plant]

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of what is concealed, as the contract has them."""
        return tuple(all_laws()[hidden.law].effect for hidden in self.hidden)

    @property
    def listed(self) -> bool:
        """Whether all of it has a name in the contract."""
        return all(all_laws()[hidden.law].listed for hidden in self.hidden)

    @property
    def predictable(self) -> bool:
        """Whether a perfect model could predict an unseen recording."""
        return all(all_laws()[hidden.law].predictable for hidden in self.hidden)

    def healthy(self) -> Unit:
        """The unit before anything happened to it."""
        return Unit(self.plant, self.unit)

    def afflicted(self) -> Unit:
        """The unit with all that is concealed in it."""
        return Unit(self.plant, self.changed_unit, self.hidden)


def to_json(truth: Truth) -> str:
    """Write a truth, with the meaning of its numbers beside them."""
    fields: dict[str, Any] = asdict(truth) | {"label": str(truth.label), "effects": truth.effects}
    fields["meaning"] = [all_laws()[hidden.law].meaning for hidden in truth.hidden]
    return json.dumps(fields, indent=1)


def from_json(text: str) -> Truth:
    """Read a truth back."""
    fields = json.loads(text)
    del fields["effects"], fields["meaning"]
    fields["label"] = parse(fields["label"])
    fields["hidden"] = tuple(Hidden(h["law"], tuple(h["parameters"])) for h in fields["hidden"])
    fields["colour"] = Colour(**fields["colour"])
    fields["sigma"] = tuple(fields["sigma"])
    fields["distinct_sigma"] = tuple(fields["distinct_sigma"])
    return Truth(**fields)
