"""The numbers that decide in this room: what is believed of a step, and how its response is smoothed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Criteria:
    """What is believed of a step response.

    Attributes:
        jump: of the command's span, from which a change is a step. `moved`: of the response's change, by which it has
            begun.
        rest_share, tail_share: of the time before and after a step: their ends give the values there.
        certain_onset: share of resampled responses that must move once and for all.
        sharper: standard deviations from which the sharper reading tells more than noise.
        moving: standard uncertainties of a move at the end: a run of twelve steps that stand says so in 3 %.
        still: of the change, by which the response may still move at its end without a word.
        sharp: of the time after the step, up to which time counts as it is, and its logarithm from there on.
        coefficients: of the smooth response.
        looser: times less stiff is the foot read, where the response is least smooth. An estimate as stiff as the whole
            asks for rounds it by more than recordings drawn again from that estimate show. Undersmoothed, noise
            outweighs it (Hall: Ann. Statist. 20(2), 1992); what the two read differently is granted.
    """

    jump: float = 0.01
    moved: float = 0.02
    rest_share: float = 0.25
    tail_share: float = 0.15
    certain_onset: float = 0.95
    sharper: float = 2.0
    moving: float = 3.0
    still: float = 0.002
    sharp: float = 0.005
    coefficients: int = 80
    looser: float = 100.0


CRITERIA = Criteria()
