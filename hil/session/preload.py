"""Everything that a run will need is imported and compiled before its first output moves.

An import or a compilation in the middle of a run holds the interpreter for a second in which nothing is judged while
the valve stands open.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

from hil.kernel import compile_kernels
from hil.units import units_ready

_LATER_ANYHOW = ("numpy.fft", "numpy.polynomial", "numpy.random")  # numpy imports them when they are asked for
_NEVER_WHILE_DRIVEN = frozenset({"control"})  # exports only; takes seconds


def preload(run: Callable[..., Any]) -> None:
    """Import whatever the modules of a procedure import anywhere, also within functions, and compile all kernels.

    The procedure's own package is followed, and this program; of other packages what is named there is imported.

    Args:
        run: a function of the procedure.
    """
    followed = {run.__module__.partition(".")[0], __name__.partition(".")[0]}
    todo, seen = [run.__module__], set[str]()
    while todo:
        name = todo.pop()
        if name in seen or name.partition(".")[0] in _NEVER_WHILE_DRIVEN:
            continue
        seen.add(name)
        module = _imported(name)
        if module is not None and name.partition(".")[0] in followed:
            todo += _imports_of(module)
    for name in _LATER_ANYHOW:
        _imported(name)
    units_ready()
    compile_kernels()


def _imported(name: str) -> ModuleType | None:
    """A module; None where none of that name can be imported: an extra that is not installed, say."""
    with suppress(Exception):
        return sys.modules.get(name) or importlib.import_module(name)
    return None


def _imports_of(module: ModuleType) -> Iterator[str]:
    """What a module imports, wherever it does; of `from a import b` both `a` and `a.b`, which may be a module too."""
    path = Path(getattr(module, "__file__", None) or "")
    if path.suffix != ".py":
        return
    for node in _statements(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            start = importlib.util.resolve_name("." * node.level + (node.module or ""), module.__package__)
            yield start
            whole = _imported(start)
            parts = {alias.name: getattr(whole, alias.name, None) for alias in node.names}
            yield from (
                f"{start}.{name}" for name, part in parts.items() if part is None or isinstance(part, ModuleType)
            )


def _statements(tree: ast.AST) -> Iterator[ast.AST]:
    """Every node but those that only type checkers see."""
    for node in ast.iter_child_nodes(tree):
        yield node
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        yield from _statements(node)
