"""`python -m tests.proof.numbers`: numbers that stand in the code of a diagnosis, and its lines, counted by room.

Counted is what a diagnosis runs of `hil.diagnosis` and `hil.identification`: numbers that have a name at the head of a
file, defaults, and those that stand in an expression. 0, 1, 2, a half and their negatives count as grammar, and so do
numbers below a millionth, which keep a quotient from failing, tens that convert a unit, and places of an array.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import typer

from hil.diagnosis import diagnose as _everything  # noqa: F401  what a diagnosis imports is what is counted

ROOMS = ("hil.diagnosis", "hil.identification")
# Files of the diagnosis in which a verdict is made or overruled.
DECIDING = ("answer", "choice", "criteria", "explain", "measures", "named", "refuted", "score", "thresholds")
_GRAMMAR, _TINY = {0.0, 0.5, 1.0, 2.0, 10.0, 60.0, 100.0, 1000.0}, 1e-6


@dataclass(frozen=True, slots=True)
class Count:
    """Of one file: numbers with a name, defaults, those in expressions, and lines that are not empty."""

    named: int
    defaults: int
    in_expressions: int
    lines: int


def counted(source: str) -> Count:
    """The numbers of a file."""
    tree = ast.parse(source)
    named = [n for node in tree.body if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None
             and _is_constant(node) for n in _numbers(node.value, grammar=True)]  # fmt: skip
    defaults = [n for node in ast.walk(tree) if isinstance(node, ast.arguments)
                for d in (*node.defaults, *node.kw_defaults) if d is not None for n in _numbers(d)]  # fmt: skip
    inside = [n for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) for part in node.body
              for n in _numbers(part)]  # fmt: skip
    return Count(len(named), len(defaults), len(inside), sum(bool(line.strip()) for line in source.splitlines()))


def _is_constant(node: ast.Assign | ast.AnnAssign) -> bool:
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    names = [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]
    return all(name.isupper() for name in names)


def _numbers(node: ast.AST, *, grammar: bool = False) -> Iterator[float]:
    if isinstance(node, ast.Subscript):
        yield from _numbers(node.value, grammar=grammar)
        return
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        size = abs(float(node.value))
        if grammar or (size not in _GRAMMAR and not 0.0 < size < _TINY):
            yield float(node.value)
    for child in ast.iter_child_nodes(node):
        yield from _numbers(child, grammar=grammar)


def files(room: str) -> dict[str, Path]:
    """The loaded modules of a room and their files."""
    found = {name: module.__file__ for name, module in sys.modules.items() if name.startswith(room + ".")}
    return {name: Path(path) for name, path in sorted(found.items()) if path}


def main(by_file: bool = typer.Option(False, "--by-file", help="A line for every file.")) -> None:
    """Count, and print a line for each room."""
    for room in ROOMS:
        counts = {name: counted(path.read_text(encoding="utf-8")) for name, path in files(room).items()}
        if by_file:
            for name, count in counts.items():
                print(_line(name, [count]))
        print(_line(room, list(counts.values())))
        if room == ROOMS[0]:
            chosen = [c for name, c in counts.items() if name.rpartition(".")[2] in DECIDING]
            print(_line("  where a verdict is made", chosen))


def _line(name: str, counts: list[Count]) -> str:
    named, defaults, inside, lines = (sum(getattr(c, f) for c in counts) for f in Count.__dataclass_fields__)
    return f"{name:44} {named:4} named, {defaults:3} defaults, {inside:3} in expressions, {lines:5} lines"


if __name__ == "__main__":
    typer.run(main)
