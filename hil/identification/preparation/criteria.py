"""The numbers that decide in this room: what is believed of a recording, and how much of it is looked at."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Criteria:
    """What is believed of samples, stamps, headings and starts.

    Attributes:
        significant: standard deviations from which chance is no explanation.
        fewest_samples: of a recording that is used at all. `fewest_at_rest`: that show a mean or a slope at rest.
        felt_bend: of the noise, by which a straight line may miss a channel between its samples.
        carried: samples in a period of a dither, below which a command cannot carry it.
        gap: intervals without a sample that are a hole. `on_grid`, `off_grid`: of an interval, within which stamps of
            several channels, or of one with holes, lie on an even grid. `most_times_longer`: a grid than its samples.
        steeper, least_jump: times as steep as beside a hole, and share of its span, by which a command has jumped.
        settled_after, forgotten_after: time constants after which a unit has settled, and nothing earlier shows in any
            noise. `unsettled_share`, `settling_share`: of a segment, at most, and where no time constant is known.
        clipped_share, clipped_run, clipped_gap: of samples at one extreme that are a range's end, so many of them in a
            row, and samples for which noise may leave it.
        chance_runs: expected number of runs of repeats in a recording where chance makes them. `adjacent`: samples on
            either side of one. `lone_s`, `lone_samples`: a single run so long is a recorder that stopped.
        same_run, fewest_runs: share of equal runs, and runs, of a slower channel that is held in between.
        loop_samples, follows, mostly_noise, decided: samples that show a closed loop, correlation of what is new in
            both, times the white floor of what is new in the output, share of its span of what is new in a command.
        same_frequency, sine_periods, line_width, all_power: of one sine: ratio of frequencies, periods, lines of its
            spectrum on either side, share of the power within them.
        grows, grown_samples: from quarter to quarter of a recording, faster than any integrator, and its samples.
        rise_samples: within 10 … 90 % of a step's response (Åström and Wittenmark take four to ten).
        lost_power: of a plant's motion, by means of neighbouring samples: estimates move by its root of their std.
        slip: standard deviations of noise by which a sine may slip where whole periods of it are left out.
        start, felt_start: standard deviations by which a first reading may be off, and of noise that it is felt by.
        good_fit, poor_fit: in %, from which on channels are what they say, and below which a model says nothing.
        less_than_own: in %, less than a model's own fit. `hopeless`, `fits_better`: of columns that are swapped.
        half, much_less, same_fit: of what is left, where another reading is believed; in % of one that fits as well.
        changed_gain: of a unit that is worn. `too_small`, `too_large`: outputs that no effect makes of the same shape.
        also_moves: by which ratios of level and motion may differ.
        range_of_noise: standard deviations within which an output stands. `driven_s`: twice that long it is looked at,
            longer than a valve's lag. `driven_harder`: times the command that moves it, beyond its hysteresis.
        same_interval, same_factor, largest_factor: logarithms within which stamps, or a channel, are off by a factor of
            units; the largest of those.
    """

    significant: float = 3.0
    fewest_samples: int = 20
    fewest_at_rest: int = 8
    felt_bend: float = 0.5
    carried: float = 4.0
    gap: float = 5.0
    on_grid: float = 0.01
    off_grid: float = 0.05
    most_times_longer: int = 10
    steeper: float = 3.0
    least_jump: float = 1e-3
    settled_after: float = 5.0
    forgotten_after: float = 10.0
    unsettled_share: float = 0.5
    settling_share: float = 0.1
    clipped_share: float = 0.002
    clipped_run: int = 5
    clipped_gap: int = 50
    chance_runs: float = 1e-4
    adjacent: int = 50
    lone_s: float = 1.0
    lone_samples: int = 50
    same_run: float = 0.95
    fewest_runs: int = 20
    loop_samples: int = 300
    follows: float = 0.3
    mostly_noise: float = 2.0
    decided: float = 1e-6
    same_frequency: float = 1.05
    sine_periods: int = 3
    line_width: int = 3
    all_power: float = 0.999
    grows: float = 2.0
    grown_samples: int = 40
    rise_samples: float = 10.0
    lost_power: float = 0.05**2
    slip: float = 0.1
    start: float = 10.0
    felt_start: float = 0.1
    good_fit: float = 80.0
    poor_fit: float = 50.0
    less_than_own: float = 10.0
    hopeless: float = 35.0
    fits_better: float = 20.0
    half: float = 0.5
    much_less: float = 0.2
    same_fit: float = 0.1
    changed_gain: float = 1.5
    too_small: float = 0.12
    too_large: float = 5.0
    also_moves: float = 0.5
    range_of_noise: float = 8.0
    driven_s: float = 0.1
    driven_harder: float = 1.15
    same_interval: float = 0.01
    same_factor: float = 0.08
    largest_factor: float = 2000.0


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is looked at and simulated.

    Attributes:
        most_samples: of all recordings together that are fitted whole: what more would add is not worth its hours.
        segment_samples, segment_constants: of an informative segment: samples, or time constants of the unit.
        segments, timed_segments: that are taken where no time constant is known, and where one is.
        lags: in samples, over which a command moves a plant. `past`: samples that predict the next.
        answers, samples_per_s, fewest_samples: simulations of a diagnosis, simulated samples for a second of its
            budget, and samples below which no budget cuts.
        loop_samples: that are looked at for a closed loop. `means_from`: values that are compared one by one.
        grid_per_sample: points of an even grid for each sample with an uneven stamp.
        rounds, level_step: of fitting commands before a recording; share of the command's range, for slopes.
        steps, step_samples: shares of full scale that a command steps by to show a time constant, a small one first,
            and samples of each. `resolved`: samples in a time constant. `instant`, `longest_s`: intervals between.
        shortest, longest, halvings: of the search for the longest lag that does not show, in samples.
    """

    most_samples: int = 300_000
    segment_samples: int = 30_000
    segment_constants: float = 40.0
    segments: int = 8
    timed_segments: int = 4
    lags: tuple[int, ...] = (1, 10, 100, 1000)
    past: int = 12
    answers: int = 10_000
    samples_per_s: float = 10e6
    fewest_samples: int = 12_000
    loop_samples: int = 20_000
    means_from: int = 1 << 16
    grid_per_sample: int = 8
    rounds: int = 3
    level_step: float = 0.1
    steps: tuple[float, ...] = (0.05, 0.25, 0.6)
    step_samples: int = 4000
    resolved: float = 20.0
    instant: float = 1e-3
    longest_s: float = 0.1
    shortest: float = 1e-2
    longest: float = 1e3
    halvings: int = 12


CRITERIA, EFFORT = Criteria(), Effort()
