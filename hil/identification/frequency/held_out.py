"""How well a form predicts lines of a frequency response that it was not fitted to."""

from __future__ import annotations

import numpy as np

from hil.identification.frequency.criteria import EFFORT
from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.identification.frequency.transfer_function import TransferFunctionFit, fit_form, whitening
from hil.record.recording import Array


def held_out(response: FrequencyResponse, fit: TransferFunctionFit) -> Array:
    """Squared whitened error per line, each predicted by a fit without it and every fifth other line.

    The first and last line always take part in the fit: beyond the ends a model extrapolates. Shape
    (inner lines,); empty when too few lines would remain.

    Args:
        response: all lines.
        fit: of all of them; the fits with lines left out begin at it.
    """
    form, weights = fit.form, fit.weights
    inner = np.arange(1, len(response) - 1)
    errors = np.full(len(inner), np.nan)
    white = whitening(response, weights)
    for fold in range(min(EFFORT.folds, len(inner))):
        out = inner[fold :: EFFORT.folds]
        kept = response.select(np.setdiff1d(np.arange(len(response)), out))
        if 2 * len(kept) <= form.unknowns:
            return np.empty(0)
        model = fit_form(kept, form, weights, fit.parameters).model
        error = model.at(response.frequency_hz[out]) - response.response[out]
        pairs = np.einsum("nij,nj->ni", white[out], np.stack((error.real, error.imag), axis=1))
        errors[out - 1] = np.sum(pairs**2, axis=1)
    return errors
