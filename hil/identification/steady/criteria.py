"""The numbers that decide in this room: what is believed of a sweep, and how finely its curve is drawn."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Criteria:
    """What is believed of sweeps, waits and curves.

    Attributes:
        both_ways: share of the range that both branches must cover.
        parallel_after, most_dropped: lags after a turn until the response runs parallel to the command; share of the
            range that is left out for it, at most.
        gain_from, gain_to: of the response at the end, between which a gain is read. `foot_to`: up to which the edge of
            the dead band is read. `line_from, line_to`: of the lines through two sides that cross zero at the null.
        flat: of a line's slope: a curve that stays below it is saturated.
        side: share of a sweep that must lie beyond neutral. `steep`: of the steepest slope, where a loop is wide.
        clear: times its standard uncertainty: a response that can be read.
        stiction: by which static friction exceeds sliding friction, at most (Armstrong-Hélouvry, Automatica 30(7),
            1994). Friction that falls with speed as exp(−(v/v_s)²) differs between a sweep and one at half its speed by
            up to `between_speeds` of that. The straight line through both lies above the friction at rest by up to
            `at_rest` of it.
        turn, straight, stands: of the range: by which a command must come back for a turn, within which a ramp is a
            straight line in time, and a waiting command stays. `branch`: a shorter way between two turns is no branch.
        same_speed: relative difference of branches of one speed. `fewest_samples`: of a branch: fewer are a step.
        late: of the reach of a slow ramp, from which on the response follows.
        rest_s: the least that a coil's current stands.
    """

    both_ways: float = 0.25
    parallel_after: float = 5.0
    most_dropped: float = 0.2
    gain_from: float = 0.3
    gain_to: float = 0.9
    foot_to: float = 0.4
    line_from: float = 0.2
    line_to: float = 0.8
    flat: float = 0.5
    side: float = 0.05
    steep: float = 0.3
    clear: float = 10.0
    stiction: float = 0.3
    between_speeds: float = 0.39
    at_rest: float = 0.19
    turn: float = 0.05
    straight: float = 0.02
    stands: float = 0.002
    branch: float = 0.25
    same_speed: float = 0.1
    fewest_samples: int = 40
    late: float = 2 / 3
    rest_s: float = 0.2


@dataclass(frozen=True, slots=True)
class Effort:
    """How finely is looked.

    Attributes:
        levels, bins: of a curve, and of a sweep's range on each branch. `shown`: levels of a curve on a page.
        first_coefficients, coefficients, width_coefficients: of the smooth curve, at first and in the end, and of the
            one that says how the width of the loop differs. `rounds`: of shifting the branches together, at most.
        near, together: of the range: shifts that no longer matter, for a first look and for the result.
        points: at which a line or a slope is averaged. `edge_draws`: of an edge. `places`: of a window of command.
    """

    levels: int = 401
    bins: int = 240
    shown: int = 121
    first_coefficients: int = 40
    coefficients: int = 100
    width_coefficients: int = 24
    rounds: int = 4
    near: float = 1e-3
    together: float = 1e-6
    points: int = 200
    edge_draws: int = 12
    places: int = 8


CRITERIA, EFFORT = Criteria(), Effort()
