"""The public interface for Python: what the commands do, as functions on values. The command line calls these.

    import hil

    found = hil.identify(["response.csv"], "brevini-hpv41")
    later = hil.read("later.csv", units={"flow": "l/min"})
    for comparison in hil.compare(found.model, [later]):
        print(comparison.as_text())
    answer = hil.diagnose(found.model, [later])
    print(answer.diagnosis.as_text())
    answer.plot()
    hil.save_model(answer.corrected, "corrected.json")

Where a recording is taken, the path of one will do, and where a model is taken, that of its file. Errors are
`hil.errors.HilError`, one sentence each.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.api.calculations import (
    compare,
    compose,
    diagnose,
    flow_curve,
    frequency_response,
    identify,
    learn_classes,
    linearise,
    simulate,
    step_models,
)
from hil.api.manual import calibrate, demo, jog, watch
from hil.api.models import export, load_model, save_model, typical_model, verify_fmu
from hil.api.recordings import average, read, write
from hil.api.runs import find_runs, open_bench, results, run
from hil.api.units import diagnose_fleet, diff, issue_passport

if TYPE_CHECKING:
    from hil.findings.results import Results
    from hil.physics.model import Model
    from hil.record.recording import Recording

__all__ = [
    "Model", "Recording", "Results", "average", "calibrate", "compare", "compose", "demo", "diagnose", "diagnose_fleet",
    "diff", "export", "find_runs", "flow_curve", "frequency_response", "identify", "issue_passport", "jog",
    "learn_classes", "linearise", "load_model", "open_bench", "read",
    "results", "run", "save_model", "simulate", "step_models", "typical_model", "verify_fmu", "watch",
    "write",
]  # fmt: skip

_TYPES = {"Model": "hil.physics.model", "Recording": "hil.record.recording", "Results": "hil.findings.results"}

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name in _TYPES:  # what they need takes time to import, and most commands need but one
            import importlib

            return getattr(importlib.import_module(_TYPES[name]), name)
        raise AttributeError(f"module 'hil.api' has no attribute '{name}'")
