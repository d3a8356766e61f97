"""A recording by what is in it, whatever its file is called or in which format it is."""

from __future__ import annotations

import hashlib

import numpy as np

from hil.identification.preparation.experiment import Experiment
from hil.physics.model import Model


def content_of(e: Experiment) -> str:
    """The SHA-256 of the command and the output, in single precision: text files of seven digits hold no more."""
    found = hashlib.sha256(np.ascontiguousarray(e.drive.inputs, dtype=np.float32).tobytes())
    found.update(np.ascontiguousarray(e.output, dtype=np.float32).tobytes())
    return found.hexdigest()


def is_of_its_origin(model: Model, e: Experiment) -> bool:
    """Whether the model was identified from this recording, by its content."""
    return content_of(e) in (model.origin.get("content") or {}).values()
