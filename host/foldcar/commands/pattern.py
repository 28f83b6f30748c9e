"""`foldcar pattern`: writes the sheets to cut a car, or a family of cars, from, and all files to build it."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.components_option import Components
from foldcar.commands.design_settings import Settings

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.fabrication.make_car import MadeCar
    from foldcar.fabrication.patterns.options import Options
    from foldcar.study.family import Family


def pattern(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing or design (JSON).")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the files.")],
    vehicle: Annotated[
        str | None, typer.Option(metavar="ID", help="Vehicle of the listing; optional if it has only one.")
    ] = None,
    settings: Settings = None,
    every: Annotated[bool, typer.Option("--all", help="Every car of a family, each in a folder of its own.")] = False,
    machine: Annotated[
        str, typer.Option(metavar="NAME", help="silhouette, cricut, laser or scissors: presets of the options below.")
    ] = "silhouette",
    sheet: Annotated[
        str | None, typer.Option(metavar="SIZE", help="a4, letter, 12in or WIDTHxHEIGHT in mm.")
    ] = None,
    paper: Annotated[str | None, typer.Option(metavar="SIZE", help="Of PDF pages: a4 or letter.")] = None,
    fold: Annotated[str | None, typer.Option(metavar="STYLE", help="Folds as cut dash or score.")] = None,
    kerf: Annotated[float | None, typer.Option(metavar="MM", help="Width that the cut removes.")] = None,
    tab_clearance: Annotated[float | None, typer.Option(metavar="MM", help="Distance by which tabs are smaller.")] = None,
    dash_cut: Annotated[float | None, typer.Option(metavar="MM", help="Length of a fold's cuts.")] = None,
    dash_bridge: Annotated[float | None, typer.Option(metavar="MM", help="Film between a fold's cuts.")] = None,
    bend_radius: Annotated[float | None, typer.Option(metavar="MM", help="Inner radius of folds.")] = None,
    k_factor: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Position of a fold's neutral layer, from the inner side, per thickness."),
    ] = None,
    thickness: Annotated[
        float | None, typer.Option(metavar="MM", help="Thickness of the film for folds; default: the design's.")
    ] = None,
    margin: Annotated[float | None, typer.Option(metavar="MM", help="Blank edge of a sheet.")] = None,
    gap: Annotated[float | None, typer.Option(metavar="MM", help="Film between two pieces.")] = None,
    components: Components = None,
) -> None:
    """Make sheets (SVG, DXF, PDF), FOLD, STL, OBJ, guide, wiring and parts list of a car, checked as written."""
    from foldcar.atomic_folder import atomic_folder
    from foldcar.commands.listed_design import listed_family
    from foldcar.fabrication.make_car import MANIFEST, make_car
    from foldcar.fabrication.patterns.options import options

    chosen = options(
        machine, sheet=sheet, paper=paper, fold=fold, kerf_mm=kerf, tab_clearance_mm=tab_clearance, dash_cut_mm=dash_cut,
        dash_bridge_mm=dash_bridge, bend_radius_mm=bend_radius, k_factor=k_factor, thickness_mm=thickness,
        margin_mm=margin, gap_mm=gap,
    )  # fmt: skip
    family = listed_family(listing, vehicle, settings or [])[1]
    designs = list(family) if every else [family.single()]
    with atomic_folder(output, MANIFEST) as folder:
        listed, said = [], []
        for design in _with_progress(designs):
            made = make_car(design, chosen)
            name = _folder_name(family, design) if every else ""
            for file, content in made.files.items():
                target = folder / name / file
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
                listed.append(f"{name}/{file}" if name else file)
            said.append(_family_line(name, made) if every else _report(made, chosen, output))
        if every:
            (folder / MANIFEST).write_text(json.dumps({"files": [*listed, MANIFEST]}, indent=2) + "\n", encoding="utf-8")
    # The folder has been written by now.
    skipped = [f"skipped, as it cannot be built: {one}" for one in family.skipped] if every else []
    typer.echo("\n".join([*said, *skipped, f"{len(designs)} cars in {output}"] if every else said))


def _with_progress(designs: "list[Design]") -> "Iterator[Design]":
    """The designs, with a progress bar on a terminal if there are several."""
    if len(designs) < 2:
        yield from designs
        return
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    yield from track(designs, "pattern", console=console, disable=not console.is_terminal, transient=True)


def _folder_name(family: "Family", design: "Design") -> str:
    """A name of the values of the varied parameters: ``width_95``, ``width_95-W_length_60``."""
    varied = [key for key, values in family.choices.items() if len(values) > 1]
    return "-".join(f"{key.replace('.', '_')}_{design.values[key]:g}" for key in varied) or "car"


def _family_line(name: str, made: "MadeCar") -> str:
    cut = made.pattern
    warned = f", {len(cut.warnings)} warnings" if cut.warnings else ""
    return (
        f"{name}: {len(cut.sheets)} sheets, cut {cut.cut_length_mm / 1000:.1f} m, {made.mass_kg * 1000:.0f} g, "
        f"{made.cost_usd:.0f} USD{warned}"
    )


def _report(made: "MadeCar", chosen: "Options", output: Path) -> str:
    cut = made.pattern
    width, height = chosen.sheet_size_mm
    used = cut.film_area_mm2 / (len(cut.sheets) * width * height)
    copies = sum(piece.count for piece in cut.pieces)
    lines = [
        made.title,
        f"  sheets    {len(cut.sheets)} of {width:g} x {height:g} mm, {used:.0%} of the film used",
        f"  pieces    {copies} of {len(cut.pieces)} kinds",
        f"  cut       {cut.cut_length_mm / 1000:.1f} m for {chosen.machine}, kerf {chosen.kerf_mm:g} mm",
        f"  mass      {made.mass_kg * 1000:.0f} g",
        f"  cost      about {made.cost_usd:.0f} USD",
        *(f"  checked   {text}" for text in made.checks),
        *(f"  warning   {text}" for text in cut.warnings),
        f"  made      {len(made.files)} files in {output}",
    ]
    return "\n".join(lines)
