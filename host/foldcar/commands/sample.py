"""`foldcar sample` samples scenes of an environment as JSON Lines for `carsim batch`, and draws them."""

import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.options import (
    STANDARD_OUTPUT,
    Json,
    Picture,
    Seed,
    check_distinct,
    output_file,
    print_note,
    print_result,
)
from foldcar.errors import FoldcarError
from foldcar.outputs import atomic_file
from foldcar.study.limits import MAX_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.scenes.source import SceneSource

# The number of scenes in the picture: three rows of three.
MAX_SHOWN_SCENES = 9


def sample(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO", help="Scenic program.")],
    count: Annotated[
        int, typer.Option("-n", "--count", metavar="N", min=1, max=MAX_ENVIRONMENTS, help="Number of scenes.")
    ] = 1,
    seed: Seed = 0,
    param: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="Parameter of the Scenic program, in SI units; may be repeated."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", callback=output_file, help="JSON Lines file; -: standard output."),
    ] = None,
    plot: Picture = None,
    as_json: Json = False,
) -> None:
    """Sample scenes of an environment.

    Each line is a scene for `carsim batch` (docs/carsim.md). Scene K of seed S has the id S/K and does not depend on the
    count. With --json but without -o, the printed object contains the scenes. With --plot but without -o, the command
    prints a summary and not the scenes. The picture shows the first nine scenes from above, and the ground under the
    wheels from the side.

    \b
    Example: foldcar sample scenarios/step_pyramids.scenic -n 9 --seed 42 --plot scenes.png
    """
    from foldcar.scenes.scene_notes import EARLY_DRAW
    from foldcar.scenes.source import open_environment

    check_distinct([scenario], [output, plot])
    source = open_environment(scenario, _parse_params(param or []), seed)
    # This also checks that the program draws the same sample if it is compiled once more.
    source.fixed_files()
    shown: list[dict[str, Any]] = []
    # The samples to which each remark applies, by the remark.
    notes: dict[str, list[int]] = {}
    result: dict[str, Any] = {"scenario": scenario, "seed": seed, "count": count}
    lines: list[str] = []
    if as_json and output in (None, STANDARD_OUTPUT):
        result["scenes"] = list(_scenes(source, count, shown, notes))
    elif output is None and plot is not None:
        noun = "scenes" if count > 1 else "scene"
        lines.append(f"{scenario.name}, seed {seed}: {count} {noun}, drawn in {plot}")
        lines += _summary(_scenes(source, count, shown, notes))
    elif output is None or output == STANDARD_OUTPUT:
        for scene in _scenes(source, count, shown, notes):
            sys.stdout.write(_line(scene))
    else:
        with atomic_file(output) as file:
            for scene in _scenes(source, count, shown, notes):
                file.write(_line(scene).encode())
        result["file"] = output
    if plot is not None:
        from foldcar.figures.scenes import draw_environment
        from foldcar.simulation.carsim import Carsim
        from foldcar.simulation.heights import carsim_heights

        draw_environment(shown, plot, carsim_heights(Carsim()), f"{scenario.name}, seed {seed}")
        result["picture"] = plot
    from foldcar.statistics.words import count as count_text

    print_result(as_json, result, *lines)
    if source.has_drawn_early:
        print_note(EARLY_DRAW)
    for text, samples in notes.items():
        print_note(f"{count_text(len(samples), 'sample')} (first {samples[0]}): {text}")


def _summary(scenes: Iterator[dict[str, Any]]) -> Iterator[str]:
    """Yield lines with the ranges of the scenes' friction and of their number of terrain parts, by kind."""
    frictions = []
    # For each kind, how many parts each scene so far has.
    counts_of_kind: dict[str, list[int]] = {}
    for index, scene in enumerate(scenes):
        frictions.append(scene["friction"])
        kinds = Counter(part["kind"] for part in scene["terrain"])
        # A kind that did not occur in earlier scenes had 0 parts there.
        for kind in counts_of_kind.keys() | kinds.keys():
            counts_of_kind.setdefault(kind, [0] * index).append(kinds[kind])
    yield f"  friction {_range(frictions)}"
    for kind, counts in sorted(counts_of_kind.items()):
        yield f"  {kind.replace('_', ' ')}: {_range(counts)} in each scene"


def _range(values: Sequence[float]) -> str:
    """Return the range of values as text, ``0.4 to 0.6``, or the value if there is only one."""
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"


def _scenes(
    source: "SceneSource", count: int, shown: list[dict[str, Any]], notes: dict[str, list[int]]
) -> Iterator[dict[str, Any]]:
    """Yield ``count`` scenes with ids SEED/K.

    The first nine, which the picture shows, are appended to ``shown``; remarks are added to ``notes`` with their samples.
    """
    from foldcar.scenes.scene_notes import scene_notes

    for k in range(count):
        scene = {"id": f"{source.seed}/{k}", **source.sample(k)}
        if len(shown) < MAX_SHOWN_SCENES:
            shown.append(scene)
        for text in scene_notes(scene):
            notes.setdefault(text, []).append(k)
        yield scene


def _line(scene: dict[str, Any]) -> str:
    """Return the line of JSON that `carsim batch` reads for a scene."""
    return json.dumps({"scene": scene}) + "\n"


def _parse_params(words: Sequence[str]) -> dict[str, Any]:
    """Parse NAME=VALUE words; a value that is not JSON (0.03, true, [1, 2]) is a string. Raises FoldcarError."""
    from foldcar.study.limits import check_numbers

    params: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise FoldcarError(f"--param {word}: not NAME=VALUE")
        if name in params:
            raise FoldcarError(f"--param {word}: {name} is given twice")
        try:
            params[name] = json.loads(value)
            check_numbers(params[name], name)
        except json.JSONDecodeError:
            params[name] = value
        except (ValueError, RecursionError) as error:
            raise FoldcarError(f"--param {error}") from None
    return params
