"""The skeleton misfit as a model file keeps it, and made anew from recordings."""

from __future__ import annotations

import base64
import hashlib
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hil.diagnosis.intake.problem import pose
from hil.diagnosis.skeleton.gate import Before, are_enough, before_of
from hil.diagnosis.skeleton.misfit import RIDGE, Misfit, Remainder
from hil.diagnosis.skeleton.rows import Column, Rows, columns_of, row_s, rows_of
from hil.identification.preparation.experiment import Experiment
from hil.identification.preparation.gaps import bridged
from hil.identification.preparation.start_in_motion import begun_in_motion
from hil.identification.uncertainty.noise import channel_floors
from hil.physics.compose import kernel
from hil.physics.model import Model
from hil.record.recording import Array
from hil.signals.products import one_blas_thread

VERSION = 7
# Simulated samples that a table may take, and the columns that it has at the least.
_MOST_SAMPLES, _FEWEST = 3e8, 60
# The largest array that is unpacked; a table has 1 MB.
_MOST_BYTES = 1 << 24


@dataclass(frozen=True)
class Table:
    """What is kept of the recordings that a model was identified from.

    Attributes:
        columns: what the library could change. `library`: a checksum of what could be.
        floors: noise of each channel, by name. `row_s`: length of a row. `before`: what was learned from them.
        beyond_noise: variance that the nominal model left of them beyond its noise, as a share of that, colour and all.
    """

    columns: tuple[Column, ...]
    library: str
    floors: Mapping[str, float]
    row_s: float
    before: Before
    beyond_noise: float

    def rows(self, model: Model, experiments: Sequence[Experiment]) -> Rows:
        """Later recordings in the rows of this table."""
        return rows_of(model, experiments, self.columns, self.floors, self.row_s)

    def as_dict(self) -> dict[str, Any]:
        """As JSON values, arrays in single precision, compressed, in base 64."""
        b, r = self.before, self.before.remainder
        packed = {
            "mean": r.mean, "std": r.std, "log_variance": r.coefficients, "count_as_one": b.count_as_one,
            "information": b.information, "blocks": b.blocks,
        }  # fmt: skip
        return {
            "version": VERSION, "library": self.library, "row_s": self.row_s, "floors": dict(self.floors),
            "columns": [[c.name, c.hook, {k: float(v) for k, v in c.values.items()}] for c in self.columns],
            "misfits": [
                {"channel": m.channel, "ridge": m.ridge, "rms": _packed(m.rms),
                 "coefficients": _packed(m.coefficients), "directions": _packed(m.directions)}
                for m in b.misfits
            ],
            "scale": [r.white, r.factor, r.whole], "least": b.least, "leverage": b.leverage,
            "reach": list(b.reach), "uneven": b.uneven, "left": b.left,
            "beyond_noise": self.beyond_noise, "arrays": {k: _packed(v) for k, v in packed.items()},
        }  # fmt: skip


def table_of(model: Model, experiments: Sequence[Experiment]) -> Table | None:
    """What a model leaves of the recordings that it was identified from, or of others of the same date.

    None where they are too short to tell what an unchanged unit leaves.
    """
    even, _ = bridged(model, [e.reading_as_in(model) for e in experiments])
    experiments = [begun_in_motion(model, e)[0] for e in even]
    with one_blas_thread():
        problem = pose(model, experiments)
        beyond = problem.excess(float(problem.nominal_residuals @ problem.nominal_residuals))
        columns = _affordable(columns_of(pose(replace(model, noise=None), experiments)), experiments)
        found = channel_floors([{"output": e.valid_output, **e.valid_observed} for e in experiments])
        floors = {name: max(own.get(name, 0.0) for own in found) for each in found for name in each}
        length_s = row_s(model, experiments)
        rows = rows_of(model, experiments, columns, floors, length_s)
        if not are_enough(rows):
            return None
        return Table(columns, library_of(model), floors, length_s, before_of(rows), beyond)


def _affordable(columns: Sequence[Column], experiments: Sequence[Experiment]) -> tuple[Column, ...]:
    """All columns; evenly fewer of them where recordings are very long."""
    samples = sum(e.drive.inputs.shape[1] for e in experiments)
    most = max(_FEWEST, int(_MOST_SAMPLES / samples))
    kept = np.unique(np.linspace(0, len(columns) - 1, min(most, len(columns))).astype(int)) if columns else ()
    return tuple(columns[k] for k in kept)


def read_table(kept: Mapping[str, Any], model: Model) -> Table:
    """The table of a model file; columns that the library has no more are left out.

    Raises:
        KeyError, ValueError, TypeError: it is none of this version.
    """
    a = {name: _unpacked(value) for name, value in kept["arrays"].items()}
    white, factor, whole = map(float, kept["scale"])
    every = [Column(str(n), str(h), {str(k): float(v) for k, v in values.items()}) for n, h, values in kept["columns"]]
    can_be = _changes(model)
    there = np.array([(c.name, c.hook, *sorted(c.values)) in can_be for c in every], dtype=np.bool_)
    misfits = tuple(
        Misfit(int(m["channel"]), _unpacked(m["rms"])[there], _unpacked(m["coefficients"])[there],
               _unpacked(m["directions"])[:, there], float(m.get("ridge", RIDGE)))
        for m in kept["misfits"]
    )  # fmt: skip
    before = Before(
        misfits, Remainder(a["mean"], a["std"], a["log_variance"], white, factor, whole), a["count_as_one"][there],
        float(kept["least"]), a["information"][there], a["blocks"][there], float(kept["leverage"]),
        tuple(map(float, kept["reach"])), float(kept["uneven"]), float(kept["left"]),
    )  # fmt: skip
    columns = tuple(c for c, is_there in zip(every, there, strict=True) if is_there)
    beyond = float(kept["beyond_noise"])
    return Table(columns, str(kept["library"]), dict(kept["floors"]), float(kept["row_s"]), before, beyond)


def library_of(model: Model) -> str:
    """A checksum of what the library can change in a model, and of how that is kept."""
    return hashlib.sha256(repr((VERSION, sorted(_changes(model)))).encode()).hexdigest()[:16]


def _changes(model: Model) -> set[tuple[str, ...]]:
    """What can be changed in a model: effects by name, hook and parameters, and base parameters."""
    effects = {(s.effect.name, s.hook.name, *sorted(p.name for p in s.effect.parameters)) for s in
               kernel(model.plant).sites}  # fmt: skip
    return effects | {(p.name, "", p.name) for p in model.definition.parameters}


def _packed(values: Array) -> str:
    """Shape and numbers: `327x4:…`; those beyond single precision, as of recordings without noise, at its end."""
    most = float(np.finfo(np.float32).max)
    data = zlib.compress(np.clip(values, -most, most).astype("<f4").tobytes(), 9)
    return f"{'x'.join(map(str, values.shape))}:{base64.b64encode(data).decode()}"


def _unpacked(text: str) -> Array:
    shape, _, data = text.partition(":")
    unpacked = zlib.decompressobj().decompress(base64.b64decode(data), _MOST_BYTES)  # a model may be a stranger's
    return np.frombuffer(unpacked, dtype="<f4").astype(np.float64).reshape([int(n) for n in shape.split("x")])
