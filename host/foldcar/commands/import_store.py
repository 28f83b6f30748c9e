"""`foldcar import`: a store made again of the folder that `foldcar export --folder` wrote."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.json_option import Json, print_json
from foldcar.commands.output_option import output_store


def import_store(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="What `foldcar export STORE --folder DIR` wrote.")],
    store: Annotated[
        Path, typer.Option(metavar="FILE", callback=output_store, help="The store to make; there must be none.")
    ],
    as_json: Json = False,
) -> None:
    """Make a store of an exported folder.

    The logs of its trials are copied beside it. After an error, nothing is written.

    \b
    Example: foldcar import study --store again.db
    """
    from foldcar.store.folder_import import import_folder

    manifest = import_folder(folder, store)
    logs = sum(digest is not None for digest in manifest["logs"].values())
    counts = {"runs": manifest["rows"]["run"], "trials": manifest["rows"]["trial"], "logs": logs}
    if as_json:
        print_json({"store": store, **counts})
    else:
        typer.echo(f"{store}: {', '.join(f'{count} {what}' for what, count in counts.items())}")
