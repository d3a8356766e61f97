"""Translate the compiled subset of Python (kernels, effects, their helpers) to C99.

What numba compiles of a page is arithmetic on numbers and arrays, branches and counted loops; each construct has one
C form. Types are found by going over a function until they stay. Anything else is refused with its line.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hil.fmu.c_types import C_TYPES, FUNCTIONS, ITEMS, STRUCTS, UntranslatableError, indented, number
from hil.record.recording import Array

_ROUNDS = 6  # over a function until its types stay
_BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*"}
_COMPARED = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
Typed = tuple[str, str]
"""C text and the letter of its type."""


class Unit:
    """A C file: functions, each translated once for each signature, and the arrays that they read."""

    def __init__(self) -> None:
        self._constants: dict[int, tuple[str, Array]] = {}
        self._functions: dict[tuple[Any, tuple[str, ...]], Translated] = {}
        self._texts: list[str] = []

    @property
    def text(self) -> str:
        """Everything, in an order that C accepts."""
        arrays = [
            f"static double {name}[] = {{{', '.join(map(number, values.ravel()))}}};"
            for name, values in self._constants.values()
        ]
        return "\n".join([*arrays, *self._texts])

    def constant(self, values: Array) -> str:
        """A module's array."""
        name, kept = self._constants.setdefault(id(values), (f"constant_{len(self._constants)}", values))
        return f"((Vec){{{name}, {kept.size}}})"

    def function(self, function: Callable[..., Any], types: tuple[str, ...]) -> Translated:
        """A compiled function for arguments of these types."""
        plain = getattr(function, "py_func", function)
        key = (plain, types)
        if key not in self._functions:
            name = f"{plain.__module__.rsplit('.', 1)[-1]}_{plain.__name__.lstrip('_')}_{len(self._functions)}"
            node = ast.parse(textwrap.dedent(inspect.getsource(plain))).body[0]
            if not isinstance(node, ast.FunctionDef):
                raise UntranslatableError(f"{plain.__name__}: a function was expected")
            self._functions[key] = self.translated(node, types, plain.__globals__, name)
        return self._functions[key]

    def translated(
        self, node: ast.FunctionDef, types: tuple[str, ...], names: Mapping[str, Any], name: str
    ) -> Translated:
        """A function given as a syntax tree, with the names of its module."""
        made = Translated(self, node, types, names, name)
        self._texts.append(made.text)
        return made


class Translated:
    """One function in C. `result` is the letter of what it returns, None for nothing, `Tn` for n numbers.

    Raises:
        UntranslatableError: something in it has no C form.
    """

    def __init__(
        self, unit: Unit, node: ast.FunctionDef, types: tuple[str, ...], names: Mapping[str, Any], name: str
    ) -> None:
        self.name = name
        self.result: str | None = None
        self._unit, self._names = unit, names
        self._arguments = [argument.arg for argument in node.args.args]
        self._types = dict(zip(self._arguments, types, strict=True))
        self._temporaries = 0
        self.text = self._translated(node.body)

    def _translated(self, body: Sequence[ast.stmt]) -> str:
        self._probing = True
        for _ in range(_ROUNDS):
            before = dict(self._types)
            self._block(body)
            if before == self._types:
                break
        self._probing = False
        lines = self._block(body)
        local = [
            f"{C_TYPES[kind]} v_{name} = {'{0}' if kind in STRUCTS else '0'};"
            for name, kind in self._types.items()
            if name not in self._arguments
        ]
        parameters = [f"{C_TYPES[self._types[name]]} v_{name}" for name in self._arguments]
        several = self.result is not None and self.result.startswith("T")
        returned = "void" if self.result is None or several else C_TYPES[self.result]
        parameters += ["double *result"] if several else []
        head = f"static {returned} {self.name}({', '.join(parameters)})"
        return "\n".join([head, "{", *indented([*local, *lines]), "}"])

    def _refuse(self, node: ast.AST, why: str = "") -> UntranslatableError:
        text = ast.unparse(node)
        return UntranslatableError(f"{self.name}: {why or type(node).__name__} has no translation to C: {text:.80}")

    def _joined(self, one: str | None, other: str | None) -> str:
        if one is None or other is None or one == other:
            return one or other or "f"
        if {one, other} <= set("fib"):
            return "f" if "f" in (one, other) else "i"
        raise UntranslatableError(f"{self.name}: a value is both {C_TYPES[one]} and {C_TYPES[other]}")

    def _temporary(self, kind: str) -> str:
        self._temporaries += 1
        return f"{kind}{self._temporaries}"

    # -- statements ----------------------------------------------------------------------------------------

    def _block(self, body: Sequence[ast.stmt]) -> list[str]:
        return [line for statement in body for line in self._statement(statement)]

    def _statement(self, node: ast.stmt) -> list[str]:
        match node:
            case ast.Expr(value=ast.Constant()):
                return []
            case ast.Assign(targets=targets, value=value):
                return [line for target in targets for line in self._assignment(target, value)]
            case ast.AugAssign(target=target, op=op, value=value):
                loaded = ast.parse(ast.unparse(target), mode="eval").body
                return self._assigned(target, *self._expression(ast.BinOp(loaded, op, value)))
            case ast.If():
                return self._if(node)
            case ast.While(test=test, body=body):
                return [f"while ({self._expression(test)[0]}) {{", *indented(self._block(body)), "}"]
            case ast.For():
                return self._for(node)
            case ast.Return():
                return self._return(node)
        raise self._refuse(node)

    def _assignment(self, target: ast.expr, value: ast.expr) -> list[str]:
        if not isinstance(target, ast.Tuple):
            return self._assigned(target, *self._expression(value))
        if isinstance(value, ast.Tuple):
            return self._swapped(target.elts, value.elts)
        if not isinstance(value, ast.Call):
            raise self._refuse(value)
        function, arguments = self._callee(value)
        several = self._temporary("several")
        lines = [f"double {several}[{len(target.elts)}];", f"{function.name}({', '.join([*arguments, several])});"]
        for i, element in enumerate(target.elts):
            lines += self._assigned(element, f"{several}[{i}]", "f")
        return ["{", *indented(lines), "}"]

    def _swapped(self, targets: Sequence[ast.expr], values: Sequence[ast.expr]) -> list[str]:
        """All right-hand sides before any of the left."""
        found = [self._expression(value) for value in values]
        names = [self._temporary("old") for _ in found]
        lines = [f"{C_TYPES[kind]} {name} = {text};" for name, (text, kind) in zip(names, found, strict=True)]
        for target, name, (_, kind) in zip(targets, names, found, strict=True):
            lines += self._assigned(target, name, kind)
        return ["{", *indented(lines), "}"]

    def _assigned(self, target: ast.expr, text: str, kind: str) -> list[str]:
        if isinstance(target, ast.Name):
            self._types[target.id] = self._joined(self._types.get(target.id), kind)
            return [f"v_{target.id} = {text};"]
        if not isinstance(target, ast.Subscript):
            raise self._refuse(target)
        base, of = self._expression(target.value)
        if not isinstance(target.slice, ast.Slice):
            return [f"{self._item(base, of, target.slice)} = {text};"]
        if target.slice.lower or target.slice.upper:
            raise self._refuse(target)
        k = self._temporary("k")
        return [f"for (int64_t {k} = 0; {k} < {base}.n; {k}++) {base}.p[{k}] = {text};"]

    def _if(self, node: ast.If) -> list[str]:
        lines = [f"if ({self._expression(node.test)[0]}) {{", *indented(self._block(node.body))]
        if node.orelse:
            lines += ["} else {", *indented(self._block(node.orelse))]
        return [*lines, "}"]

    def _for(self, node: ast.For) -> list[str]:
        if not isinstance(node.iter, ast.Call) or not isinstance(node.target, ast.Name):
            raise self._refuse(node)
        if ast.unparse(node.iter.func) != "range":
            raise self._refuse(node)
        bounds = [self._expression(bound)[0] for bound in node.iter.args]
        if len(bounds) > 2:
            raise self._refuse(node, "a range with a step")
        low, high = ("0", bounds[0]) if len(bounds) == 1 else bounds
        self._types[node.target.id] = "i"
        k, end = self._temporary("k"), self._temporary("end")
        body = [f"v_{node.target.id} = {k};", *self._block(node.body)]
        return [f"for (int64_t {end} = {high}, {k} = {low}; {k} < {end}; {k}++) {{", *indented(body), "}"]

    def _return(self, node: ast.Return) -> list[str]:
        if node.value is None:
            return ["return;"]
        if isinstance(node.value, ast.Tuple):
            self.result = f"T{len(node.value.elts)}"
            lines = [f"result[{i}] = {self._expression(one)[0]};" for i, one in enumerate(node.value.elts)]
            return [*lines, "return;"]
        text, kind = self._expression(node.value)
        self.result = self._joined(self.result, kind)
        return [f"return {text};"]

    # -- expressions ---------------------------------------------------------------------------------------

    def _expression(self, node: ast.expr) -> Typed:
        match node:
            case ast.Constant(value=bool() as value):
                return number(value), "b"
            case ast.Constant(value=int() | float() as value):
                return number(value), "i" if isinstance(value, int) else "f"
            case ast.Name(id=name):
                return self._named(node, name)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return f"(!{self._expression(operand)[0]})", "b"
            case ast.UnaryOp(op=op, operand=operand):
                text, kind = self._expression(operand)
                return f"({'-' if isinstance(op, ast.USub) else '+'}{text})", "i" if kind == "b" else kind
            case ast.BinOp():
                return self._binary(node)
            case ast.BoolOp(op=op, values=values):
                sign = " && " if isinstance(op, ast.And) else " || "
                return f"({sign.join(self._expression(value)[0] for value in values)})", "b"
            case ast.Compare():
                return self._compared(node)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                (yes, one), (no, other) = self._expression(body), self._expression(orelse)
                return f"({self._expression(test)[0]} ? {yes} : {no})", self._joined(one, other)
            case ast.Subscript():
                return self._subscript(node)
            case ast.Attribute():
                return self._attribute(node)
            case ast.Call():
                return self._call(node)
        raise self._refuse(node)

    def _named(self, node: ast.expr, name: str) -> Typed:
        if name in self._types:
            return f"v_{name}", self._types[name]
        value = self._names.get(name)
        if isinstance(value, bool | int | float):
            return number(value), {bool: "b", int: "i"}.get(type(value), "f")
        if isinstance(value, np.ndarray):
            return self._unit.constant(value), "A"
        if self._probing:  # assigned further down; the next round knows it
            return "0", "f"
        raise self._refuse(node, "a name that is not known")

    def _binary(self, node: ast.BinOp) -> Typed:
        (left, one), (right, other) = self._expression(node.left), self._expression(node.right)
        kind = "Z" if "Z" in (one, other) else self._joined(one, other)
        kind = "i" if kind == "b" else kind
        if type(node.op) in _BINARY:
            return f"({left} {_BINARY[type(node.op)]} {right})", kind
        match node.op:
            case ast.Div():
                return (f"({left} / {right})", "Z") if kind == "Z" else (f"({left} / (double)({right}))", "f")
            case ast.Pow():
                twice = isinstance(node.right, ast.Constant) and node.right.value == 2
                return (f"square({left})" if twice else f"pow({left}, {right})"), "f"
            case ast.Mod():
                return f"mod_{'i' if kind == 'i' else 'f'}({left}, {right})", "i" if kind == "i" else "f"
            case ast.FloorDiv() if kind == "f":
                return f"floor({left} / {right})", "f"
        raise self._refuse(node)

    def _compared(self, node: ast.Compare) -> Typed:
        values = [self._expression(one)[0] for one in (node.left, *node.comparators)]
        pairs = zip(values, node.ops, values[1:], strict=False)
        tests = [f"({one} {_COMPARED[type(op)]} {other})" for one, op, other in pairs if type(op) in _COMPARED]
        if len(tests) != len(node.ops):
            raise self._refuse(node)
        return f"({' && '.join(tests)})", "b"

    def _subscript(self, node: ast.Subscript) -> Typed:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            last = isinstance(node.slice, ast.Constant) and node.slice.value
            return f"{self._expression(node.value.value)[0]}.{'m' if last else 'n'}", "i"
        base, of = self._expression(node.value)
        if not isinstance(node.slice, ast.Slice):
            return self._item(base, of, node.slice), ITEMS.get(of, "f")
        if node.slice.lower is None or node.slice.upper is None:
            raise self._refuse(node)
        low, high = self._expression(node.slice.lower)[0], self._expression(node.slice.upper)[0]
        return f"((Vec){{{base}.p + {low}, {high} - {low}}})", "A"

    def _item(self, base: str, of: str, index: ast.expr) -> str:
        if of == "M" and isinstance(index, ast.Tuple):
            row, column = (self._expression(one)[0] for one in index.elts)
            return f"{base}.p[{row} * {base}.m + {column}]"
        return f"{base}.p[{self._expression(index)[0]}]"

    def _attribute(self, node: ast.Attribute) -> Typed:
        if ast.unparse(node) in ("math.pi", "math.inf", "math.nan", "math.e"):
            return number(getattr(math, node.attr)), "f"
        base, kind = self._expression(node.value)
        if node.attr == "size":
            return f"{base}.n", "i"
        if kind == "Z" and node.attr in ("real", "imag"):
            return f"{'creal' if node.attr == 'real' else 'cimag'}({base})", "f"
        raise self._refuse(node)

    def _call(self, node: ast.Call) -> Typed:
        called = ast.unparse(node.func)
        if called in ("min", "max"):
            return self._extreme(called, node.args)
        if called in _CALLS:
            texts = [self._expression(argument) for argument in node.args]
            return _CALLS[called](texts)
        if called.startswith("math.") and called[5:] in FUNCTIONS:
            texts = [self._expression(argument) for argument in node.args]
            return f"{called[5:]}({', '.join(text for text, _ in texts)})", "b" if called[5:7] == "is" else "f"
        if not isinstance(node.func, ast.Name) or node.func.id not in self._names:
            raise self._refuse(node)
        function, arguments = self._callee(node)
        return f"{function.name}({', '.join(arguments)})", function.result or "f"

    def _extreme(self, name: str, values: Sequence[ast.expr]) -> Typed:
        text, kind = self._expression(values[0])
        for value in values[1:]:
            other, of = self._expression(value)
            kind = self._joined(kind, of)
            text = f"{name}_{'i' if kind == 'b' else kind}({text}, {other})"
        return text, kind

    def _callee(self, node: ast.Call) -> tuple[Translated, list[str]]:
        if not isinstance(node.func, ast.Name):
            raise self._refuse(node)
        given = [self._expression(argument) for argument in node.args]
        kinds = tuple("f" if kind in "ib" else kind for _, kind in given)  # numbers go as double
        return self._unit.function(self._names[node.func.id], kinds), [text for text, _ in given]


_CALLS: Mapping[str, Callable[[Sequence[Typed]], Typed]] = {
    "abs": lambda a: (f"fabs({a[0][0]})", "f") if a[0][1] == "f" else (f"llabs({a[0][0]})", "i"),
    "len": lambda a: (f"{a[0][0]}.n", "i"),
    "int": lambda a: (f"((int64_t)({a[0][0]}))", "i"),
    "float": lambda a: (f"((double)({a[0][0]}))", "f"),
    "complex": lambda a: (f"({a[0][0]} + {a[1][0]} * I)", "Z"),
    "cmath.exp": lambda a: (f"cexp({a[0][0]})", "Z"),
}
