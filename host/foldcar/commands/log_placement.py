"""Instructions for placing car and obstacles for a trial: a table, a picture, and the question for deviations."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from foldcar.car.design import Design
from foldcar.commands.typed_answers import TypedAnswers
from foldcar.errors import FoldcarError
from foldcar.output_folder import make_output_folder
from foldcar.scenes.obstacles import Obstacle
from foldcar.shown_console import shown_console
from foldcar.simulation.carsim import Carsim
from foldcar.trials.placement import CAR, instructions, parse_deviation


@dataclass
class Placement:
    """A sample's scene for a design; its picture is drawn when first shown."""

    scene: dict[str, Any]
    things: dict[str, Obstacle]
    sample: int
    simulated: bool
    design: Design
    picture: Path
    carsim: Carsim
    _drawn: bool = field(default=False)

    def show(self, with_picture: bool) -> None:
        """Print the table and, ``with_picture``, draw the picture and print its path."""
        console = shown_console(120)
        table = Table(box=SIMPLE_HEAD if console.is_terminal else None, pad_edge=False)
        for head in ("place", "x (mm)", "y (mm)", "turned (°)", ""):
            table.add_column(head, justify="left" if head in ("place", "") else "right")
        for row in instructions(self.scene, self.things):
            table.add_row(*row)
        console.print(table)
        if with_picture:
            if not self._drawn:
                self._draw()
            typer.echo(f"picture: {self.picture}")

    def _draw(self) -> None:
        from foldcar.figures.placement import draw_placement
        from foldcar.simulation.heights import carsim_heights

        make_output_folder(self.picture.parent)
        length_m, width_m = self.design.length_mm / 1000, self.design.values["width"] / 1000
        title = f"Sample {self.sample}: where to put car and obstacles"
        if self.simulated:
            title = f"Sample {self.sample}: car and obstacles of the simulated trial"
        draw_placement(self.scene, self.things, length_m, width_m, carsim_heights(self.carsim), self.picture, title)
        self._drawn = True


def ask_deviations(
    answers: TypedAnswers, things: Mapping[str, Obstacle], given: list[str] | None, yes: bool
) -> dict[str, tuple[float, float, float]]:
    """Measured deviations (m, m, rad) by name: those of the options, else those typed; none with ``yes``."""
    names = [CAR, *things]
    if given is not None:
        parsed: dict[str, tuple[float, float, float]] = {}
        for text in given:
            name, by = parse_deviation(text, names)
            if name in parsed:
                raise FoldcarError(f'--deviation "{text}": {name} is given twice')
            parsed[name] = by
        return parsed
    found: dict[str, tuple[float, float, float]] = {}
    if yes:
        return found
    typer.echo("Measured deviations, one per line: NAME X_MM Y_MM [HEADING_DEG]; Enter to finish.")
    while typed := answers.line("deviation: "):
        try:
            name, by = parse_deviation(typed, names)
        except FoldcarError as error:
            typer.echo(f"  {error}")
            continue
        found[name] = by
    return found
