"""Numbers that decide stand in `Criteria`, those that say how widely is searched in `Effort`; the rest is owed."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import hil
from hil.diagnosis.criteria import Criteria
from hil.diagnosis.search.effort import Effort

HIL = Path(hil.__file__).parent
ROOM = HIL / "diagnosis"
FREE = (0, 1, 2, 0.5, 100)
"""Numbers that say nothing of their own: 100 is the factor of %. A minus is no part of a literal."""
OWED = 174
"""Literals that are left in the room and in the estimate of the noise. It may only fall."""


def literals(path: Path) -> list[float]:
    """Numbers of a module that are neither free, nor an index, nor digits of a rounding, nor how far progress is."""
    found: list[float] = []

    def walk(node: ast.AST) -> None:
        if isinstance(node, ast.Constant) and type(node.value) in (int, float) and node.value not in FREE:
            found.append(node.value)
        for child in _telling(node):
            walk(child)

    walk(ast.parse(path.read_text("utf-8")))
    return found


def _telling(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.Subscript):
        yield node.value
    elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("round", "work.at", "problem.work.at"):
        yield node.args[ast.unparse(node.func) != "round"]
    else:
        yield from ast.iter_child_nodes(node)


@pytest.mark.parametrize(
    "module",
    ["verdict/changed", "verdict/choice", "verdict/explain", "question", "verdict/score", "verdict/within_prior",
     "search/beam", "search/fits", "search/fitted", "search/probes", "events/event"],
)  # fmt: skip
def test_what_reads_the_verdict_has_no_numbers_of_its_own(module):
    assert literals(ROOM / f"{module}.py") == []


def test_numbers_of_the_room_become_no_more():
    homes = (ROOM / "criteria.py", ROOM / "search" / "effort.py")
    modules = [*ROOM.rglob("*.py"), HIL / "identification" / "uncertainty" / "noise.py"]
    assert sum(len(literals(path)) for path in modules if path not in homes) <= OWED
    assert len(Criteria.__slots__) <= 8
    assert len(Effort.__slots__) <= 15
