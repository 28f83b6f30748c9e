"""What the terminal says of failed runs: how many, what went wrong in the first ones, how to list them all."""

import shlex
from collections.abc import Sequence
from pathlib import Path

import typer

# Different messages that are shown.
SHOWN = 3


def say_failed(store: Path, experiments: Sequence[str], failed: int, total: int) -> None:
    """Print on stderr that ``failed`` of ``total`` runs of these experiments have failed."""
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        messages = opened.failures(experiments)
    typer.echo(f"{failed} of {total} runs failed and count as not passed:", err=True)
    for message, count in messages[:SHOWN]:
        typer.echo(f"  {count} x {message}", err=True)
    if len(messages) > SHOWN:
        typer.echo(f"  and {len(messages) - SHOWN} other messages", err=True)
    typer.echo(f"list them: {list_command(store)}", err=True)


def list_command(store: Path) -> str:
    """The command that lists the store's failed runs."""
    return shlex.join(["foldcar", "export", str(store), "--failed", "--csv", "-"])
