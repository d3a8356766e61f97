"""What a case is called; with the seed, the label is all that is needed to make the case again."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

NOTHING = "none"
PARAMETER = "parameter_change"
PAIR = "pair"
THREE = "three"
TOGETHER = {PAIR: 2, THREE: 3}
"""How many effects a kind of case puts together."""
SEVERITIES = {"full": 1.0, "half": 0.5, "quarter": 0.25, "eighth": 0.125}


@dataclass(frozen=True, slots=True, order=True)
class Label:
    """Kind (an effect, one on no list, `pair`, `three`, `parameter_change` or `none`), plant, severity and number."""

    kind: str
    plant: str
    severity: str
    number: int

    def __str__(self) -> str:
        return f"{self.kind}.{self.plant}.{self.severity}.{self.number:03d}"

    def words(self, seed: int) -> list[int]:
        """Return entropy that is this case's own."""
        digest = hashlib.sha256(str(self).encode()).digest()
        return [seed, *(int.from_bytes(digest[i : i + 4], "big") for i in range(0, 16, 4))]

    def veiled(self, seed: int) -> str:
        """Return a folder name that tells nothing."""
        return "case-" + hashlib.sha256(f"{seed} {self}".encode()).hexdigest()[:10]


def parse(text: str) -> Label:
    """Read a label back."""
    kind, plant, severity, number = text.split(".")
    return Label(kind, plant, severity, int(number))
