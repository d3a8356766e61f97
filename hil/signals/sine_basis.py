"""Sines and cosines of a fundamental and its harmonics on given stamps, and sums over them.

A sine fit never needs its design matrix: it needs sums of sines (known in closed form when stamps are even)
and the projections of the data. On even stamps e^(ikωt) splits into a phasor per block of samples times a
phasor within the block, so that both a projection and a synthesis are one small matrix product.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hil.arrays import Array, Complex
from hil.signals.products import rows_by_columns, rows_by_rows

# Stamps count as even when the phase of the top harmonic is wrong by less than this (rad).
_EVEN_PHASE = 1e-6


@dataclass(frozen=True, slots=True)
class SineBasis:
    """e^(ikωt) for k = 1…`harmonics` at every stamp, as (block phasors) × (phasors within a block).

    Attributes:
        samples: number of stamps.
        blocks: shape (number of blocks, harmonics). `within`: shape (block length, harmonics).
        sums: Σ e^(ikωt) over the stamps for k = 0…2·harmonics.
    """

    samples: int
    blocks: Complex
    within: Complex
    sums: Complex

    @property
    def harmonics(self) -> int:
        """Number of harmonics, the fundamental included."""
        return int(self.within.shape[1])

    def project(self, signals: Array) -> Complex:
        """Σ s·e^(ikωt) over the stamps; shape (m, harmonics) for signals of shape (m, n)."""
        count, length = len(self.blocks), len(self.within)
        padded = np.zeros((len(signals), count * length))
        padded[:, : self.samples] = signals
        parts = rows_by_rows(padded.reshape(-1, length), np.ascontiguousarray(_real_pairs(self.within).T))
        per_block = parts.view(np.complex128).reshape(len(signals), count, -1)
        return (per_block * self.blocks).sum(axis=1)

    def synthesise(self, weights: Complex) -> Array:
        """Re Σ w_k·e^(ikωt) at every stamp, shape (n,)."""
        table = np.ascontiguousarray(_real_pairs(np.conj(self.within)).T)  # Re(a·b) = Re a·Re b − Im a·Im b
        return rows_by_columns(_real_pairs(self.blocks * weights), table).reshape(-1)[: self.samples]


def sine_basis(time_s: Array, frequency_hz: float, harmonics: int) -> SineBasis:
    """The basis on stamps of shape (n,), even or not."""
    n = len(time_s)
    omega = 2.0 * math.pi * frequency_hz
    step = (time_s[-1] - time_s[0]) / (n - 1)
    even = time_s[0] + step * np.arange(n)
    top = np.arange(1, harmonics + 1)
    if omega * harmonics * float(np.max(np.abs(time_s - even))) > _EVEN_PHASE:
        turns = np.exp(1j * omega * time_s)
        powers = np.multiply.accumulate(np.broadcast_to(turns[:, None], (n, 2 * harmonics)), axis=1)
        sums = np.concatenate(([n], powers.sum(axis=0)))
        return SineBasis(n, np.ones((1, harmonics), complex), powers[:, :harmonics].copy(), sums)
    length = max(1, math.isqrt(n))
    count = -(-n // length)
    blocks = np.exp(1j * omega * np.outer(time_s[0] + step * length * np.arange(count), top))
    within = np.exp(1j * omega * step * np.outer(np.arange(length), top))
    middle = omega * (time_s[0] + time_s[-1]) / 2.0
    k = np.arange(2 * harmonics + 1)
    return SineBasis(n, blocks, within, np.exp(1j * k * middle) * _dirichlet(k * omega * step, n))


def gram(basis: SineBasis) -> Array:
    """Inner products of [1, sin ωt, cos ωt, sin 2ωt, cos 2ωt, …], shape (2·harmonics + 1,) squared."""
    k = np.arange(1, basis.harmonics + 1)
    plus, apart = k[:, None] + k, k[:, None] - k
    together, difference = basis.sums[plus], basis.sums[np.abs(apart)]
    made = np.empty((2 * len(k) + 1, 2 * len(k) + 1))
    made[0, 0] = basis.samples
    made[0, 1::2] = made[1::2, 0] = basis.sums[k].imag
    made[0, 2::2] = made[2::2, 0] = basis.sums[k].real
    made[1::2, 1::2] = (difference.real - together.real) / 2.0
    made[2::2, 2::2] = (difference.real + together.real) / 2.0
    made[1::2, 2::2] = (together.imag + np.sign(apart) * difference.imag) / 2.0
    made[2::2, 1::2] = made[1::2, 2::2].T
    return made


def interleaved(projections: Complex) -> Array:
    """Projections as [on sin ωt, on cos ωt, on sin 2ωt, …]; shape (m, 2·harmonics)."""
    made = np.empty((len(projections), 2 * projections.shape[1]))
    made[:, 0::2], made[:, 1::2] = projections.imag, projections.real
    return made


def _dirichlet(turn: Array, n: int) -> Array:
    """Σ e^(i·turn·j) over j = 0…n−1, about its middle."""
    half = np.sin(turn / 2.0)
    small = np.abs(half) < 1e-12
    return np.where(small, n * np.cos(turn * (n - 1) / 2.0), np.sin(n * turn / 2.0) / np.where(small, 1.0, half))


def _real_pairs(values: Complex) -> Array:
    """Complex (n, k) as real (n, 2k): real and imaginary parts side by side."""
    return np.ascontiguousarray(values).view(np.float64)
