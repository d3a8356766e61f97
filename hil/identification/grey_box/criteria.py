"""The numbers that decide in this room: what a fit is believed of, and how widely it is searched."""

from __future__ import annotations

from dataclasses import dataclass

from hil.identification.preparation.criteria import Criteria as Preparation

_SIGMAS = Preparation().significant


@dataclass(frozen=True, slots=True)
class Criteria:
    """What is believed of a fit.

    Attributes:
        misfit: mean square of residuals, in units of the noise's, from which a model leaves more than noise.
        hum_misfit: root mean square in units of the floor, from which lines of a residual are no hum.
        decisive: χ² by which another reading instant must be better. `as_good`: variances by which a fit may be worse
            and still be as good: three standard deviations. `corner`: of a slope, by which it may bend over its step.
        late: share more of samples that is left out, from which a unit is slower than the start says.
        mostly: share of what a model leaves that lies where less than this share of the time is.
        by_chance: variances of the residual by which noise lowers a sum of squares with every unknown.
        plain: unknowns of a gain, an offset and a pair of poles, beside a bend.
        fewest_cycles: of a hum in a recording; slower ones are drift.
        commanded, commanded_ratio: a line of a command over its strongest, and over its own neighbourhood.
        few_lines, strong_line, harmonics: a command of so few lines, each of this share of its strongest, drives a unit
            at them and at so many of their harmonics.
        still_moving, rest_times, fewest_rest: share of the noise by which a model may move at rest, times that as long
            as it moves a command has stood, and samples of a mean at rest.
        repeats: mean square, over its power, by which a command may differ from itself a period before.
        followed: share of its scatter, and of the way, below which a finer solver moves no value.
    """

    misfit: float = 1.5
    hum_misfit: float = 2.0
    decisive: float = 25.0
    as_good: float = _SIGMAS**2
    corner: float = 0.3
    late: float = 0.1
    mostly: float = 0.5
    by_chance: float = 1.0
    plain: int = 4
    fewest_cycles: int = 20
    commanded: float = 1e-4
    commanded_ratio: float = 10.0
    few_lines: int = 4
    strong_line: float = 0.01
    harmonics: int = 5
    still_moving: float = 0.1
    rest_times: int = 3
    fewest_rest: int = 100
    repeats: float = 1e-8
    followed: float = 0.1


@dataclass(frozen=True, slots=True)
class Effort:
    """How widely is searched.

    Attributes:
        restarts: factors of times and rates that are tried where a fit leaves more than noise.
        far_places, fewest_places, far_residuals, far, far_fitted: of grossly different starts: places that are looked
            at, fewer where that were more residuals; times a size away; how many are fitted.
        blocks, foretold: of a recording, and which are foretold from those on one side of them.
        trial_times, starts, judged: of a form: times that are tried, starts that are fitted, forms that are judged.
        search_evaluations, refined_evaluations, coarse, fine: of a fit, and where it ends: parts of `by_chance`.
        first_step, doublings: standard uncertainties of a walk away from a corner, and how often that is doubled.
        line_grids, neighbourhood, lowest_bins, line_bins: steps of a search for a line's frequency, in bins; bins that
            it stands out from; near the first bin; its width.
        solver, solver_rounds: times finer steps of the solver, and rounds of following where they lead.
        addition: of what passes a hook, so small that it acts in proportion.
        linear_rounds, samples_per_unknown, coarser: of a linear start: rounds, samples, and ever coarser ones.
        compared_blocks, worst: blocks of a comparison, and how many of the worst are reported.
        probes: samples at which a period is tried before it is tried at all of them.
        block: residuals over which their colour shows.
    """

    restarts: tuple[float, ...] = (0.4, 2.5)
    far_places: int = 128
    fewest_places: int = 8
    far_residuals: int = 10_000_000
    far: float = 30.0
    far_fitted: int = 3
    blocks: int = 5
    foretold: tuple[int, ...] = (3, 4, 1, 0)
    trial_times: int = 6
    starts: int = 3
    judged: int = 6
    search_evaluations: int = 25
    refined_evaluations: int = 60
    coarse: float = 0.5
    fine: float = 0.01
    first_step: float = 4.0
    doublings: int = 8
    line_grids: tuple[float, ...] = (1.0, 0.2, 0.04)
    neighbourhood: int = 101
    lowest_bins: int = 7
    line_bins: int = 3
    solver: float = 8.0
    solver_rounds: int = 12
    addition: float = 1e-3
    linear_rounds: int = 6
    samples_per_unknown: int = 10
    coarser: int = 4
    compared_blocks: int = 50
    worst: int = 3
    probes: int = 16
    block: int = 200


CRITERIA, EFFORT = Criteria(), Effort()
