"""The option that lets trials of simulated cars in, the same for every command that counts or compares trials."""

from typing import Annotated

import typer

SimulatedTrials = Annotated[
    bool, typer.Option("--simulated-trials", help="Also trials of simulated cars, marked as such and counted apart.")
]
