"""`foldcar sample`: samples scenes of an environment as JSON Lines for `carsim batch`, and draws them."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.atomic_file import atomic_file
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.scenes.source import SceneSource


def sample(
    scenario: Annotated[Path, typer.Argument(help="Scenic program", metavar="SCENARIO")],
    count: Annotated[int, typer.Option("-n", "--count", min=1, help="number of scenes")] = 1,
    seed: Annotated[int, typer.Option("--seed", help="the same seed gives the same scenes")] = 0,
    param: Annotated[
        list[str] | None,
        typer.Option("--param", help="a parameter of the program, NAME=VALUE; repeat for more"),
    ] = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="JSON Lines file; - writes to the terminal")
    ] = Path("-"),
    plot: Annotated[
        Path | None, typer.Option("--plot", help="picture of the first nine: .png, .svg or .pdf")
    ] = None,
) -> None:
    """Sample scenes from an environment: scene K of seed S has the id S/K, whatever the count."""
    from foldcar.figures.output import check_format
    from foldcar.scenes.source import open_environment

    if plot is not None:
        check_format(plot)
    source = open_environment(scenario, dict(_parse_param(text) for text in param or []), seed)
    for note in source.mutation_notes():
        typer.echo(f"note: {note}", err=True)
    shown: list[dict[str, Any]] = []
    if output == Path("-"):
        for scene in _scenes(source, count, shown):
            sys.stdout.write(_line(scene))
    else:
        with atomic_file(output) as file:
            for scene in _scenes(source, count, shown):
                file.write(_line(scene).encode())
    if plot is not None:
        from foldcar.figures.ground import carsim_heights
        from foldcar.figures.scenes import draw_scenes
        from foldcar.simulation.carsim import Carsim

        draw_scenes(shown, plot, carsim_heights(Carsim()), title=f"{scenario.name}, seed {seed}")


def _scenes(source: "SceneSource", count: int, shown: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield ``count`` scenes; append the first ones to ``shown``."""
    for k in range(count):
        scene = {"id": f"{source.seed}/{k}", **source.sample(k)}
        if len(shown) < 9:
            shown.append(scene)
        yield scene


def _line(scene: dict[str, Any]) -> str:
    return json.dumps({"scene": scene}) + "\n"


def _parse_param(text: str) -> tuple[str, Any]:
    """Parse NAME=VALUE; the value is JSON (0.03, true, [1, 2]), or else text. FoldcarError."""
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise FoldcarError(f"--param {text}: not NAME=VALUE")
    try:
        return name, json.loads(value)
    except json.JSONDecodeError:
        return name, value
