"""The dead time of a transfer function when its form was chosen: what other forms that fit as well say of it.

A form with too few poles makes up for them by a longer dead time, one with a zero in the right half plane by none. The
scatter of a fit knows nothing of that. So the forms with a dead time that evidence does not exclude are averaged, each
with the weight that its BIC gives it (Raftery, Bayesian model selection in social research, 1995). How long it is if
there is one is what is stated; that there is one is doubted in words where a zero describes it as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hil.identification.frequency.transfer_function import TransferFunctionFit
from hil.identification.uncertainty.evidence import EXCLUDED, VERY_STRONG, odds
from hil.language.note import Note
from hil.record.recording import Array
from hil.signals.interval import COVERED


def with_other_forms(
    chosen: TransferFunctionFit, fits: Sequence[TransferFunctionFit], criteria: Sequence[float]
) -> TransferFunctionFit:
    """The fit with the uncertainty of its dead time by the choice of its form, and with a note where it cannot be told.

    Args:
        chosen: one of the fits.
        fits: every form that was tried.
        criteria: their BIC.
    """
    near = [k for k, one in enumerate(criteria) if one <= min(criteria) + VERY_STRONG or fits[k] is chosen]
    near = [k for k in near if _tells(fits[k]) or fits[k] is chosen]
    rivals = [fits[k] for k in near]
    shares = odds([criteria[k] for k in near])
    by_zero = np.array([_is_by_zero(fit) for fit in rivals])
    if _is_by_zero(chosen):
        late = float(shares[[fit.form.dead_time for fit in rivals]].sum())
        return _noted(chosen, late) if late > EXCLUDED else chosen
    if not chosen.form.dead_time:
        return chosen
    if (without := float(shares[by_zero].sum())) > 0.5:
        return replace(_noted(chosen, 1.0 - without), form_std_s=math.inf)
    delayed = np.array([fit.form.dead_time for fit in rivals])
    return replace(chosen, form_std_s=_beyond_scatter(chosen, rivals, np.where(delayed, shares, 0.0)))


def with_disagreement(fits: Sequence[TransferFunctionFit]) -> list[TransferFunctionFit]:
    """Fits of one form to responses of one valve, each dead time with what they disagree about beyond their intervals.

    Electronics and transport delay every amplitude alike. What moves with amplitude all the same is what the form
    leaves out, as large as the variance between the responses (DerSimonian and Laird, Controlled Clin. Trials 7, 1986).
    """
    known = [fit for fit in fits if fit.form.dead_time and 0.0 < fit.coefficient_std[-1] < math.inf]
    if len(known) < 2:
        return list(fits)
    weights = np.array([fit.coefficient_std[-1] ** -2.0 for fit in known])
    values = np.array([fit.model.dead_time_s for fit in known])
    excess = float(weights @ (values - weights @ values / weights.sum()) ** 2) - (len(known) - 1)
    between_s = math.sqrt(max(excess, 0.0) / float(weights.sum() - weights @ weights / weights.sum()))
    return [replace(fit, form_std_s=math.hypot(fit.form_std_s, between_s)) for fit in fits]


def _is_by_zero(fit: TransferFunctionFit) -> bool:
    return not fit.form.dead_time and len(fit.model.right_half_plane_zeros) > 0


def _beyond_scatter(chosen: TransferFunctionFit, rivals: Sequence[TransferFunctionFit], shares: Array) -> float:
    """Root mean square distance of what the rivals say, with their scatter, beyond the scatter of the chosen."""
    own = chosen.model.dead_time_s
    square = [(fit.model.dead_time_s - own) ** 2 + _scatter(fit) ** 2 for fit in rivals]
    total = float(shares @ np.array(square)) / float(shares.sum())
    return math.sqrt(max(total - _scatter(chosen) ** 2, 0.0))


def _tells(fit: TransferFunctionFit) -> bool:
    """Whether a form says anything of a dead time: an interval that is wider than its value does not."""
    return not fit.form.dead_time or COVERED * _scatter(fit) < fit.model.dead_time_s


def _scatter(fit: TransferFunctionFit) -> float:
    return float(fit.scatter[-1]) if fit.form.dead_time else 0.0


def _noted(fit: TransferFunctionFit, late: float) -> TransferFunctionFit:
    note = Note(
        "these lines cannot separate a dead time ({share:.0f} % of the evidence) from a zero in the right half plane; "
        "higher frequencies or a step would",
        share=100.0 * late,
    )
    return replace(fit, notes=(*fit.notes, note))
