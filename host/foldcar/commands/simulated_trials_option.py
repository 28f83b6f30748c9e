"""The option that lets trials of simulated cars in: beside those of built cars, or instead of them."""

from typing import Annotated

import typer

SimulatedTrials = Annotated[
    bool, typer.Option("--simulated-trials", help="Also trials of simulated cars, marked as such and counted apart.")
]
SimulatedTrialsInstead = Annotated[
    bool, typer.Option("--simulated-trials", help="Go by the trials of simulated cars instead of built ones.")
]
