"""All laws and plants."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from . import laws
from .law import LAWS, Law
from .plant import Plant
from .plants import axis, efc, hpv41, sp08

PLANTS: dict[str, Plant] = {p.PLANT.name: p.PLANT for p in (hpv41, efc, sp08, axis)}


@cache
def all_laws() -> dict[str, Law]:
    """Every law by name."""
    for found in pkgutil.iter_modules(laws.__path__):
        importlib.import_module(f"{laws.__name__}.{found.name}")
    return dict(sorted(LAWS.items()))


def laws_of(effect: str, plant: str) -> list[str]:
    """Names of the laws by which an effect can show on a plant."""
    return [name for name, law in all_laws().items() if law.effect == effect and plant in law.largest]


def effects(listed: bool) -> list[str]:
    """Names of the contract's effects that have a law here, or of those on no list."""
    return sorted({law.effect for law in all_laws().values() if law.listed == listed})
