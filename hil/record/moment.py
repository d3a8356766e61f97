"""A date and time in a file: with its zone, and shown in any other."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import AfterValidator, AwareDatetime


def _shown_anywhere(moment: datetime) -> datetime:
    if not 1 < moment.year < 9999:
        raise ValueError("a year between 2 and 9998 was expected, which every time zone has")
    return moment


Moment = Annotated[AwareDatetime, AfterValidator(_shown_anywhere)]
