"""The variants of a shipped bench under which every figure is tried."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from hil.bench.find import benches
from hil.bench.read import read_bench


@dataclass(frozen=True)
class Effect:
    """An effect of the simulated bench: its name, where it sits, its parameters."""

    name: str
    hook: str
    parameters: dict[str, float]

    def __str__(self) -> str:
        values = ", ".join(f"{key} = {value}" for key, value in self.parameters.items())
        return f'{{ name = "{self.name}", hook = "{self.hook}", parameters = {{ {values} }} }}'


@dataclass(frozen=True)
class Situation:
    """A bench that departs from the shipped one.

    Attributes:
        name: as the table says it.
        noise: factor on all noise.
        bits: of the converters that read.
        effects: of each bench, in place of its own; benches not named keep theirs.
        drawn: whether each run draws an error of the calibration as the bench states it.
        settings: changed, by procedure.
        only: procedures that it is tried with; all when empty.
    """

    name: str
    noise: float = 1.0
    bits: int = 16
    effects: dict[str, tuple[Effect, ...]] = field(default_factory=dict)
    drawn: bool = False
    settings: dict[str, dict[str, str]] = field(default_factory=dict)
    only: tuple[str, ...] = ()


HPV41, EFC, ACCEPTANCE = "brevini-hpv41", "cummins-efc", "cummins-efc-acceptance"
FOUR_WAY, HPV41_LAB = "four-way-lab", "hpv41-lab"
CLOSED, OPEN = "hydraforce-sp08-47c", "hydraforce-open-loop"

_FRICTION = {"stiction": 1.2}
SITUATIONS = (
    Situation("as installed"),
    Situation("noise × 5", noise=5.0),
    Situation("noise ÷ 15", noise=1.0 / 15.0),
    Situation("10 bit", noise=0.2, bits=10),
    Situation("calibration drawn", drawn=True),
    Situation(
        "friction",
        effects={
            HPV41: (Effect("friction", "force", {"coulomb": 1.0, "stribeck": 10.0, "presliding": 0.2, **_FRICTION}),),
            EFC: (Effect("friction", "force", {"coulomb": 0.01, "stribeck": 0.1, "presliding": 0.002, **_FRICTION}),),
        },
    ),
    Situation("no friction", effects={ACCEPTANCE: (Effect("friction", "force", {"coulomb": 0.0}),)}),
    Situation(
        "backlash",
        effects={
            HPV41: (Effect("backlash", "opening", {"half_width": 1.0}),),
            EFC: (Effect("backlash", "opening", {"half_width": 0.01}),),
        },
    ),
    Situation("leakage", effects={HPV41: (Effect("leakage", "flow", {"leak": 1.4, "fall": 0.5, "lean": 0.0}),)}),
    Situation(
        "sensor drift",
        effects={
            HPV41: (Effect("sensor_drift", "sensor", {"rate": 0.021, "settling": 0.0}),),
            EFC: (Effect("sensor_drift", "sensor", {"rate": 0.06, "settling": 0.0}),),
        },
    ),
    Situation(
        "hum",
        effects={
            HPV41: (Effect("periodic_disturbance", "sensor", {"amplitude": 0.7, "frequency": 10.0, "phase": 0.0}),),
            EFC: (Effect("periodic_disturbance", "sensor", {"amplitude": 2.0, "frequency": 50.0, "phase": 0.0}),),
        },
    ),
    Situation(
        "two periods",
        settings={
            "frequency_response": {"measure_periods": "2", "measure_s": "0"},
            "efc_frequency_response": {"measure_periods": "2", "measure_s": "0"},
            "multisine_response": {"periods": "2"},
            "large_sine": {"cycles": "2"},
            "sine_position": {"cycles": "2"},
        },
        only=("frequency_response", "efc_frequency_response", "multisine_response", "large_sine", "sine_position"),
    ),
    Situation(
        "short sweep",
        settings={"flow_curve": {"cycle_s": "20"}, "pressure_current": {"cycle_s": "8"}},
        only=("flow_curve", "pressure_current"),
    ),
)


def without_noise(bench: str, situation: Situation) -> str:
    """The bench file of a situation with no noise and the finest converters."""
    text = read_bench(benches()[bench]).text
    text = re.sub(r"noise = [0-9.]+", "noise = 0.0", text)
    text = re.sub(r"noise_v = \S+", "noise_v = 0.0\nbits = 24", text)
    # a reading without noise stands as still as that of a dead sensor
    text = re.sub(r"\[interlocks\.[^\]]+\]\n(?:(?!\[)[^\n]*\n)*?stale_s[^\n]*\naction[^\n]*\n", "", text)
    text = re.sub(r"\nwitness = .*", "", text)  # a meter that drifts stands far from its rest at the end of a run
    if bench in situation.effects:
        text = re.sub(r"\neffects = .*", "", text)
        listed = ", ".join(map(str, situation.effects[bench]))
        text = text.replace("[simulation]\n", f"[simulation]\neffects = [{listed}]\n")
    return text
