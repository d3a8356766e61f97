"""The numbers that decide in this room: what is believed of lines and of forms, and how widely is searched."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Criteria:
    """What is believed of sines, lines and what is fitted to them.

    Attributes:
        heard_db, heard_deg: standard uncertainty up to which a line is heard: a third of it is noise.
        same_period, same_level: relative difference up to which two periods belong to one frequency; share of the
            amplitude within which levels are one test.
        moves: share of the amplitude by which a command moves in a quarter of a period, or it stands.
        turn_noises, turn_share: standard deviations, and share of the range, about the middle within which noise turns.
        fewest_samples: of a sine. `same_value`: share of its amplitude; closer values are one, calculated twice.
        floor: share of itself to which a response is believed at best: a held input's steps, stamps, converters.
        misfit: χ² per degree of freedom from which a form misses its lines.
        beyond: times the highest line, or that part of the lowest, at which a pole no longer shows in the band.
        near: a gain within this factor of a line's, or within its own interval, is one that the line comes near.
    """

    heard_db: float = 3.0
    heard_deg: float = 20.0
    same_period: float = 0.015
    same_level: float = 0.05
    moves: float = 0.05
    turn_noises: float = 5.0
    turn_share: float = 0.1
    fewest_samples: int = 16
    same_value: float = 1e-6
    floor: float = 1e-5
    misfit: float = 2.0
    beyond: float = 10.0
    near: float = 2.0


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is looked at.

    Attributes:
        grid: points of a curve on which a level is looked for. `step_samples`: of a step response.
        neighbours, share: silent lines averaged for the distortion at an excited one, and one in so many of them at
            most, so that the average follows the level over the band. `pooled`: lines over which noise is averaged.
        harmonics: of a sine. `listened`: of the longest sines: a hum may lie on a harmonic of one.
        poles, folds: of a form, at most; parts of the lines that are held out in turn.
        worst: lines of a comparison that are reported.
    """

    grid: int = 2000
    step_samples: int = 4000
    neighbours: int = 5
    share: int = 4
    pooled: int = 9
    harmonics: int = 5
    listened: int = 3
    poles: int = 5
    folds: int = 5
    worst: int = 3


CRITERIA, EFFORT = Criteria(), Effort()
