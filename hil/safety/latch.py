"""The latch: an interlock that tripped stays tripped until somebody resets it by its name."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from hil.errors import FileError, TrippedError, UnknownNameError, option
from hil.record.state import keep, state_path
from hil.untrusted import read_json

_ENDS = "find the cause; this trip ends with its run, as on every simulated bench, and needs no reset"


class Latch:
    """Trips by the name of their interlock. With a path they outlive the program, and a power cut.

    A file that cannot be read counts as a trip: what it held is not known.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path
        self._trips: dict[str, str] = _read(path) if path else {}

    @property
    def trips(self) -> dict[str, str]:
        """What tripped, and why."""
        return dict(self._trips)

    def trip(self, trips: Mapping[str, str]) -> None:
        """Latch why each of these interlocks trips.

        Raises:
            StorageError: it could not be kept for the next program; this one stays tripped all the same.
        """
        self._trips.update(trips)
        self._keep()

    def reset(self, name: str) -> None:
        """Forget a trip.

        Raises:
            UnknownNameError: nothing of that name has tripped.
        """
        if name not in self._trips:
            raise UnknownNameError("tripped interlock", name, self._trips)
        del self._trips[name]
        self._keep()

    def check(self) -> None:
        """Raise `TrippedError` while anything is tripped."""
        if self._trips:
            name, why = next(iter(self._trips.items()))
            kept = f"find the cause, then reset it with {option('reset')} '{name}'" if self._path else _ENDS
            raise TrippedError(f"{why}; {kept}")

    def _keep(self) -> None:
        if self._path is not None:
            keep(self._path, json.dumps(self._trips, indent=1, ensure_ascii=False), "the trips cannot be kept")


def latch_path(bench: str) -> Path:
    """Where the trips of a bench are kept."""
    return state_path("trips", bench, ".json")


def _read(path: Path) -> dict[str, str]:
    try:
        content = read_json(path)
        return {str(name): str(why) for name, why in content.items()}
    except FileNotFoundError:
        return {}
    except (OSError, FileError, AttributeError) as error:
        return {"unreadable": f"{path}: the kept trips cannot be read: {error}"}
