"""A peer of the diagnosis: a plain Gaussian process for what the nominal model leaves (Kennedy and O'Hagan's δ).

scikit-learn, squared exponential kernel with a length for each input and white noise, on the residual as a function
of the command now, 0.1 s and 0.4 s ago, the nominal model's output and its rate. The lengths are found by maximum
likelihood on 500 samples spread over all recordings (from two starts), then 2500 samples are taken in. It gives a
better prediction; it has no names to give, so it is judged by the fit alone.
"""

from __future__ import annotations

import warnings

import numpy as np
from _concealed import Answer, Case, nominal_output
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from hil.identification.preparation.experiment import Experiment
from hil.record.recording import Array

_DELAYS_S = (0.1, 0.4)
_TO_TUNE, _TO_FIT, _AT_ONCE = 500, 2500, 5000


def answer(case: Case) -> Answer:
    inputs = np.concatenate([_inputs(case, e) for e in case.changed])
    left = np.concatenate([e.output - nominal_output(case, e) for e in case.changed])
    centre, spread = inputs.mean(axis=0), np.maximum(inputs.std(axis=0), 1e-12)
    scaled = (inputs - centre) / spread
    chosen = np.random.default_rng(1).permutation(len(left))
    few, many = chosen[:_TO_TUNE], chosen[:_TO_FIT]
    kernel = ConstantKernel(1.0, (1e-3, 1e3)) * RBF(np.ones(inputs.shape[1]), (0.05, 1e3)) + WhiteKernel(0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a length at its bound is an input that does not matter
        tuned = GaussianProcessRegressor(kernel, normalize_y=True, n_restarts_optimizer=1, random_state=1)
        tuned.fit(scaled[few], left[few])
        process = GaussianProcessRegressor(tuned.kernel_, optimizer=None, normalize_y=True)
        process.fit(scaled[many], left[many])

    def predict(e: Experiment) -> Array:
        at = (_inputs(case, e) - centre) / spread
        parts = [process.predict(at[k : k + _AT_ONCE]) for k in range(0, len(at), _AT_ONCE)]
        output: Array = nominal_output(case, e) + np.concatenate(parts)
        return output

    return Answer("", (), predict)


def _inputs(case: Case, e: Experiment) -> Array:
    command, nominal, step_s = e.on_grid_input(), nominal_output(case, e), e.drive.interval_s
    columns = [command, nominal, np.gradient(nominal, step_s)]
    for delay_s in _DELAYS_S:
        k = round(delay_s / step_s)
        columns.append(np.concatenate((np.full(k, command[0]), command[:-k])))
    return np.column_stack(columns)
