"""`hil linearise`: a model about an operating point as a transfer function."""

from __future__ import annotations

from pathlib import Path

from hil.cli.options import Json, argument, option


def command(
    model: Path = argument(..., "MODEL", "Model file, or name of an installed model or plant."),
    at: float = option(..., "--at", "COMMAND", "Operating point, in the unit of the command."),
    step: float | None = option(None, "--step", "SIZE", "Of the command; 1 % of full scale."),
    window: float = option(1.0, "--window", "S", "Time in which the answer settles.", min=0.1),
    poles: int | None = option(None, "--poles", min=1, max=5, help="Beside an integrator; by evidence."),
    zeros: int | None = option(None, "--zeros", min=0, max=5, help="Likewise."),
    load_pressure: float = option(0.0, "--load-pressure", "BAR", "P_L for K_q and K_c."),
    changed: list[str] = option([], "--set", "NAME=VALUE", "Change a parameter first: coulomb=0."),
    out: Path | None = option(None, "--out", "MODEL.json", "Model to write; `hil export` takes it."),
    as_json: Json = False,
) -> None:
    """Linearise a plant about a command: transfer function, K_q and K_c of its edges, K_1/K_2 of an EFC."""
    from dataclasses import asdict

    from hil import api
    from hil.cli.places import check_file
    from hil.cli.printed import printed
    from hil.physics.formula import formula
    from hil.session.analyses import model_to_linearise

    given = model_to_linearise(model, changed)
    found = api.linearise(
        given, at, step=step, window_s=window, poles=poles, zeros=zeros, load_pressure_bar=load_pressure
    )  # fmt: skip
    if out is not None:
        check_file(out, [model])
        api.save_model(found.model.to_model(given.input, given.output), out)
    gains = {name: {"value": value, "unit": unit} for name, (value, unit) in found.gains.items()}
    content = {
        "schema": "hil.linearised/1", "at": at, "output": found.output, **asdict(found.model),
        "fit_percent": found.fit_percent, "gains": gains, "uneven": found.uneven, "notes": found.notes,
    }  # fmt: skip
    lines = [
        f"{given.plant} at {given.input} = {at:g}, {given.output} = {found.output:.5g}",
        f"  {formula(found.model)}, fit {found.fit_percent:.2f} %",
        *(f"  {name} {value:.5g} {unit}" for name, (value, unit) in found.gains.items()),
        f"  up and down differ by {100.0 * found.uneven:.2g} % of the answer",
        *(f"  note: {note}" for note in found.notes),
    ]
    printed(content, "\n".join(lines), as_json, indent=1)
