"""`hil console`: the operator's pages in a browser."""

from __future__ import annotations

import sys
from pathlib import Path

import typer

from hil.cli.options import Archive, argument, option

group = typer.Typer()
users = typer.Typer(no_args_is_help=True, help="Accounts of the console.")
group.add_typer(users, name="user")


@group.callback(invoke_without_command=True)
def console(
    context: typer.Context,
    host: str = option("127.0.0.1", "--host", help="Where it listens."),
    port: int = option(8123, "--port", min=0, max=65535, help="Its port; 0 takes one that is free."),
    benches: Path = option(Path(), "--benches", "DIR", "Folder of this lab's bench files."),
    archive: Archive = "",
    cert: Path | None = option(None, "--cert", "FILE", "Certificate, where others reach it."),
    key: Path | None = option(None, "--key", "FILE", "Key of the certificate."),
    public: str = option("", "--public", "URL", "Its address behind a proxy: https://bench7.lab."),
    proxy: list[str] = option([], "--proxy", "ADDRESS", "A proxy that is believed who calls."),
    open_page: bool = option(False, "--open", help="Show it in the browser."),
) -> None:
    """Serve the operator's console: bench, run, results and diagnosis as pages. Ctrl-C ends it.

    It holds nothing that a run needs: a run goes on when the console ends, and its stop button reaches it directly.
    SIGTERM, as a service is ended, ends its runs too, with safe outputs; the console leaves after them.
    Beyond this computer (--host) it needs accounts and a certificate.
    """
    if context.invoked_subcommand:
        return
    from hil.archive.place import DEFAULT_FOLDER, archive_place
    from hil.console.access_where import Where
    from hil.console.serve import serve
    from hil.console.site import Site
    from hil.record.state import state_path

    if not benches.is_dir():
        raise typer.BadParameter(f"{benches}: no such folder", param_hint="--benches")
    place = archive_place(archive)
    state = state_path("console", "any", "").parent
    site = Site(place, place.folder or DEFAULT_FOLDER.resolve(), benches.resolve(), state)

    def ready(address: str) -> None:
        typer.echo(f"console at {address}  runs in {site.runs}; Ctrl-C ends it, runs go on")
        if open_page:
            typer.launch(address)

    serve(site, Where(host, port, cert, key, public.rstrip("/"), tuple(proxy)), ready)


@users.command()
def add(
    name: str = argument(..., "NAME", "Who it is."),
    role: str = option("operator", "--role", help="viewer looks, operator drives, engineer also sets limits."),
) -> None:
    """A new account, or another role and password for one; the password is asked for, and read from no argument."""
    from hil.bench.audit import Audit, acting_account
    from hil.console.access_accounts import Accounts

    accounts = Accounts()
    known = accounts.all().get(name)
    accounts.add(name, role, _password())
    details = {"name": name, "role": role, **({"role before": known.role} if known else {})}
    Audit().write(acting_account(), "change account" if known else "add account", details)
    typer.echo(f"{name}: {role}")


@users.command()
def remove(name: str = argument(..., "NAME", "Whose account goes.")) -> None:
    """Take an account away; who is logged in with it is out at once."""
    from hil.bench.audit import Audit, acting_account
    from hil.console.access_accounts import Accounts

    Accounts().remove(name)
    Audit().write(acting_account(), "remove account", {"name": name})


@users.command(name="list")
def list_() -> None:
    """Each account and its role."""
    from hil.console.access_accounts import Accounts

    for name, account in Accounts().all().items():
        typer.echo(f"{name}  {account.role}")


def _password() -> str:
    """Typed twice on the terminal, or a line of stdin where that is none."""
    if not sys.stdin.isatty():
        return sys.stdin.readline().rstrip("\r\n")
    return str(typer.prompt("password", hide_input=True, confirmation_prompt=True, err=True))
