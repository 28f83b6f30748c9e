"""`foldcar sample`: samples scenes of an environment as JSON Lines for `carsim batch`, and draws them."""

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.atomic_file import atomic_file
from foldcar.commands.options import STANDARD_OUTPUT, Json, check_distinct, output_file, print_json
from foldcar.errors import FoldcarError
from foldcar.study.limits import GREATEST_SEED, MOST_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.scenes.source import SceneSource


def sample(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="Scenic program.")],
    count: Annotated[
        int, typer.Option("-n", "--count", metavar="N", min=1, max=MOST_ENVIRONMENTS, help="Number of scenes.")
    ] = 1,
    seed: Annotated[
        int, typer.Option(metavar="S", min=0, max=GREATEST_SEED, help="The same seed gives the same scenes.")
    ] = 0,
    param: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="A parameter of the program (SI units); may be repeated."),
    ] = None,
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="FILE", callback=output_file, help="JSON Lines file; -: standard output."
        ),
    ] = STANDARD_OUTPUT,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", callback=output_file, help="Picture of the first nine (.png, .svg, .pdf)."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Sample scenes of an environment.

    Scene K of seed S has the id S/K, whatever the count. The lines are input of `carsim batch` (docs/carsim.md);
    with --json and without a file they are in the object, under "scenes".

    \b
    Example: foldcar sample scenarios/step_pyramids.scenic -n 9 --seed 42 --plot scenes.png
    """
    from foldcar.figures.output import check_format
    from foldcar.scenes.source import open_environment

    check_distinct([scenario], [output, plot])
    if plot is not None:
        check_format(plot)
    source = open_environment(scenario, _parse_params(param or []), seed)
    for note in source.mutation_notes():
        typer.echo(f"note: {note}", err=True)
    shown: list[dict[str, Any]] = []
    result: dict[str, Any] = {"scenario": scenario, "seed": seed, "count": count}
    if output == STANDARD_OUTPUT and as_json:
        result["scenes"] = list(_scenes(source, count, shown))
    elif output == STANDARD_OUTPUT:
        for scene in _scenes(source, count, shown):
            sys.stdout.write(_line(scene))
    else:
        with atomic_file(output) as file:
            for scene in _scenes(source, count, shown):
                file.write(_line(scene).encode())
        result["file"] = output
    if plot is not None:
        from foldcar.figures.scenes import draw_scenes
        from foldcar.simulation.carsim import Carsim
        from foldcar.simulation.heights import carsim_heights

        draw_scenes(shown, plot, carsim_heights(Carsim()), title=f"{scenario.name}, seed {seed}")
        result["picture"] = plot
    if as_json:
        print_json(result)


def _scenes(source: "SceneSource", count: int, shown: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield ``count`` scenes; append the first ones to ``shown``."""
    for k in range(count):
        scene = {"id": f"{source.seed}/{k}", **source.sample(k)}
        if len(shown) < 9:
            shown.append(scene)
        yield scene


def _line(scene: dict[str, Any]) -> str:
    return json.dumps({"scene": scene}) + "\n"


def _parse_params(words: Sequence[str]) -> dict[str, Any]:
    """Parse NAME=VALUE words; FoldcarError if one is invalid or a name stands twice."""
    params: dict[str, Any] = {}
    for word in words:
        name, value = _parse_param(word)
        if name in params:
            raise FoldcarError(f"--param {word}: {name} is given twice")
        params[name] = value
    return params


def _parse_param(text: str) -> tuple[str, Any]:
    """Parse NAME=VALUE; the value is JSON (0.03, true, [1, 2]), or else text. FoldcarError."""
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise FoldcarError(f"--param {text}: not NAME=VALUE")
    from foldcar.study.limits import check_numbers

    try:
        parsed = json.loads(value)
        check_numbers(parsed, name)
    except json.JSONDecodeError:
        return name, value
    except (ValueError, RecursionError) as error:
        raise FoldcarError(f"--param {error}") from None
    return name, parsed
