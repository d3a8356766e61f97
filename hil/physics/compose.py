"""Turn a plant's page of equations, with every effect that fits its hooks, into one compiled kernel.

The page is read as a syntax tree. `x.NAME` becomes a state, `c.NAME` a coefficient, and each
`value = hook.NAME(value)` becomes the chain of that hook's effects, each behind its own switch. The result
is one flat function, so the optimiser sees through every call: an effect that is off costs a branch, and
screening the whole library needs no recompilation. The text is kept in a cache folder under a name that
holds a hash of everything it was made from, because numba alone would not notice an edited effect file.
"""

from __future__ import annotations

import ast
import atexit
import hashlib
import importlib.util
import inspect
import math
import shutil
import sys
import tempfile
import textwrap
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import accumulate
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from hil.cache import cache_folder, forget_unused, one_at_a_time, stamp, write_whole
from hil.catalog import entries, find
from hil.errors import FileError, UnknownNameError
from hil.physics.effect import Effect, hold_first
from hil.physics.plant import Hook, Plant

_GIVEN = ("value", "state", "time_s", "step_s", "full_scale")
# With it a kernel is compiled when it is loaded, and once only.
_SIGNATURE = (
    "void(f8[:, ::1], f8, i8, i8, i8, b1, f8[::1], f8[::1], f8[::1], b1[::1], f8[::1], f8[::1], i8[::1],"
    " i8, f8[::1], b1, f8[:, ::1], f8[::1], f8[::1], f8[:, ::1])"
)


@dataclass(frozen=True, slots=True)
class Site:
    """An effect at a hook of a plant: one candidate, one switch in the kernel."""

    effect: Effect
    hook: Hook

    @property
    def key(self) -> tuple[str, str]:
        """(effect name, hook name)."""
        return self.effect.name, self.hook.name

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of the coefficients that the transform takes, in its order."""
        given = (*_GIVEN, self.hook.extra)
        return tuple(name for name in _argument_names(self.effect.transform) if name not in given)

    @property
    def by_clock(self) -> bool:
        """Whether what the effect does depends on the time since the start of a recording."""
        return "time_s" in _argument_names(self.effect.transform)


@dataclass(frozen=True, eq=False)
class Kernel:
    """A plant to be simulated: `run` advances it; the rest says how its arrays are laid out. Each is itself alone.

    Attributes:
        coefficients: of the plant, with the width of those that are arrays; 0 of a number.
        indices: of the sites by their key. `arguments`: coefficients of each site; `starts`: where they begin,
            and the number of all of them at the end.
    """

    plant: Plant
    sites: tuple[Site, ...]
    states: tuple[str, ...]
    coefficients: Mapping[str, int]
    indices: Mapping[tuple[str, str], int]
    arguments: tuple[tuple[str, ...], ...]
    starts: tuple[int, ...]

    @cached_property
    def run(self) -> Callable[..., None]:
        """The plant with every effect that fits it, compiled at its first use on a machine."""
        source = self.source
        return _load(source, _stamp(self.plant, self.sites, source)).kernel

    @cached_property
    def operations(self) -> int:
        """How much a sub-step works out, effects aside: nodes of the plant's page as a syntax tree."""
        return sum(1 for _ in ast.walk(_Page(self).tree))

    @property
    def source(self) -> str:
        """The text of the generated module."""
        return _Page(self).source()

    def with_sites(self, keys: Collection[tuple[str, str]]) -> Kernel:
        """The same plant with these effects alone."""
        sites = tuple(site for site in self.sites if site.key in keys)
        return _kernel_of(self.plant, sites, self.coefficients)


@cache
def plant(name: str) -> Plant:
    """An installed plant by name.

    Raises:
        FileError: its page calls a hook in another way than it declares; names file and line.
    """
    found: Plant = find("plants", name).load().PLANT
    _Page(_kernel_of(found, (), {})).check_hooks()
    return found


@cache
def effect(name: str) -> Effect:
    """An installed effect by name."""
    return find("effects", name).load().EFFECT


@cache
def effects() -> tuple[Effect, ...]:
    """Every installed effect."""
    return tuple(entry.load().EFFECT for entry in entries("effects"))


@cache
def kernel(name: str) -> Kernel:
    """The kernel of a plant with every effect that fits it."""
    chosen = plant(name)
    sites = tuple(Site(effect, hook) for hook in chosen.hooks for effect in effects() if hook.name in effect.hooks)
    widths = {n: getattr(value, "size", 0) for n, value in chosen.coefficients(chosen.typical, math.inf).items()}
    made = _kernel_of(chosen, sites, widths)
    _Page(made).check_effects()
    return made


def _kernel_of(chosen: Plant, sites: tuple[Site, ...], coefficients: Mapping[str, int]) -> Kernel:
    arguments = tuple(site.arguments for site in sites)
    return Kernel(
        chosen, sites, tuple(chosen.states), coefficients,
        {site.key: i for i, site in enumerate(sites)}, arguments, (0, *accumulate(map(len, arguments))),
    )  # fmt: skip


@cache
def _argument_names(function: Callable[..., Any]) -> tuple[str, ...]:
    return tuple(inspect.signature(getattr(function, "py_func", function)).parameters)


class _Page(ast.NodeTransformer):
    """Rewrites a plant's page into the body of the kernel's inner loop."""

    def __init__(self, kernel: Kernel) -> None:
        self.plant = kernel.plant
        self.sites = kernel.sites
        self.tree = ast.parse(textwrap.dedent(inspect.getsource(self.plant.equations))).body[0]
        self.coefficients = kernel.coefficients

    # -- rewriting -----------------------------------------------------------------------------------------

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        if _is_hook(node):
            self._refuse(node, f"hook.{node.attr}(…) stands within an expression; write `name = hook.{node.attr}(…)`")
        if isinstance(node.value, ast.Name) and node.value.id in ("x", "c"):
            known = {"x": (*self.plant.states, *self.plant.lines_s), "c": tuple(self.coefficients)}[node.value.id]
            self._must_be_one_of(node, {"x": "state", "c": "coefficient"}[node.value.id], known)
            return ast.copy_location(ast.Name(f"{node.value.id}_{node.attr}", node.ctx), node)
        return self.generic_visit(node)

    def _must_be_one_of(self, node: ast.Attribute, kind: str, known: Collection[str]) -> None:
        """Refuse a name that the plant does not have."""
        if node.attr not in known:
            self._refuse(node, str(UnknownNameError(kind, node.attr, known)))

    def _refuse(self, node: ast.expr | None, text: str) -> NoReturn:
        """Say what is wrong with a line of the page; without one, with the page."""
        line = inspect.getsourcelines(self.plant.equations)[1] + (0 if node is None else node.lineno - 1)
        raise FileError(f"{inspect.getsourcefile(self.plant.equations)}:{line}: {text}")

    # -- what is looked at before --------------------------------------------------------------------------

    def check_hooks(self) -> None:
        """Refuse a page that does not call every hook once, as it is declared."""
        calls = self._calls()
        for node in calls:
            self._must_be_one_of(_callee(node), "hook", [hook.name for hook in self.plant.hooks])
        for hook in self.plant.hooks:
            own = [node for node in calls if _callee(node).attr == hook.name]
            if not own:
                self._refuse(None, f"hook '{hook.name}' is declared in PLANT and never called; write {_form(hook)}")
            if len(own) > 1:
                self._refuse(own[1], f"hook.{hook.name}(…) is called twice; an effect acts at one place")
            given = len(own[0].args) + len(own[0].keywords)
            if own[0].keywords or given != len(_handed(hook)):
                declared = f'extra="{hook.extra}"' if hook.extra else "no extra"
                self._refuse(
                    own[0], f"hook.{hook.name}(…) is called with {given} argument{'' if given == 1 else 's'}; PLANT "
                    f"declares the hook with {declared}, so write {_form(hook)}",
                )  # fmt: skip

    def check_effects(self) -> None:
        """Refuse a hook that does not hand over what the effects that belong there take."""
        extras = {"mobility", *(hook.extra for hook in self.plant.hooks)} - {""}
        calls = {_callee(node).attr: node for node in self._calls()}
        for site in self.sites:
            for lacking in sorted(extras & set(site.arguments) - {p.name for p in site.effect.parameters}):
                hook = replace(site.hook, extra=lacking)
                self._refuse(
                    calls[hook.name], f"hook.{hook.name}(…): effect {site.effect.name}, which acts at a hook of this "
                    f"name, takes '{lacking}' as well; say extra=\"{lacking}\" of the hook in PLANT and write "
                    f"{_form(hook)}",
                )  # fmt: skip

    def _calls(self) -> list[ast.Call]:
        found = [node for node in ast.walk(self.tree) if isinstance(node, ast.Call) and _is_hook(node.func)]
        return sorted(found, key=lambda node: node.lineno)

    def visit_Assign(self, node: ast.Assign) -> ast.AST | list[ast.stmt]:
        call = node.value
        if not (isinstance(call, ast.Call) and _is_hook(call.func)):
            return self.generic_visit(node)
        assert isinstance(call.func, ast.Attribute)
        self._must_be_one_of(call.func, "hook", [hook.name for hook in self.plant.hooks])
        target = ast.unparse(self.visit(node.targets[0]))
        value, *extra = [ast.unparse(self.visit(argument)) for argument in call.args]
        return ast.parse("\n".join(self._hook_lines(call.func.attr, target, value, extra))).body

    def _hook_lines(self, hook: str, target: str, value: str, extra: list[str]) -> Iterator[str]:
        index = [h.name for h in self.plant.hooks].index(hook)
        force = self.plant.hooks[index].is_force
        yield f"_value = {value}"
        yield f"if inject == {index}: _value += disturbance[_sample]"
        yield f"if tracing: trace[{index}, _sample] = _value"
        if force:
            yield "_force = 0.0"
        here = [k for k, site in enumerate(self.sites) if site.hook.name == hook]
        if here:
            yield f"if any_{hook}:"
            for k in here:
                yield from ("    " + line for line in self._site_lines(k, extra))
        yield f"{target} = _force" if force else f"{target} = _value"

    def _site_lines(self, k: int, extra: list[str]) -> Iterator[str]:
        effect, hook = self.sites[k].effect, self.sites[k].hook
        passed = {
            "value": "_value",
            "time_s": "_time_s",
            "step_s": "step_s",
            "state": f"S{k}",
            "full_scale": repr(hook.full_scale),
        }
        passed |= {hook.extra: extra[0]} if extra else {}
        passed |= {name: f"P{k}_{name}" for name in self.sites[k].arguments}
        call = f"transform{k}({', '.join(passed[name] for name in _argument_names(effect.transform))})"
        result = "_own_force" if hook.is_force else "_value"
        yield f"if on{k}:"
        settle = _settle(effect)
        if settle is None:
            yield f"    {result} = {call}"
        else:
            arguments = ", ".join(passed[name] for name in _argument_names(settle))
            yield "    if settling:"
            yield f"        {result} = settle{k}({arguments})"
            yield "    else:"
            yield f"        {result} = {call}"
        if hook.is_force:  # a force: it slows the free velocity and adds up
            yield "    _force += _own_force"
            yield f"    _value -= {extra[0]} * _own_force"

    # -- the kernel's text ---------------------------------------------------------------------------------

    def source(self) -> str:
        """The whole generated module."""
        body = [self.visit(statement) for statement in self._statements()]
        flat = [s for part in body for s in (part if isinstance(part, list) else [part])]
        *page, result = flat
        assert isinstance(result, ast.Return) and result.value is not None
        values = result.value.elts if isinstance(result.value, ast.Tuple) else [result.value]
        lines = [ast.unparse(ast.fix_missing_locations(statement)) for statement in page]
        lines += [f"y{i} = {ast.unparse(value)}" for i, value in enumerate(values)]
        return "\n".join(self._module(lines, len(values)))

    def _statements(self) -> list[ast.stmt]:
        assert isinstance(self.tree, ast.FunctionDef)
        statements = self.tree.body
        has_doc = isinstance(statements[0], ast.Expr) and isinstance(statements[0].value, ast.Constant)
        return statements[1:] if has_doc else statements

    def _module(self, page: list[str], outputs: int) -> Iterator[str]:
        yield f'"""The equations of {self.plant.name} with the effects that fit it. Generated; do not edit."""'
        yield "import math"
        yield "from numba import njit"
        yield f"from {self.plant.equations.__module__} import {', '.join(self._helpers()) or '__name__'}"
        for k, site in enumerate(self.sites):
            module = _home(site.effect)
            yield f"from {module} import EFFECT as effect{k}"
            yield f"transform{k} = effect{k}.transform"
            settle = _settle(site.effect)
            if settle is not None and settle is site.effect.settle:
                yield f"settle{k} = effect{k}.settle"
            elif settle is not None:
                yield f"from hil.physics.effect import hold_first as settle{k}"
        yield f"@njit('{_SIGNATURE}', cache=True, nogil=True, error_model='numpy')"
        yield (
            "def kernel(inputs, step_s, sub_steps, read_at, start, settle_first, steady, coefficients, states,"
            " on, effect_coefficients, memory, offsets, inject, disturbance, tracing, trace, follow, measured, out):"
        )
        yield from ("    " + line for line in self._prologue(outputs))
        yield "    for _i in range(-1 if settle_first else 0, inputs.shape[1]):"
        yield "        settling = _i < 0"
        yield "        if _i == 0:"
        yield from ("            " + line for line in self._load_coefficients("coefficients"))
        yield "        _sample = max(_i, 0)"
        yield "        if following and _i > 0 and measured[_i - 1] == measured[_i - 1]:"
        yield "            _missed = measured[_i - 1] - out[0, _i - 1]"
        yield from (f"            x_{name} += follow[{k}] * _missed" for k, name in enumerate(self.plant.scalars))
        yield "        if not settling and read_at == 0:"
        yield from (f"            out[{k}, _i] = y{k}" for k in range(outputs))
        for k, name in enumerate(self._input_names()):
            yield f"        held_{name} = inputs[{k}, _sample]"
        yield "        for _j in range(1 if settling else sub_steps):"
        for name in self._input_names():
            yield f"            {name} = held_{name}"
        yield "            _time_s = (start + _sample * sub_steps + _j) * step_s"
        yield from ("            " + line for text in page for line in text.splitlines())
        yield "            if _j + 1 == read_at and not settling:"
        yield from (f"                out[{k}, _i] = y{k}" for k in range(outputs))
        yield from ("    " + line for line in self._epilogue(outputs))

    def _helpers(self) -> list[str]:
        """Compiled functions of the plant's module that the page calls."""
        home = vars(sys.modules[self.plant.equations.__module__])
        called = {node.id for node in ast.walk(self.tree) if isinstance(node, ast.Name)}
        return sorted(name for name in called if hasattr(home.get(name), "py_func"))

    def _input_names(self) -> tuple[str, ...]:
        return _argument_names(self.plant.equations)[:-3]

    def _prologue(self, outputs: int) -> Iterator[str]:
        at = 0
        for name, width in self.plant.states.items():
            yield f"x_{name} = states[{at}]" if width == 1 else f"x_{name} = states[{at}:{at + width}]"
            at += width
        for k in range(outputs):
            yield f"y{k} = states[{at + k}]"
        for k, name in enumerate(self.plant.lines_s, start=len(self.sites)):
            yield f"x_{name} = memory[offsets[{k}]:offsets[{k + 1}]]"
        at = 0
        for k, site in enumerate(self.sites):
            yield f"on{k} = on[{k}]"
            yield f"S{k} = memory[offsets[{k}]:offsets[{k + 1}]]"
            for name in site.arguments:
                yield f"P{k}_{name} = effect_coefficients[{at}]"
                at += 1
        for hook in self.plant.hooks:
            here = [f"on{k}" for k, site in enumerate(self.sites) if site.hook.name == hook.name]
            yield f"any_{hook.name} = {' or '.join(here) or 'False'}"
        yield "following = follow.size > 0"
        yield from self._load_coefficients("steady")

    def _load_coefficients(self, array: str) -> Iterator[str]:
        at = 0
        for name, width in self.coefficients.items():
            yield f"c_{name} = {array}[{at}]" if not width else f"c_{name} = {array}[{at}:{at + width}]"
            at += width or 1

    def _epilogue(self, outputs: int) -> Iterator[str]:
        at = 0
        for name, width in self.plant.states.items():
            if width == 1:
                yield f"states[{at}] = x_{name}"
            at += width
        for k in range(outputs):
            yield f"states[{at + k}] = y{k}"


def _callee(node: ast.Call) -> ast.Attribute:
    assert isinstance(node.func, ast.Attribute)
    return node.func


def _handed(hook: Hook) -> tuple[str, ...]:
    """What a page hands over at a hook."""
    return ("value", hook.extra) if hook.extra else ("value",)


def _form(hook: Hook) -> str:
    return f"`{'force' if hook.is_force else 'value'} = hook.{hook.name}({', '.join(_handed(hook))})`"


def _is_hook(node: ast.expr) -> bool:
    return isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "hook"


def _settle(effect: Effect) -> Callable[..., Any] | None:
    if effect.settle is not None:
        return effect.settle
    return hold_first if "state" in _argument_names(effect.transform) else None


def _home(effect: Effect) -> str:
    return str(getattr(effect.transform, "py_func", effect.transform).__module__)


def _stamp(plant: Plant, sites: tuple[Site, ...], source: str) -> str:
    """The name of a kernel: of its own text, the sources of the packages involved, and the tools."""
    homes = {plant.equations.__module__, __name__, *(_home(site.effect) for site in sites)}
    folders = {Path(str(sys.modules[home].__file__)).parent for home in homes}
    files = [file for folder in folders for file in folder.glob("*.py")]
    own = hashlib.sha256(source.encode()).hexdigest()[:8]  # other sites are another kernel
    return f"{plant.name.replace('-', '_')}_{own}_{stamp(files, ('numba',))}"


def _load(source: str, name: str) -> ModuleType:
    """The generated module, compiled or taken from the folder of what is kept."""
    try:
        path = cache_folder("kernels") / f"{name}.py"
    except OSError:  # a service's user has no home: compiled by each program
        path = _unkept() / f"{name}.py"
    with one_at_a_time(path):
        if not path.exists():
            forget_unused(path.parent)
            write_whole(path, source.encode())
        spec = importlib.util.spec_from_file_location(f"hil_kernel_{name}", path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module  # numba looks its functions up by module name
        spec.loader.exec_module(module)
        return module


@cache
def _unkept() -> Path:
    """A folder that lasts as long as this program."""
    folder = tempfile.mkdtemp(prefix="hil-kernels-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)
