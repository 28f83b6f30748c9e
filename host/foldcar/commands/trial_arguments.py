"""Arguments that commands on trials share."""

from pathlib import Path
from typing import Annotated

import typer

StoreFile = Annotated[Path, typer.Argument(metavar="STORE", help="The store that holds the trials.")]
Number = Annotated[int, typer.Argument(metavar="TRIAL", min=1, help="The trial's number, as `trials list` shows it.")]
