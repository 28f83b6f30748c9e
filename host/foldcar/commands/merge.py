"""`foldcar merge`: one store of the stores of studies that were run apart."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Json, check_distinct, output_store, print_json
from foldcar.errors import FoldcarError


def merge(
    stores: Annotated[list[Path], typer.Argument(metavar="STORE...", help="Two stores or more.")],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="FILE", callback=output_store, help="Store to make; there must be none."),
    ],
    as_json: Json = False,
) -> None:
    """Make one store of several.

    Runs, scenes, experiments, trials with their logs, calibrations; what two of them have is there once. Refused, with
    nothing written, if a run has two results or an experiment's name stands for two. The listing is the first store's.

    \b
    Example: foldcar merge monday.db tuesday.db -o study.db
    """
    from foldcar.store.merge import merge_stores

    if len(stores) < 2:
        raise FoldcarError("merge: name two stores or more")
    check_distinct(stores, [output])
    rows = merge_stores(stores, output)
    counts = {"runs": rows["run"], "experiments": rows["experiment"], "trials": rows["trial"]}
    if as_json:
        print_json({"store": output, **counts})
    else:
        typer.echo(f"{output}: {', '.join(f'{count} {what}' for what, count in counts.items())}")
