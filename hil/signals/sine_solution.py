"""Linear least squares on sines, cosines and a few further columns, by its normal equations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hil.arrays import Array, Complex
from hil.errors import SettingError
from hil.signals.products import rows_by_columns, rows_by_rows
from hil.signals.sine_basis import SineBasis, gram, interleaved

# Smallest eigenvalue of the scaled inner products at which columns still count as different.
_DISTINCT = 1e-9


@dataclass(frozen=True, slots=True)
class Solved:
    """Least squares on a basis and extra columns.

    `inverse` is that of the normal matrix; `explained` is the power that the columns account for.
    """

    basis: SineBasis
    parameters: Array
    inverse: Array
    explained: float

    @property
    def phasors(self) -> Complex:
        """A_k·e^(iφ_k)."""
        pairs = self.parameters[1 : 1 + 2 * self.basis.harmonics]
        return pairs[0::2] + 1j * pairs[1::2]

    def residuals(self, values: Array, extras: Array) -> Array:
        """What the fit leaves, shape (n,)."""
        # A·sin(ωt + φ) = Re(−i·A·e^(iφ)·e^(iωt))
        sines = self.basis.synthesise(-1j * self.phasors)
        slow = rows_by_columns(self.parameters[None, 1 + 2 * self.basis.harmonics :], extras)[0]
        return values - self.parameters[0] - sines - slow


def solve(basis: SineBasis, values: Array, extras: Array, frequency_hz: float) -> Solved:
    """Least squares of samples on [1, sines, extras]; `extras` has shape (m, n).

    Raises:
        SettingError: the columns cannot be told apart on these stamps.
    """
    signals = np.vstack((values, extras))
    on_sines = interleaved(basis.project(signals))
    sums = signals.sum(axis=1)
    on_extras = rows_by_rows(signals, extras)
    sine_gram = gram(basis)
    mixed = np.column_stack((sums[1:], on_sines[1:]))
    normal = np.block([[sine_gram, mixed.T], [mixed, on_extras[1:]]]) if len(extras) else sine_gram
    right = np.concatenate((sums[:1], on_sines[0], on_extras[0]))
    scale = 1.0 / np.sqrt(np.diag(normal))
    scaled = normal * np.outer(scale, scale)
    if np.linalg.eigvalsh(scaled)[0] < _DISTINCT:
        raise SettingError(
            f"sine fit at {frequency_hz:g} Hz: {basis.samples} samples cannot tell {basis.harmonics} harmonics "
            f"from offset and drift; record longer or fit fewer harmonics"
        )
    inverse = np.linalg.inv(scaled) * np.outer(scale, scale)
    parameters = inverse @ right
    return Solved(basis, parameters, inverse, float(parameters @ right))
