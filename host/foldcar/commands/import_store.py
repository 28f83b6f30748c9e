"""`foldcar import`: a store made again of the folder that `foldcar export --folder` wrote, or kept work taken in."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Json, output_store, print_json


def import_store(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="What `foldcar export STORE --folder DIR` wrote, or a file of kept work."),
    ],
    store: Annotated[
        Path,
        typer.Option(
            metavar="FILE", callback=output_store, help="The store to make, which must not exist; of kept work its own."
        ),
    ],
    as_json: Json = False,
) -> None:
    """Make a store of an exported folder.

    The logs of its trials are copied beside it. After an error, nothing is written. Or take in what a command kept in a
    file, as it said, because its store could not be written.

    \b
    Example: foldcar import study --store again.db
    """
    from foldcar.store.folder import import_folder
    from foldcar.store.kept_work import take_in

    if folder.is_file():
        done = take_in(folder, store)
        if as_json:
            print_json({"store": store, "taken_in": done})
        else:
            typer.echo(f"{store}: {done}")
        return
    manifest = import_folder(folder, store)
    logs = sum(digest is not None for digest in manifest["logs"].values())
    counts = {"runs": manifest["rows"]["run"], "trials": manifest["rows"]["trial"], "logs": logs}
    if as_json:
        print_json({"store": store, **counts})
    else:
        typer.echo(f"{store}: {', '.join(f'{count} {what}' for what, count in counts.items())}")
