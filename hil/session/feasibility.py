"""Which procedures are feasible on a bench: each begins on its twin, up to where the first output would move."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn

from hil.bench.open import open_rig
from hil.bench.read import BenchFile
from hil.bench.rehearsal import twin_of
from hil.errors import HilError, RangeError
from hil.record.run_folder.progress import quiet
from hil.session.procedure import Procedure
from hil.session.setting import parse_settings

_MOVING = ("play", "stream", "hold", "ramp_to")


def infeasibility(procedure: Procedure, bench: BenchFile, rate_hz: float) -> str:
    """Why a procedure cannot run with its default settings; empty when it can.

    It checks channels, settings, rates and its whole path before anything moves, and is left there. Nothing is driven.

    Args:
        procedure: as it is installed.
        bench: on whose twin it begins.
        rate_hz: the most samples each second that the bench can make.
    """
    try:
        twin = twin_of(bench)
        with (
            TemporaryDirectory(prefix="hil-feasibility-") as folder,
            open_rig(twin, Path(folder) / "run", {}, quiet) as rig,
        ):
            procedure.run(_UpToTheFirstMove(rig, rate_hz), **parse_settings(procedure.settings, {}))
    except _WouldMoveError:
        return ""
    except HilError as error:
        return str(error)
    return ""


class _WouldMoveError(Exception):
    """The procedure has begun."""


class _UpToTheFirstMove:
    """A rig that is left where the first output would move, as fast as the bench is."""

    def __init__(self, rig: Any, rate_hz: float) -> None:
        self._rig, self._most_hz = rig, rate_hz

    def __getattr__(self, name: str) -> Any:
        return _begun if name in _MOVING else getattr(self._rig, name)

    @property
    def rate_hz(self) -> float:
        return self.actual_rate_hz()

    def actual_rate_hz(self, asked_hz: float | None = None) -> float:
        asked_hz = asked_hz or self._rig.rate_hz
        if asked_hz > self._most_hz:
            raise RangeError(f"sample rate {asked_hz:g} Hz: the bench makes {self._most_hz:.4g} Hz as measured")
        return self._rig.actual_rate_hz(asked_hz)


def _begun(*_values: Any, **_more: Any) -> NoReturn:
    raise _WouldMoveError
