"""Everything that a run will need is imported and compiled before its first output moves.

An import or a compilation in the middle of a run holds the interpreter for a second in which nothing is judged while
the valve stands open.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

from hil.kernel import compile_kernels
from hil.record.run_folder.header import End
from hil.units import units_ready

_LATER_ANYHOW = ("numpy.fft", "numpy.polynomial", "numpy.random")  # numpy imports them when they are asked for
# Exports, pictures and text files of others, which nothing of ours wants while it drives, and libraries of links, which
# are there once a bench is open, where it needs them: half a second to two each.
_NEVER_WHILE_DRIVEN = frozenset({"can", "control", "matplotlib", "pandas", "serial", "xarray"})


def preload(run: Callable[..., Any]) -> None:
    """Import whatever the modules of a procedure import anywhere, also within functions, and compile all kernels.

    The procedure's own package is followed, and this program; of other packages what is named there is imported, but
    what this program itself names only for pictures and files.

    Args:
        run: a function of the procedure.
    """
    followed = {_package(run.__module__), _package(__name__)}
    todo, seen = [run.__module__], set[str]()
    while todo:
        name = todo.pop()
        if name in seen:
            continue
        seen.add(name)
        module = _imported(name)
        if module is not None and _package(name) in followed:
            todo += _imports_of(module, _NEVER_WHILE_DRIVEN if _package(name) == _package(__name__) else ())
    for name in _LATER_ANYHOW:
        _imported(name)
    units_ready()
    End.model_rebuild()  # its schema is built when it is first used: that was where a run is closed
    compile_kernels()


def _imported(name: str) -> ModuleType | None:
    """A module; None where none of that name can be imported: an extra that is not installed, say."""
    with suppress(Exception):
        return sys.modules.get(name) or importlib.import_module(name)
    return None


def _package(module: str) -> str:
    return module.partition(".")[0]


def _imports_of(module: ModuleType, left_out: Collection[str]) -> Iterator[str]:
    """What a module imports, wherever it does; of `from a import b` both `a` and `a.b`, which may be a module too."""
    path = Path(getattr(module, "__file__", None) or "")
    if path.suffix != ".py":
        return
    for node in _statements(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if _package(alias.name) not in left_out)
        elif isinstance(node, ast.ImportFrom):
            start = importlib.util.resolve_name("." * node.level + (node.module or ""), module.__package__)
            if _package(start) in left_out:
                continue
            yield start
            whole = _imported(start)
            parts = {alias.name: getattr(whole, alias.name, None) for alias in node.names}
            yield from (
                f"{start}.{name}" for name, part in parts.items() if part is None or isinstance(part, ModuleType)
            )


def _statements(tree: ast.AST) -> Iterator[ast.AST]:
    """Every statement but those that only type checkers see."""
    todo = [tree]
    while todo:
        node = todo.pop()
        yield node
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        for part in ("body", "orelse", "finalbody", "handlers", "cases"):
            todo += getattr(node, part, ())
