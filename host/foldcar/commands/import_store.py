"""`foldcar import`: a store made again of the folder that `foldcar export --folder` wrote."""

from pathlib import Path
from typing import Annotated

import typer


def import_store(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="What `foldcar export STORE --folder DIR` wrote.")],
    store: Annotated[Path, typer.Option(metavar="FILE", help="The store to make; there must be none.")],
) -> None:
    """Make a store, and the logs of its trials beside it, from an exported folder; nothing is written after an error."""
    from foldcar.store.folder_import import import_folder

    manifest = import_folder(folder, store)
    logs = sum(digest is not None for digest in manifest["logs"].values())
    typer.echo(f"{store}: {manifest['rows']['run']} runs, {manifest['rows']['trial']} trials, {logs} logs")
