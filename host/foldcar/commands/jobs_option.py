"""`--jobs N`: simulators at a time, the same for every command that simulates many runs."""

from typing import Annotated

import typer

from foldcar.study.limits import MOST_JOBS

Jobs = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, max=MOST_JOBS, help="Simulators in parallel; default: one per processor."),
]
