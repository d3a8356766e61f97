"""What a law and a plant may write on while they are stepped: one numpy record each, passed by address."""

from __future__ import annotations

import numpy as np
from numba import float64, from_dtype, types, void

PARAMETERS = 12
"""Parameters of a law; the first is its strength, the last the number of the recording it runs in."""
KEY = PARAMETERS - 1
STATES = 8
REMEMBERED = 4096

LAW_MEMORY = np.dtype(
    [
        ("slot", "i8"),
        ("t", "f8"),  # s, time of the stage that is evaluated
        ("h", "f8"),  # s, solver step
        ("first", "i8"),  # 1 in the first stage of a step, where a law may write into `m`
        ("p", "f8", PARAMETERS),
        ("z", "f8", STATES),  # integrated by the solver
        ("dz", "f8", STATES),
        ("m", "f8", REMEMBERED),  # the law's own: reversal points, delay lines, relays
    ],
    align=True,
)

PLANT_MEMORY = np.dtype(
    [
        ("t", "f8"),
        ("u", "f8"),  # command, held and delayed
        ("c", "f8", 16),  # the unit's parameters
        ("s", "f8", 8),
        ("ds", "f8", 8),
        ("out", "f8", 4),  # what sensors would show: the output, then intermediate channels
    ],
    align=True,
)

_law_record = from_dtype(LAW_MEMORY)
PLANT_RECORD = from_dtype(PLANT_MEMORY)

LAWS_AT_ONCE = 3
LAW_SIGNATURE = float64(float64, float64, float64, _law_record)
LAW_TUPLE = types.UniTuple(types.FunctionType(LAW_SIGNATURE), LAWS_AT_ONCE)
LAW_RECORDS = _law_record[::1]
PLANT_SIGNATURE = void(PLANT_RECORD, LAW_TUPLE, LAW_RECORDS)
