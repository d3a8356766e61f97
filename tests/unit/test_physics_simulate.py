"""What the compiled kernel could not survive is refused before it runs; names that exist are said."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hil.catalog import entries
from hil.errors import FileError, InputError, UnknownNameError
from hil.physics.compose import effect, effects, kernel, plant
from hil.physics.simulate import ActiveEffect, Drive, Twin, effects_at, plant_at, simulate

VALVE = plant("brevini-hpv41")
COUNT = 10
COMPILED = """
from hil.physics.compose import kernel
stats = kernel("pneumatic-cylinder").run.stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""


def run(inputs: np.ndarray, effects: tuple[ActiveEffect, ...] = (), **given: Any) -> np.ndarray:
    return simulate(VALVE, VALVE.typical, Drive(inputs, math.nan, 1e-3), effects, **given)


@pytest.mark.parametrize(
    ("inputs", "given", "said"),
    [
        (np.zeros(COUNT), {}, r"inputs of shape \(10,\); a row of one or more samples .* command \[%\]"),
        (np.zeros((2, COUNT)), {}, r"inputs of shape \(2, 10\)"),
        (np.zeros((1, 0)), {}, r"inputs of shape \(1, 0\)"),
        (np.zeros((1, COUNT)), {"trace": np.zeros((1, COUNT))}, r"trace of shape \(1, 10\); a row of 10 samples"),
        (np.zeros((1, COUNT)), {"inject": ("flow", np.zeros(3))}, r"disturbance at flow of shape \(3,\).*\(10,\)"),
        (np.zeros((1, COUNT)), {"inject": ("flwo", np.zeros(COUNT))}, "did you mean 'flow'"),
        (np.zeros((1, COUNT)), {"effects": (ActiveEffect("friction", "flow", {}),)}, "'friction at flow'.*known: "),
    ],
)
def test_what_does_not_fit_is_refused(inputs, given, said):
    with pytest.raises(InputError, match=said):
        run(inputs, **given)


def nested(force: Any, x: Any, c: Any, hook: Any) -> Any:
    """A page with a hook within an expression."""
    return 2.0 * hook.sensor(x.place), x.speed


def misspelt(force: Any, x: Any, c: Any, hook: Any) -> Any:
    """A page with a hook that the plant does not have."""
    reading = hook.senser(x.place)
    return reading, x.speed


def forgotten(force: Any, x: Any, c: Any, hook: Any) -> Any:
    """A page with a coefficient that nobody works out."""
    x.speed += c.mobilty * force
    return x.place, x.speed


def undeclared(force: Any, x: Any, c: Any, hook: Any) -> Any:
    """A page with a state that the plant does not list."""
    x.plase += force
    return x.place, x.speed


@pytest.mark.parametrize(
    ("page", "line", "said"),
    [
        (nested, 2, r"hook.sensor\(…\) stands within an expression; write `name = hook.sensor\(…\)`"),
        (misspelt, 2, "no hook named 'senser', did you mean 'sensor'.* known: coil, command, "),
        (forgotten, 2, "no coefficient named 'mobilty', did you mean 'mobility'"),
        (undeclared, 2, "no state named 'plase', did you mean 'place'.* known: line, place, speed"),
    ],
    ids=lambda of: getattr(of, "__name__", None),
)
def test_a_fault_of_a_page_is_said_with_its_line(page, line, said):
    axis = kernel("linear-axis")
    at = page.__code__.co_firstlineno + line
    with pytest.raises(FileError, match=rf"test_physics_simulate\.py:{at}: {said}"):
        _ = replace(axis, plant=replace(axis.plant, equations=page)).run


STRANGER = """
from dataclasses import replace
from hil.physics.plants import linear_axis
from hil.physics.plants.linear_axis import coefficients

def equations(force, x, c, hook):
    {first}
    x.place += x.speed
    {second}
    {third}
    return reading, x.speed

HOOKS = {{hook.name: hook for hook in linear_axis.PLANT.hooks}}
PLANT = replace(linear_axis.PLANT, name="{name}", equations=equations, hooks=(
    HOOKS["command"], replace(HOOKS["force"], extra={extra!r}), HOOKS["sensor"]))
"""
FINE = ("force = hook.command(force)", "x.speed = hook.force(x.speed, c.mobility)", "reading = hook.sensor(x.place)")
WRONG = {
    "few": (FINE[0], "x.speed = hook.force(x.speed)", FINE[2], "mobility", 9,
            ('hook.force(…) is called with 1 argument; PLANT declares the hook with extra="mobility", so write '
            "`force = hook.force(value, mobility)`")),
    "many": (FINE[0], FINE[1], "reading = hook.sensor(x.place, 1.0)", "mobility", 10,
             ("hook.sensor(…) is called with 2 arguments; PLANT declares the hook with no extra, so write "
             "`value = hook.sensor(value)`")),
    "lacking": (FINE[0], "x.speed = hook.force(x.speed)", FINE[2], "", 9,
                ('hook.force(…): effect friction, which acts at a hook of this name, takes \'mobility\' as well; say '
                'extra="mobility" of the hook in PLANT and write `force = hook.force(value, mobility)`')),
    "never": ("pass", FINE[1], FINE[2], "mobility", 6,
              "hook 'command' is declared in PLANT and never called; write `value = hook.command(value)`"),
    "twice": (FINE[0], FINE[1], "reading = hook.sensor(hook.sensor(x.place))", "mobility", 10,
              "hook.sensor(…) is called twice; an effect acts at one place"),
}  # fmt: skip


def test_a_strangers_plant_that_calls_a_hook_wrongly_is_told_when_it_is_loaded(tmp_path):
    package = tmp_path / "bent_plants"
    package.mkdir()
    (package / "__init__.py").write_text('"""Plants of a stranger."""\n')
    for name, (first, second, third, extra, _line, _said) in WRONG.items():
        text = STRANGER.format(first=first, second=second, third=third, extra=extra, name=name)
        (package / f"{name}.py").write_text(f'"""Bent."""{text}')
    info = tmp_path / "bent-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bent\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[hil.plants]\nbent = bent_plants\n")
    load = "import hil\nfrom hil.physics.compose import kernel\n" + "".join(
        f"try: hil.typical_model('{name}'); kernel('{name}'); print('loaded')\n"
        "except hil.errors.FileError as error: print(error)\n"
        for name in WRONG
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", load], capture_output=True, encoding="utf-8", env=environment)
    assert done.stdout.splitlines() == [
        f"{package / name}.py:{line}: {said}" for name, (*_, line, said) in WRONG.items()
    ], done.stderr


def test_a_twin_refuses_a_block_of_another_shape():
    twin = Twin(VALVE, VALVE.typical, 1e-3)
    twin.advance(np.zeros((1, COUNT)))
    with pytest.raises(InputError, match="inputs of shape"):
        twin.advance(np.zeros((2, COUNT)))


def test_an_effect_is_found_under_its_name():
    assert tuple(effect(entry.name) for entry in entries("effects")) == effects()
    assert [found.name for found in effects()] == [entry.name for entry in entries("effects")]
    with pytest.raises(UnknownNameError, match="no effect named 'fricton', did you mean 'friction'"):
        effect("fricton")


def test_values_that_were_simulated_before_are_not_mistaken_for_others():
    inputs = np.tile([40.0, -60.0], (1, 50))
    leaks = [ActiveEffect("leakage", "flow", {"leak": leak, "fall": 0.3, "lean": 0.0}) for leak in (3.0, 4.0)]
    slow = VALVE.typical | {"pilot_rate": 3.0}
    asked: list[tuple[dict[str, float], tuple[ActiveEffect, ...], float]] = [
        (dict(values), effects, interval_s)
        for values in (VALVE.typical, slow)
        for effects in ((), (leaks[0],), (leaks[1],))
        for interval_s in (1e-3, 2e-3)
    ]

    def answers(fresh):
        made = []
        for values, switched_on, interval_s in asked:
            if fresh:
                plant_at.cache_clear()
                effects_at.cache_clear()
            made.append(simulate(VALVE, values, Drive(inputs, math.nan, interval_s), switched_on).tobytes())
        return made

    alone = answers(fresh=True)
    assert len(set(alone)) == len(asked)
    assert answers(fresh=False) == alone
    assert answers(fresh=False) == alone


def test_a_fit_works_out_the_same_values_once_for_all_its_recordings():
    calls = []

    def counted(values, step_s):
        calls.append(step_s)
        return VALVE.coefficients(values, step_s)

    watched = replace(kernel("brevini-hpv41"), plant=replace(VALVE, coefficients=counted))
    values = tuple(VALVE.typical.items())
    for _ in range(3):
        plant_at(watched, 1e-3, values)
    assert calls == [math.inf, 1e-3]
    plant_at(replace(watched), 1e-3, values)  # a plant that was edited since has another kernel
    assert len(calls) == 4


def test_what_another_process_hands_over_is_simulated_the_same():
    """A cluster hands arrays over read-only, a table's column lies in strides."""
    inputs = np.linspace(0.0, 50.0, COUNT)[None, :]
    locked = inputs.copy()
    locked.setflags(write=False)
    column = np.asfortranarray(np.vstack([inputs, inputs]))[:1]
    for given in (locked, column):
        assert not (given.flags.writeable and given.flags.c_contiguous)
        np.testing.assert_array_equal(run(given), run(inputs))


def test_a_plant_is_compiled_once_however_many_processes_need_it(tmp_path):
    alone = [sys.executable, "-c", COMPILED]
    environment = os.environ | {"HIL_CACHE_DIR": str(tmp_path)}
    started = [subprocess.Popen(alone, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    said = [process.communicate()[0].split() for process in started]
    assert sorted(said) == [["0", "1"], ["1", "0"], ["1", "0"]]
