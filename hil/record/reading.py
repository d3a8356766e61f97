"""How a recording is to be read: what its user knows and its file does not say, or says otherwise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from hil.errors import SettingError, UnitError, option
from hil.units import check_unit

LEFT_OUT = "-"


@dataclass(frozen=True, slots=True)
class Reading:
    """Options that every reader takes.

    Attributes:
        time: name of the column that holds the time.
        interval_s: the samples lie so far apart, whatever the file says; 0 leaves it to the file.
        units: of channels by name, whatever the file says; nothing is converted. `time` is the time's.
        renamed: new names of channels by their old ones.
        gaps: whether a single field that is empty, or a line that is cut off, is a sample that was not taken.
        columns: names of the columns in their order, for files without headings; `-` leaves one out.

    Raises:
        UnitError: a unit is unknown. SettingError: an interval that is none.
    """

    time: str = ""
    interval_s: float = 0.0
    units: Mapping[str, str] = field(default_factory=dict)
    renamed: Mapping[str, str] = field(default_factory=dict)
    columns: tuple[str, ...] = ()
    gaps: bool = False

    def __post_init__(self) -> None:
        """Name the option that cannot be."""
        if not 0.0 <= self.interval_s < math.inf:
            asked = option("interval", str(self.interval_s))
            raise SettingError(f"{asked}: seconds from one sample to the next are above 0, or 0")
        for name, unit in self.units.items():
            try:
                check_unit(unit)
            except UnitError as error:
                raise UnitError(f"{option('unit', f'{name}={unit}')}: {error}") from None


AS_IT_IS = Reading()
