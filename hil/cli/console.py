"""`hil console`: the operator's pages in a browser."""

from __future__ import annotations

from pathlib import Path

import typer

from hil.cli.runs import ARCHIVE


def command(
    host: str = typer.Option("127.0.0.1", "--host", help="Where it listens."),
    port: int = typer.Option(8123, "--port", min=0, max=65535, help="Its port; 0 takes one that is free."),
    benches: Path = typer.Option(Path(), "--benches", metavar="DIR", help="Folder of this lab's bench files."),
    archive: str = ARCHIVE,
    open_page: bool = typer.Option(False, "--open", help="Show it in the browser."),
) -> None:
    """Serve the operator's console: bench, run, results, diagnosis and devices as pages. Ctrl-C ends it.

    It holds nothing that a run needs: a run goes on when the console ends, and its stop button reaches it directly.
    """
    from hil.archive.place import DEFAULT_FOLDER, archive_place
    from hil.console.serve import serve
    from hil.console.site import Site
    from hil.safety.latch import state_path

    place = archive_place(archive)
    state = state_path("console", "any", "").parent
    site = Site(place, place.folder or DEFAULT_FOLDER.resolve(), benches.resolve(), state)

    def ready(address: str) -> None:
        typer.echo(f"console at {address}  runs in {site.runs}; Ctrl-C ends it, runs go on")
        if open_page:
            typer.launch(address)

    serve(site, host, port, ready)
