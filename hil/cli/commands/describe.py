"""`hil describe`: what the description of a device says, or everything that is wrong with it."""

from __future__ import annotations

import typer

from hil.cli.options import argument


def command(
    model: str = argument(..., "FILE.toml|NAME", "A description, or the name of one installed."),
) -> None:
    """Read the description of a device, tell every fault with its line, and print its page. Opens no device.

    The page is what an engineer compares with the manual: each terminal with its address as manuals count, type and
    scale; what makes the outputs safe, and what does not.
    """
    from hil.cli.faults import each_reported
    from hil.description.find import description_file, descriptions
    from hil.description.first import gaps
    from hil.description.page import page
    from hil.description.read import read_description
    from hil.untrusted import read_text

    path = description_file(model)
    with each_reported(path):
        description = read_description(path)
    named = path.stem if path == descriptions().get(path.stem) else path.name  # as a bench file beside it says it
    typer.echo("\n".join(page(named, description)))
    if left := gaps(read_text(path)):
        typer.echo(f"\n{left} gap{'s are' if left > 1 else ' is'} still marked in {path}")
