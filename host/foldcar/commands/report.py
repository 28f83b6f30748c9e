"""`foldcar report`: writes a page with figures of a store's study, and prints a summary."""

from pathlib import Path
from typing import Annotated

import typer


def report(
    store: Annotated[Path, typer.Argument(help="results store", metavar="STORE")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="folder for the page and its figures", metavar="DIR")
    ],
) -> None:
    """Draw the report of a study: DIR/index.html, and each figure as SVG, PNG and PDF."""
    from foldcar.report.terminal import print_summary
    from foldcar.report.write import PAGE, write_report
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        sections = write_report(opened, output, ["foldcar", "report", str(store), "-o", str(output)])
    print_summary(sections)
    typer.echo(f"report: {output / PAGE}")
