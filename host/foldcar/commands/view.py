"""`foldcar view`: writes one page with a car's sheets and an animated folding model."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.components_option import Components
from foldcar.commands.design_settings import Settings
from foldcar.commands.json_option import Json, print_json
from foldcar.commands.output_option import check_distinct, output_file


def view(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing or design (JSON).")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", callback=output_file, help="The page to write (HTML).")
    ],
    vehicle: Annotated[
        str | None, typer.Option(metavar="ID", help="Vehicle of the listing, if it has several.")
    ] = None,
    settings: Settings = None,
    machine: Annotated[
        str, typer.Option(metavar="NAME", help="silhouette, cricut, laser or scissors: presets for the sheets.")
    ] = "silhouette",
    sheet: Annotated[str | None, typer.Option(metavar="SIZE", help="a4, letter, 12in or WIDTHxHEIGHT in mm.")] = None,
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Write a page on which a car folds in the browser.

    It shows the sheets, the folding and the assembled car, and needs no network.

    \b
    Example: foldcar view patterns/published_cars.json --vehicle w95 -o car.html
    """
    from foldcar.atomic_file import atomic_file
    from foldcar.car.folded_car import folded_car
    from foldcar.commands.listed_design import listed_family
    from foldcar.fabrication.assembly.view_page import Drawing, view_page
    from foldcar.fabrication.patterns.options import options
    from foldcar.fabrication.patterns.sheets import pattern
    from foldcar.fabrication.patterns.svg import svg

    check_distinct([listing], [output])
    design = listed_family(listing, vehicle, settings or [])[1].single()
    folded, title = folded_car(design), design.title
    sheets = [Drawing(svg(one), one.name) for one in pattern(folded, options(machine, sheet=sheet), title).sheets]
    page = view_page(folded, title, sheets)
    with atomic_file(output) as binary:
        binary.write(page.encode())
    if as_json:
        print_json({"files": [output]})
    else:
        typer.echo(str(output))
