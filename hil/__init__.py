"""Hardware-in-the-loop test controller for electrically modulated hydraulic valves.

    import hil

    found = hil.identify(["response.csv"], "brevini-hpv41")
    print(found.text)

The names below are the public interface; `hil.api` says what each does. None is imported before it is used.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

# numba reads `.numba_config.yaml` in the working folder, which may name a folder of compiled code; what stands in the
# environment comes before it.
os.environ.setdefault("NUMBA_CACHE_DIR", "")

from hil.version import __version__ as __version__

if TYPE_CHECKING:
    from hil.api import (
        Model,
        Recording,
        Results,
        average,
        compare,
        compose,
        diagnose,
        diagnose_fleet,
        diff,
        export,
        find_runs,
        flow_curve,
        frequency_response,
        identify,
        issue_passport,
        learn_classes,
        linearise,
        load_model,
        open_bench,
        read,
        results,
        run,
        save_model,
        simulate,
        step_models,
        typical_model,
        write,
    )  # fmt: skip

__all__ = [
    "Model", "Recording", "Results", "average", "compare", "compose", "diagnose", "diagnose_fleet", "diff", "export",
    "find_runs", "flow_curve", "frequency_response", "identify", "issue_passport", "learn_classes", "linearise",
    "load_model", "open_bench", "read", "results", "run", "save_model", "simulate", "step_models",
    "typical_model", "write",
]  # fmt: skip


if not TYPE_CHECKING:  # a type checker sees the names above, and no others

    def __getattr__(name: str) -> Any:
        if name in __all__:
            from hil import api

            return getattr(api, name)
        raise AttributeError(f"module 'hil' has no attribute '{name}'; public are: {', '.join(__all__)}")


def __dir__() -> list[str]:
    return [*globals(), *__all__]
