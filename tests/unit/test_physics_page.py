"""The page of equations, run as plain Python, says the same as the compiled kernel, effects included."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hil.catalog import entries
from hil.physics.compose import Site, kernel, plant
from hil.physics.effect import hold_first
from hil.physics.plant import Hook, Plant
from hil.physics.simulate import ActiveEffect, Drive, simulate, sub_steps
from hil.record.recording import Array

INTERVAL_S = 2e-3
SLOW = {"cascaded-tanks": 0.5}  # plants so slow that milliseconds show nothing
SAMPLES = 150
PLANTS = [plant(entry.name) for entry in entries("plants")]


def plain(function: Callable[..., Any]) -> Callable[..., Any]:
    """The Python source of a compiled function, with everything that it calls as Python too."""
    source = getattr(function, "py_func", function)
    home = source.__globals__
    called = {name: plain(home[name]) for name in source.__code__.co_names if hasattr(home.get(name), "py_func")}
    return FunctionType(source.__code__, home | called, source.__name__, source.__defaults__, source.__closure__)


def interval_s(definition: Plant) -> float:
    return SLOW.get(definition.name, INTERVAL_S)


class Place:
    """A hook of the page with at most one effect: what `hook.NAME(value, …)` does."""

    def __init__(self, hook: Hook, site: Site | None, parameters: Mapping[str, float], step_s: float) -> None:
        self.hook, self.site = hook, site
        self.settling, self.time_s, self.step_s = True, 0.0, step_s
        if site is None:
            return
        given = dict(parameters)
        if site.effect.coefficients is not None:
            given = dict(site.effect.coefficients(given, step_s))
        self.given = given
        self.state = np.zeros(site.effect.words_at(hook, step_s))
        self.transform = plain(site.effect.transform)
        takes_state = "state" in inspect.signature(self.transform).parameters
        settle = site.effect.settle or (hold_first if takes_state else site.effect.transform)
        self.settle = plain(settle)

    def __call__(self, value: float, extra: float = 0.0) -> float:
        if self.site is None:
            return 0.0 if self.hook.is_force else value
        known = {
            "value": value,
            "state": self.state,
            "time_s": self.time_s,
            "step_s": self.step_s,
            "full_scale": self.hook.full_scale,
            self.hook.extra: extra,
            **self.given,
        }
        function = self.settle if self.settling else self.transform
        found: float = function(**{name: known[name] for name in inspect.signature(function).parameters})
        return found


def by_the_page(
    definition: Plant, inputs: Array, steps: int, read_at: int, site: Site | None, given: Mapping[str, float]
) -> Array:
    """The outputs, shape (1 + observed, n): settled at the first input, then sub-step by sub-step."""
    step_s = interval_s(definition) / steps
    places = {
        hook.name: Place(hook, site if site and site.hook == hook else None, given, step_s) for hook in definition.hooks
    }
    x = SimpleNamespace(**{name: 0.0 if width == 1 else np.zeros(width) for name, width in definition.states.items()})
    words = definition.line_words(definition.typical, step_s)
    vars(x).update({name: np.zeros(count) for name, count in zip(definition.lines_s, words, strict=True)})
    vars(x).update(definition.initial(definition.typical, tuple(inputs[:, 0].tolist()), math.nan))
    page, hook = plain(definition.equations), SimpleNamespace(**places)

    def advance(values: Array, c: SimpleNamespace) -> Any:
        return np.atleast_1d(page(*values.tolist(), x, c, hook))

    y = advance(inputs[:, 0], SimpleNamespace(**definition.coefficients(definition.typical, math.inf)))
    c = SimpleNamespace(**definition.coefficients(definition.typical, step_s))
    out = np.empty((1 + len(definition.observed), inputs.shape[1]))
    for place in places.values():
        place.settling = False
    for i in range(inputs.shape[1]):
        if read_at == 0:
            out[:, i] = y
        for j in range(steps):
            for place in places.values():
                place.time_s = (i * steps + j) * step_s
            y = advance(inputs[:, i], c)
            if j + 1 == read_at:
                out[:, i] = y
    return out


def zigzag(definition: Plant) -> Array:
    """From rest up, down beyond it and up again: in this range all plants move and reverse; shape (inputs, n).

    Further inputs, measured disturbances, go along, each at another size.
    """
    rest, size = {"cummins-efc": (1.5, 0.4), "efc-measured": (1.5, 0.4), "hydraforce-sp08-47c": (60.0, 50.0)}.get(
        definition.name, (0.3 * definition.inputs[0].full_scale, 0.7 * definition.inputs[0].full_scale)
    )
    k = np.arange(SAMPLES)
    swing = np.interp(k, [0, 5, 45, 50, 110, SAMPLES - 1], [0.0, 0.0, 1.0, 1.0, -1.8, 0.5])
    further = [signal.full_scale * (0.5 + 0.2 * swing / i) for i, signal in enumerate(definition.inputs[1:], start=1)]
    return np.vstack([rest + size * swing, *further])


@pytest.mark.parametrize("read_at", [0.0, 1.0])
@pytest.mark.parametrize("definition", PLANTS, ids=lambda definition: definition.name)
def test_the_page_without_effects(definition, read_at):
    inputs = zigzag(definition)
    steps = sub_steps(definition, interval_s(definition))
    compiled = simulate(definition, definition.typical, Drive(inputs, math.nan, interval_s(definition), read_at))
    python = by_the_page(definition, inputs, steps, round(read_at * steps), None, {})
    assert np.allclose(compiled, python, rtol=1e-12, atol=1e-12 * definition.output.full_scale)
    assert np.ptp(compiled[0]) > 1e-3 * definition.output.full_scale


@pytest.mark.parametrize("definition", PLANTS, ids=lambda definition: definition.name)
def test_the_page_with_each_effect(definition):
    inputs = zigzag(definition)[:, :100].copy()
    steps = sub_steps(definition, interval_s(definition))
    for site in kernel(definition.name).sites:
        typical = {parameter.name: parameter.typical for parameter in site.effect.parameters_at(site.hook)}
        drive = Drive(inputs, math.nan, interval_s(definition))
        compiled = simulate(definition, definition.typical, drive, [ActiveEffect(*site.key, typical)])
        python = by_the_page(definition, inputs, steps, 0, site, typical)
        assert np.allclose(compiled, python, rtol=1e-9, atol=1e-9 * definition.output.full_scale), site.key
