"""`foldcar report`: writes a page with figures of a store's study, and prints a summary."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.json_option import Json, print_json
from foldcar.commands.output_option import output_folder


def report(
    store: Annotated[Path, typer.Argument(metavar="STORE", help="The store that a sweep wrote.")],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DIR", callback=output_folder, help="Folder for the page and its figures."
        ),
    ],
    as_json: Json = False,
) -> None:
    """Draw a study's report and print its summary.

    DIR/index.html is the page; each figure stands beside it as SVG, PNG and PDF.

    \b
    Example: foldcar report study.db -o report
    """
    from foldcar.report.summary_object import summary_object
    from foldcar.report.terminal import print_summary
    from foldcar.report.write import PAGE, write_report
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        sections = write_report(opened, output, ["foldcar", "report", str(store), "-o", str(output)])
    if as_json:
        print_json({"store": store, "page": output / PAGE, "experiments": [summary_object(one) for one in sections]})
        return
    print_summary(sections)
    typer.echo(f"report: {output / PAGE}")
