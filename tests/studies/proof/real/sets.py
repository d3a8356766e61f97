"""What is known of each set of recordings: its plant, what a simple model leaves out, and a fit to beat."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RealSet:
    """A set of recordings.

    Attributes:
        name: as in the table. `folder`: below the folder of all recordings. `plant`: of the library.
        fitted: pattern of the files that are fitted. Every other file of the folder that has the plant's channels is
            kept back.
        share: of each fitted recording, from its start; the rest of it is kept back.
        left_out: effects that the obvious model is known to leave out, under the names of the library.
        reference: fit % before and after, as published or by a quick fit; on whatever part it was given for.
        reference_of: what that fit is of.
        by_hand: effects of the library for the physics of that reference, as (name, hook). Fitted here without any
            search they say what such a fit reaches on the very part that is kept back here.
        alone: whether other files of the folder are of other units, and none is kept back.
    """

    name: str
    folder: str
    plant: str
    fitted: str
    share: float
    left_out: tuple[str, ...]
    reference: tuple[float, float]
    reference_of: str
    by_hand: tuple[tuple[str, str], ...]
    alone: bool = False


SETS = (
    RealSet(
        "axis, force in", "emps", "linear-axis", "closed-loop.csv", 0.5,
        ("friction", "load_force", "asymmetry"), (-4.0, 95.0), "position, open loop, validation record",
        (("load_force", "force"), ("friction", "force")),
    ),
    RealSet(
        "axis in its loop", "emps", "servo-axis", "closed-loop.csv", 0.5,
        ("friction", "load_force", "asymmetry", "sensor_offset"), (82.0, 94.0), "force, validation record",
        (("load_force", "force"), ("friction", "force")),
    ),
    RealSet(
        "cascaded tanks", "cascaded-tanks", "cascaded-tanks", "estimation.csv", 0.6,
        ("overflow",), (68.0, 84.0), "validation record",
        (("overflow", "upper"),),
    ),
    RealSet(
        "crane", "hydraulic-actuator", "hydraulic-actuator", "first-half.csv", 2 / 3,
        ("asymmetry", "orifice", "saturation", "turbulent_loss"), (36.0, 61.0), "second half",
        (("orifice", "edge"),),
    ),
    RealSet(
        "electro-hydraulic", "electro-hydraulic-actuator", "electro-hydraulic-actuator",
        "load[123]-stroke[13].csv", 1.0,
        ("internal_leakage", "compliance", "asymmetry"), (70.5, 86.0), "higher loads",
        (("internal_leakage", "chamber"), ("compliance", "chamber")),
    ),
    RealSet(
        "servo valve, flow", "servovalve-static", "servo-valve", "flow-gain.csv", 1.0,
        ("hysteresis", "supply_droop", "saturation"), (94.2, 97.3), "the sweep itself",
        (("hysteresis", "coil"),),
    ),
    RealSet(
        "servo valve, pressure", "servovalve-static", "servo-valve-blocked", "pressure-gain.csv",
        1.0, ("hysteresis", "land_leakage"), (91.9, 99.0), "the sweep itself",
        (("land_leakage", "blocked"), ("hysteresis", "coil")),
    ),
    RealSet(
        "pneumatic seal", "pneumatic-cylinder", "pneumatic-cylinder",
        "nap310-[37]bar.csv", 0.5,
        ("seal_friction",), (28.0, 81.0), "other pressures, the worse of two",
        (("seal_friction", "seal"),),
    ),
    RealSet(
        "throttle flap", "throttle-flap", "throttle-flap", "estimation.csv", 0.6,
        ("end_stop", "friction"), (30.0, 75.0), "another recording",
        (("end_stop", "stop"), ("friction", "force")),
    ),
    *(
        RealSet(
            f"coupled drives, {volts} V", "coupled-drives", "coupled-drives",
            f"amplitude-{volts.replace('.', 'p')}.csv", 0.6, ("blind_to_sign", "deadband"), reference,
            "the last 200 samples", (("blind_to_sign", "pickup"), ("deadband", "command")), alone=True,
        )
        for volts, reference in (("1.0", (-6.0, 76.0)), ("1.5", (-30.0, 77.0)))
    ),
    RealSet(
        "friction damper", "friction-damper", "friction-damper", "0p5hz-1in.csv", 1.0,
        ("friction", "backlash"), (-6.0, 80.0), "the other two recordings",
        (("band_friction", "band"), ("backlash", "opening")),
    ),
    RealSet(
        "magneto-rheological damper", "mr-damper", "mr-damper", "first-2000.csv", 0.6,
        ("hysteresis", "saturation"), (37.0, 84.0), "the rest of the recording",
        (("yielding", "field"), ("saturation", "opening")),
    ),
    *(
        RealSet(
            f"loop {name}", "valve-loops", "flow-loop", f"{name}.csv", 1.0,
            ("friction",) if name.startswith("stiction") else (), (float("nan"), float("nan")), "the label alone",
            (("stem_friction", "stem"),), alone=True,
        )
        for name in (
            "stiction-fic20102-1107", "stiction-fic20102-1118-1822", "stiction-lic30501-1107",
            "no-stiction-fic10201-1018", "no-stiction-fic20502-0904", "no-stiction-lic33101-1025",
        )
    ),
)  # fmt: skip
