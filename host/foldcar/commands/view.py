"""`foldcar view`: one page with a car's flat pieces and a model of it that folds."""

from pathlib import Path
from typing import Annotated

import typer


def view(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing or design (JSON).")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="The page to write (HTML).")],
    vehicle: Annotated[
        str | None, typer.Option(metavar="ID", help="Vehicle of the listing, if it has several.")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=MM", help="Choose a design parameter, e.g. width=95 or W.length=60."),
    ] = None,
) -> None:
    """Write a page that shows a car flat, folding and assembled; it opens in a browser, without a network."""
    from foldcar.assembly.view_page import view_page
    from foldcar.atomic_file import atomic_file
    from foldcar.commands.listed_design import design_title, listed_design
    from foldcar.compiler.car import folded_car

    design = listed_design(listing, vehicle, settings or [])
    page = view_page(folded_car(design), design_title(design))
    with atomic_file(output) as binary:
        binary.write(page.encode())
    typer.echo(str(output))
