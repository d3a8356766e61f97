"""The C file of a model: sizes, start values, equations, and the way from parameters to coefficients."""

from __future__ import annotations

import ast
import hashlib
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from typing import Any

import numpy as np

from hil.fmu.c_types import UntranslatableError, indented, number
from hil.fmu.symbolic import Symbol, symbolic, written
from hil.fmu.translate import Unit
from hil.fmu.variables import Variables, asks_for_start
from hil.physics.compose import Kernel
from hil.physics.simulate import flat

# Of the arguments of a kernel, in their order (see `hil.physics.compose`).
_KERNEL_TYPES = ("M", "f", "i", "i", "i", "b", "A", "A", "A", "B", "A", "A", "I", "i", "A", "b", "M", "A", "A", "M")


@dataclass(frozen=True, slots=True)
class Source:
    """A model in C99.

    Attributes:
        text: the file, for `fmi.c` to include.
        token: tells this model from every other.
        is_tunable: whether the plant's parameters can be set; else its coefficients were fixed, and `why` says why.
    """

    text: str
    token: str
    is_tunable: bool
    why: str = ""


def source_of(variables: Variables) -> Source:
    """Translate a model.

    Raises:
        UntranslatableError: its page, or one of its effects, uses something that has no C form; names the line.
    """
    unit = Unit()
    _translate_kernel(unit, variables.kernel)
    seen: dict[Any, Any] = {}
    why = ""
    try:
        plant = list(_coefficients(unit, variables, seen))
    except Exception as error:  # made with arrays or a library: the values of the model are kept
        why = str(error) or type(error).__name__
        plant = list(_fixed_coefficients(variables))
    effects = [
        line for k in range(len(variables.kernel.sites)) for line in _effect_coefficients(unit, variables, k, seen)
    ]
    start = _initial(unit, variables, seen)
    text = "\n".join([_prelude(), *_sizes(variables), unit.text, *_functions([*plant, *effects], start)])
    digest = hashlib.sha256(text.encode()).hexdigest()
    token = "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"
    return Source(f'#define TOKEN "{token}"\n{text}\n', token, not why, why)


def _prelude() -> str:
    return (files("hil.fmu") / "prelude.h").read_text(encoding="utf-8")


def _translate_kernel(unit: Unit, kernel: Kernel) -> None:
    """The composed kernel; of the modules that it imports only names are needed, not numba."""
    lines = [line for line in kernel.source.splitlines() if not line.startswith("@njit")]
    lines = [line for line in lines if not line.endswith("import __name__")]
    names: dict[str, Any] = {}
    exec(compile("\n".join(lines), "kernel", "exec"), names)
    node = next(part for part in ast.parse("\n".join(lines)).body if isinstance(part, ast.FunctionDef))
    unit.translated(node, _KERNEL_TYPES, names, "kernel")


def _coefficients(unit: Unit, variables: Variables, seen: dict[Any, Any]) -> Iterator[str]:
    plant = variables.plant
    if any(variables.kernel.coefficients.values()):
        raise UntranslatableError("coefficients that are arrays")
    given = {parameter.name: Symbol(f"p[{i}]") for i, parameter in enumerate(plant.parameters)}
    function = symbolic(unit, plant.coefficients, seen)
    for target, step_s in (("fine", variables.step_s), ("steady", math.inf)):
        places = [(name, f"{target}[{i}]") for i, name in enumerate(variables.kernel.coefficients)]
        yield from _scope(written(partial(function, given, step_s), _to(places)))


def _fixed_coefficients(variables: Variables) -> Iterator[str]:
    for target, step_s in (("fine", variables.step_s), ("steady", math.inf)):
        values = flat(variables.plant.coefficients(variables.model.values, step_s))
        yield from (f"{target}[{i}] = {number(value)};" for i, value in enumerate(values))


def _effect_coefficients(unit: Unit, variables: Variables, k: int, seen: dict[Any, Any]) -> list[str]:
    kernel = variables.kernel
    site, names, start = kernel.sites[k], kernel.arguments[k], kernel.starts[k]
    first = variables.effects_at[k]
    given = {p.name: Symbol(f"p[{first + i}]") for i, p in enumerate(site.effect.parameters_at(site.hook))}
    places = [(name, f"effect[{start + i}]") for i, name in enumerate(names)]
    if site.effect.coefficients is None:
        return [f"{place} = {given[name].text};" for name, place in places]
    function = symbolic(unit, site.effect.coefficients, seen)
    return _scope(written(partial(function, given, variables.step_s), _to(places)))


def _initial(unit: Unit, variables: Variables, seen: dict[Any, Any]) -> list[str]:
    plant = variables.plant
    if not asks_for_start(plant):
        return []
    function = symbolic(unit, plant.initial, seen)
    given = {parameter.name: Symbol(f"p[{i}]") for i, parameter in enumerate(plant.parameters)}
    inputs = tuple(Symbol(f"u[{i}]") for i in range(len(plant.inputs)))
    output = Symbol(f"p[{len(variables.parameters) - 1}]")
    places, at = {}, 0
    for name, width in plant.states.items():
        places[name] = f"states[{at}]"
        at += width
    return written(partial(function, given, inputs, output), lambda outcome: [(name, places[name]) for name in outcome])


def _to(places: Sequence[tuple[str, str]]) -> Callable[[Any], Iterable[tuple[str, str]]]:
    return lambda _outcome: places


def _scope(lines: list[str]) -> list[str]:
    return ["{", *indented(lines), "}"]


def _memory(variables: Variables) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Where the memory of each effect and delay line begins."""
    kernel, step_s = variables.kernel, variables.step_s
    sizes = [0, *(site.effect.words_at(site.hook, step_s) for site in kernel.sites)]
    longest = {variable.name.removeprefix("plant."): variable.high for variable in variables.parameters}
    sizes += variables.plant.line_words(longest, step_s)
    return np.cumsum(np.array(sizes, dtype=np.int64))


def _sizes(variables: Variables) -> Iterator[str]:
    kernel, offsets = variables.kernel, _memory(variables)
    outputs = len(variables.outputs)
    sizes = {
        "NU": len(variables.inputs), "NY": outputs, "NP": len(variables.parameters), "NS": len(kernel.sites),
        "NC": sum(width or 1 for width in kernel.coefficients.values()), "NE": kernel.starts[-1],
        "NX": sum(variables.plant.states.values()) + outputs, "NM": int(offsets[-1]), "VR_U": variables.first_input,
        "VR_Y": variables.first_output, "VR_P": variables.first_parameter, "VR_ON": variables.first_switch,
    }  # fmt: skip
    yield from (f"#define {name} {value}" for name, value in sizes.items())
    yield f"#define STEP_S {variables.step_s!r}"
    given = variables.parameters
    yield f"static const double P_START[] = {_array([v.start for v in given])};"
    yield f"static const double P_LOW[] = {_array([v.low for v in given])};"
    yield f"static const double P_HIGH[] = {_array([v.high for v in given])};"
    yield f"static const int32_t ON_START[] = {_array([int(variables.is_on(site)) for site in kernel.sites])};"
    yield f"static const int64_t OFFSETS[] = {_array([int(offset) for offset in offsets])};"
    yield f"#define N_OFFSETS {len(offsets)}"


def _functions(coefficients: list[str], start: list[str]) -> Iterator[str]:
    yield "static void make_coefficients(const double *p, double *fine, double *steady, double *effect)"
    yield from _scope(coefficients)
    yield "static void initial_states(const double *p, const double *u, double *states)"
    yield from _scope(start)
    yield _RUN


_RUN = """\
/* Advance by so many internal steps with the inputs held; with settle, find the steady state first. */
static void run(double *u, int64_t steps, int64_t done, int settle, double *steady, double *coefficients,
                double *states, const int32_t *on, double *effect, double *memory, double *y)
{
    double none[1] = {0};
    kernel((Mat){u, NU, 1}, STEP_S, steps, steps, done, settle, (Vec){steady, NC}, (Vec){coefficients, NC},
           (Vec){states, NX}, (BVec){on, NS}, (Vec){effect, NE}, (Vec){memory, NM}, (IVec){OFFSETS, N_OFFSETS}, -1,
           (Vec){none, 1}, 0, (Mat){none, 1, 1}, (Vec){none, 0}, (Vec){none, 1}, (Mat){y, NY, 1});
}"""


def _array(values: Sequence[float]) -> str:
    return f"{{{', '.join([*map(number, values), '0'])}}}"
