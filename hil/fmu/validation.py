"""What an FMU carries of itself: the model with its uncertainties and fits, and trajectories that it must reproduce.

Both lie in `resources` of the archive, where every importer leaves them alone: `model.json`, without the paths of the
recordings and without the skeleton, and `validation.csv`: time, the inputs, and what this program simulates.
"""

from __future__ import annotations

import csv
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hil.errors import FileError, InputError, reason
from hil.fmu.examine import ALLOWED, INTERVALS, excitation, played, simulated
from hil.fmu.variables import Variables, variables_of
from hil.physics.model import Model, load_model
from hil.record.csv_text import csv_text
from hil.record.plain import plain, to_json
from hil.record.recording import Array

MODEL, TRAJECTORIES = "resources/model.json", "resources/validation.csv"
_MOST_BYTES = 1 << 26


@dataclass(frozen=True, slots=True)
class ValidatedFmu:
    """How an FMU reproduced its own trajectories.

    Attributes:
        model: that it was made of, with its uncertainties, covariance and fits.
        samples: of the trajectories.
        difference: the largest, over all outputs, as a share of full scale.
        own_difference: likewise, of this program's simulation of the model inside.
    """

    model: Model
    samples: int
    difference: float
    own_difference: float

    @property
    def faults(self) -> tuple[str, ...]:
        """What is not as it was exported."""
        asked = {"the FMU": self.difference, "the model inside, simulated here,": self.own_difference}
        return tuple(
            f"{name} differs from the trajectories by {found:.2g} of full scale; allowed {ALLOWED:g}"
            for name, found in asked.items() if not found <= ALLOWED
        )  # fmt: skip

    @property
    def fit_percent(self) -> Mapping[str, Any]:
        """Of each recording that the model was identified with, in %; empty where it was not."""
        stated = self.model.origin.get("fit_percent")
        return stated if isinstance(stated, Mapping) else {}

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        return {
            "plant": self.model.plant, "samples": self.samples, "difference": self.difference,
            "own_difference": self.own_difference, "faults": list(self.faults), "fit_percent": plain(self.fit_percent),
            "parameters": plain({name: (v.value, v.std, v.unit) for name, v in self.model.parameters.items()}),
        }  # fmt: skip

    def as_text(self) -> str:
        """As lines for a terminal."""
        lines = [f"{self.model.plant}: {self.samples} samples, {'; '.join(self.faults) or 'reproduced'}"]
        lines += [f"  identified from {name}: fit {fit:.2f} %" for name, fit in self.fit_percent.items()]
        for name, value in self.model.parameters.items():
            interval = "" if value.std is None else f" ± {2.0 * value.std:.2g}"
            lines.append(f"  {name} = {value.value:.6g}{interval} {value.unit}")
        return "\n".join(lines)


def resources(variables: Variables) -> dict[str, str]:
    """The files that an FMU carries, by their place in the archive."""
    origin = {name: value for name, value in variables.model.origin.items() if name != "paths"}
    model = replace(variables.model, skeleton=None, origin=origin)
    inputs = excitation(variables)
    time_s = INTERVALS * variables.step_s * np.arange(inputs.shape[1])
    heads = ("time [s]", *(signal.heading for signal in (*variables.inputs, *variables.outputs)))
    rows = np.vstack((time_s, inputs, simulated(variables, inputs))).T.tolist()
    return {MODEL: to_json(model.as_dict()), TRAJECTORIES: csv_text(heads, rows)}


def validate(path: Path) -> ValidatedFmu:
    """Run an FMU on the inputs that it carries, and hold it against the outputs that it carries.

    An FMU is a program: this executes it, as every simulator does.

    Raises:
        FileError: no FMU, or one without trajectories. InputError: it does not run on this machine.
    """
    with tempfile.TemporaryDirectory() as folder:
        model, rows = _carried(path, Path(folder))
    step_s = float(np.median(np.diff(rows[:, 0]))) / INTERVALS
    variables = variables_of(model, (), step_s)
    inputs = rows[:, 1 : 1 + len(variables.inputs)].T.copy()
    expected = rows[:, 1 + len(variables.inputs) :].T
    scales = np.array([[signal.full_scale] for signal in variables.outputs])
    if expected.shape[0] != len(scales):
        raise FileError(f"{path}: {TRAJECTORIES} has {expected.shape[0]} outputs; the model has {len(scales)}")
    try:
        found = played(path, variables, inputs)
    except Exception as error:  # whatever FMPy or the binary says
        raise InputError(f"{path}: the FMU does not run here: {error}") from error
    own = simulated(variables, inputs)
    worst = [float(np.max(np.abs(one - expected) / scales)) for one in (found, own)]
    return ValidatedFmu(model, len(rows), *worst)


def _carried(path: Path, folder: Path) -> tuple[Model, Array]:
    try:
        with zipfile.ZipFile(path) as archive:
            for name in (MODEL, TRAJECTORIES):
                if archive.getinfo(name).file_size > _MOST_BYTES:
                    raise FileError(f"{path}: {name} is larger than any that this program writes")
                (folder / Path(name).name).write_bytes(archive.read(name))
        with (folder / "validation.csv").open(encoding="utf-8", newline="") as file:
            _, *lines = csv.reader(file)
        return load_model(folder / "model.json"), np.array(lines, dtype=np.float64)
    except FileNotFoundError:
        raise FileError(f"{path}: no such file") from None
    except KeyError:
        raise FileError(f"{path}: carries no trajectories of its own; FMUs that `hil export` writes now do") from None
    except (OSError, zipfile.BadZipFile, ValueError) as error:
        raise FileError(f"{path}: cannot be read as an FMU: {reason(error)}") from None
