"""A law that is looked for beside commands that do not arrive is fitted to the times at which nothing happened."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil.diagnosis.events.least_trimmed_squares import least_trimmed_squares, quiet
from hil.diagnosis.search.fits import fit
from hil.diagnosis.search.fitted import nothing
from hil.diagnosis.search.terms import all_terms
from hil.physics.simulate import ActiveEffect
from hil.record.recording import Array
from tests.concealed import commands, posed, records

LOOP = ActiveEffect("hysteresis", "pilot", {"width": 4.0, "reach": 8.0, "least": 0.3, "closing": 1.0})


def often_held() -> dict[str, Array]:
    """The commands of records(seed=7) with a quarter of a second in every two in which the last one stays."""
    made = {name: values.copy() for name, values in commands(np.random.default_rng(7)).items()}
    generator = np.random.default_rng(3)
    for values in made.values():
        for start in np.arange(150, len(values) - 200, 500) + generator.integers(0, 200, len(values) // 500):
            values[start : start + 60] = values[start - 1]
    return made


def test_the_quieter_part_of_the_time_is_the_same_in_every_channel():
    problem = posed(records(seed=3, with_spool=True)[:1])
    ((output, spool),) = problem.channel_slices()
    residuals = np.ones(len(problem.nominal_residuals))
    residuals[spool.start + 1000 : spool.start + 1500] = 9.0
    residuals[output.start + 2000 : output.start + 2500] = 3.0
    keep = quiet(problem, residuals)
    assert np.array_equal(keep[output], keep[spool])
    assert not keep[output][1000:1500].any()
    assert not keep[output][2000:2500].any()
    assert keep[output].mean() > 0.6


def test_a_law_does_not_bend_to_what_happens_beside_it():
    problem = posed(records((LOOP,), seed=7, arriving=often_held()))
    start = nothing(problem)
    terms = all_terms(problem, start.residuals)

    def fitted(name):
        term = next(t for t in terms if t.name == name and t.hook in ("pilot", "flow"))
        return fit(problem, replace(start, terms=(term,), values=(term.starts[0],)))

    loop, other = fitted("hysteresis"), fitted("saturation")
    found = least_trimmed_squares(problem, [other, loop, start])
    assert found is not None
    assert found.names == ("hysteresis",)
    assert abs(found.values[0][0] - 4.0) < 0.1
    assert abs(loop.values[0][0] - 4.0) > 0.3
    assert found.chi2 > loop.chi2
    assert least_trimmed_squares(problem, [start]) is None
