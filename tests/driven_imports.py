"""A program of its own: run a procedure on a simulated bench, and tell what was imported or compiled while it drove.

    python tests/driven_imports.py PROCEDURE BENCH [NAME=VALUE …]

Prints one JSON object. What the simulated bench has loaded for itself does not hide what the procedure would load on a
real one: every import statement that is carried out counts, unless its module was there before the bench was.
"""

from __future__ import annotations

import builtins
import json
import sys
import tempfile
from collections.abc import Mapping, Sequence
from importlib.util import resolve_name
from pathlib import Path
from typing import Any

from numba.core import event

from hil.kernel import Compiled, _kernels
from hil.session.preload import preload
from hil.session.procedure import load_procedure
from hil.session.setting import parse_settings, split_assignments

HEAVY = ("scipy.signal", "scipy.stats", "scipy.ndimage", "pandas", "control")  # seconds, for what a run does without
OF_THE_SIMULATION = ("sim_devices", "hil.physics.compose", "hil_core_", "numba")


class Watch(event.Listener):
    """What is imported by whom, and what is compiled, while it is on."""

    def __init__(self, loaded: set[str]) -> None:
        self.on = False
        self.imported: set[str] = set()
        self.compiled: list[str] = []
        self._loaded = loaded
        self._import = builtins.__import__
        builtins.__import__ = self._watched
        event.register("numba:compile", self)

    def on_start(self, event: event.Event) -> None:
        if self.on:
            self.compiled.append(str(event.data.get("dispatcher")))

    def on_end(self, event: event.Event) -> None:
        """Began already."""

    def _watched(
        self,
        name: str,
        globals: Mapping[str, Any] | None = None,
        locals: Mapping[str, Any] | None = None,
        fromlist: Sequence[str] = (),
        level: int = 0,
    ) -> Any:
        module = self._import(name, globals, locals, fromlist, level)
        by = (globals or {}).get("__name__", "")
        whole = resolve_name("." * level + name, (globals or {}).get("__package__"))
        if self.on and not by.startswith(OF_THE_SIMULATION) and whole not in self._loaded:
            self.imported.add(f"{whole} by {by}")
        return module


def signatures(kernels: Sequence[Compiled]) -> int:
    """How many machine codes there are of some kernels."""
    return sum(len(made.dispatcher.signatures) for made in kernels)


def main(name: str, bench: str, *assignments: str) -> dict[str, Any]:
    procedure = load_procedure(name)
    preload(procedure.run)
    watch = Watch(set(sys.modules))
    own = [made for made, _ in _kernels]  # those that a simulated bench brings are no procedure's
    ready = signatures(own)
    from hil.bench.find import find_bench
    from hil.bench.open import open_rig
    from hil.bench.read import read_bench

    values = parse_settings(procedure.settings, split_assignments(assignments))
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        with open_rig(read_bench(find_bench(bench)), out, {"settings": values}, lambda _done, _text: None) as rig:
            watch.on = True
            procedure.run(rig, **values)
        watch.on = False
    heavy = [name for name in HEAVY if name in sys.modules]
    return {
        "imported": sorted(watch.imported), "compiled": watch.compiled, "kernels": [ready, signatures(own)],
        "heavy": heavy,
    }  # fmt: skip


if __name__ == "__main__":
    print(json.dumps(main(*sys.argv[1:])))
