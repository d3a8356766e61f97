"""Write down in C what a plain Python function of parameters computes, by running it on symbols.

`coefficients` and `initial` of a plant are Python over dictionaries, not compiled. Each path through their branches is
run once; what it computed becomes lines of C under the tests that lead to it.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextvars import ContextVar
from typing import Any, Literal

from hil.fmu.c_types import UntranslatableError, indented, number
from hil.fmu.translate import Unit

_MOST_BRANCHES = 12
_LINEAR = "hil.physics.linear"  # its functions become C functions of their own
Given = Mapping[str, Any]


class _Path:
    """One way through the branches: what was decided, and the lines on the way.

    A line is ("if", test) or ("do", text).
    """

    def __init__(self, decided: Sequence[bool]) -> None:
        self.decided = decided
        self.tests = 0
        self.lines: list[tuple[Literal["if", "do"], str]] = []
        self.names = 0

    def let(self, text: str) -> Symbol:
        """A new name for what a text computes."""
        name = self.name()
        self.lines.append(("do", f"double {name} = {text};"))
        return Symbol(name)

    def name(self) -> str:
        """A name that nothing has."""
        self.names += 1
        return f"w{self.names}"

    def decide(self, test: str) -> bool:
        """The side of a test that this path takes."""
        self.tests += 1
        if self.tests > _MOST_BRANCHES:
            raise UntranslatableError(f"more than {_MOST_BRANCHES} branches on the way to the coefficients")
        self.lines.append(("if", test))
        return self.decided[self.tests - 1] if self.tests <= len(self.decided) else True


_path: ContextVar[_Path] = ContextVar("path")


class Test:
    """A comparison of symbols; asked for its truth, the path decides."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __bool__(self) -> bool:
        return _path.get().decide(self.text)

    def __float__(self) -> float:
        return float(bool(self))

    def __invert__(self) -> Test:
        return Test(f"!({self.text})")


class Symbol:
    """A number that is known when the C code runs."""

    __hash__ = None  # type: ignore[assignment]

    def __init__(self, text: str) -> None:
        self.text = text

    def __float__(self) -> float:
        raise UntranslatableError(f"the value of {self.text} is needed before the C code runs")

    def __neg__(self) -> Symbol:
        return _path.get().let(f"-{self.text}")

    def __abs__(self) -> Symbol:
        return _path.get().let(f"fabs({self.text})")

    def __pow__(self, power: Any) -> Symbol:
        return _path.get().let(f"square({self.text})" if power == 2 else f"pow({self.text}, {_text(power)})")

    def __rpow__(self, base: Any) -> Symbol:
        return _path.get().let(f"pow({_text(base)}, {self.text})")


def _arithmetic(sign: str, swapped: bool) -> Callable[[Symbol, Any], Any]:
    def operator(self: Symbol, other: Any) -> Any:
        if not isinstance(other, Symbol | int | float):
            return NotImplemented
        left, right = (other, self) if swapped else (self, other)
        return _path.get().let(f"{_text(left)} {sign} {_text(right)}")

    return operator


def _comparison(sign: str) -> Callable[[Symbol, Any], Test]:
    return lambda self, other: Test(f"{self.text} {sign} {_text(other)}")


for _name, _sign in (("add", "+"), ("sub", "-"), ("mul", "*"), ("truediv", "/")):
    setattr(Symbol, f"__{_name}__", _arithmetic(_sign, swapped=False))
    setattr(Symbol, f"__r{_name}__", _arithmetic(_sign, swapped=True))
for _name, _sign in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "=="), ("ne", "!=")):
    setattr(Symbol, f"__{_name}__", _comparison(_sign))


class _Maths:
    """The module `math`, on symbols too."""

    pi, inf, nan = math.pi, math.inf, math.nan

    def __getattr__(self, name: str) -> Callable[..., Any]:
        real = getattr(math, name)

        def function(*given: Any) -> Any:
            if not any(isinstance(one, Symbol) for one in given):
                return real(*given)
            text = f"{name}({', '.join(map(_text, given))})"
            return Test(text) if name.startswith("is") else _path.get().let(text)

        return function


_MATHS = _Maths()


def symbolic(unit: Unit, function: Callable[..., Any], seen: dict[Any, Any] | None = None) -> Callable[..., Any]:
    """The function with its globals exchanged: maths on symbols, the linear stages as functions of the C unit."""
    seen = {} if seen is None else seen
    if function in seen:
        return seen[function]  # type: ignore[no-any-return]
    if not isinstance(function, types.FunctionType):
        raise UntranslatableError(f"{function!r} is no function of Python")
    names = dict(function.__globals__)
    made = types.FunctionType(function.__code__, names, function.__name__, function.__defaults__, function.__closure__)
    made.__kwdefaults__ = function.__kwdefaults__
    seen[function] = made
    for name in function.__code__.co_names:
        names[name] = _exchanged(unit, names.get(name), seen) if name in names else None
        if names[name] is None:
            del names[name]
    return made


def _exchanged(unit: Unit, value: Any, seen: dict[Any, Any]) -> Any:
    if value is math:
        return _MATHS
    if isinstance(value, types.FunctionType) and value.__module__ == _LINEAR:
        return _helper(unit, value)
    if isinstance(value, types.FunctionType) and value.__module__.startswith("hil."):
        return symbolic(unit, value, seen)
    if isinstance(value, types.ModuleType) and value.__name__.startswith("hil."):
        inner = {k: _exchanged(unit, v, seen) for k, v in vars(value).items() if isinstance(v, types.FunctionType)}
        return types.SimpleNamespace(**{**vars(value), **inner})
    return value


def _helper(unit: Unit, function: types.FunctionType) -> Callable[..., Any]:
    def call(*given: Any) -> Any:
        if not any(isinstance(one, Symbol) for one in given):
            return function(*given)
        if math.inf in [
            one for one in given if isinstance(one, float)
        ]:  # the steady state: a constant whatever the rest
            return function(*[1.0 if isinstance(one, Symbol) else one for one in given])
        made = unit.function(function, ("f",) * len(given))
        arguments, path = ", ".join(map(_text, given)), _path.get()
        if made.result is None or not made.result.startswith("T"):
            return path.let(f"{made.name}({arguments})")
        count, several = int(made.result[1:]), path.name()
        path.lines.append(("do", f"double {several}[{count}]; {made.name}({arguments}, {several});"))
        return tuple(Symbol(f"{several}[{i}]") for i in range(count))

    return call


def written(run: Callable[[], Given], targets: Callable[[Given], Iterable[tuple[str, str]]]) -> list[str]:
    """Lines of C that store what `run` computes.

    Args:
        run: calls a function of `symbolic` on symbols.
        targets: (name in the outcome, C place) of each value to store.

    Raises:
        UntranslatableError: the function needs a value that is not known yet.
    """
    return _lines_after(run, targets, [], 0)


def _lines_after(
    run: Callable[[], Given], targets: Callable[[Given], Iterable[tuple[str, str]]], decided: list[bool], first: int
) -> list[str]:
    """The lines from the `first`-th test of a path on; its next test opens both sides."""
    path = _Path(decided)
    token = _path.set(path)
    try:
        outcome = run()
        stored = [f"{place} = {_text(outcome[name])};" for name, place in targets(outcome)]
    finally:
        _path.reset(token)
    lines: list[str] = []
    seen = 0
    for kind, text in path.lines:
        if kind == "if":
            seen += 1
            if seen > len(decided):
                yes, no = (_lines_after(run, targets, [*decided, side], seen) for side in (True, False))
                return [*lines, f"if ({text}) {{", *indented(yes), "} else {", *indented(no), "}"]
        elif seen >= first:
            lines.append(text)
    return [*lines, *stored]


def _text(value: Any) -> str:
    return value.text if isinstance(value, Symbol | Test) else number(float(value))
