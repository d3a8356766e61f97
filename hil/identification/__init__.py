"""Numbers from recordings, with uncertainty: rooms by what is measured.

What a stranger's package imports from here by a name of before there were rooms is found in its room.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType

_ROOMS = ("uncertainty", "preparation", "steady", "step", "frequency", "grey_box", "papers")


class _InItsRoom(MetaPathFinder, Loader):
    """Finds `hil.identification.NAME` as `hil.identification.ROOM.NAME`: one module under both names."""

    def find_spec(
        self, fullname: str, _path: Sequence[str] | None = None, _target: ModuleType | None = None
    ) -> ModuleSpec | None:
        package, _, name = fullname.rpartition(".")
        rooms = _ROOMS if package == __name__ and name not in _ROOMS else ()
        places = (f"{__name__}.{room}.{name}" for room in rooms)
        place = next((place for place in places if find_spec(place) is not None), None)
        return None if place is None else ModuleSpec(fullname, self, loader_state=place)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = import_module(str(spec.loader_state))
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        own = module.__spec__
        if own is not None and isinstance(own.loader_state, ModuleSpec):
            module.__spec__ = own.loader_state


sys.meta_path.insert(0, _InItsRoom())  # before what a folder of before, left empty by an update, is taken for
