"""One run of a listing: a design of an experiment in a sample of its environment, as `run` and `link` take it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.design_settings import design_settings
from foldcar.study.limits import MOST_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import Experiment

Listing = Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing (JSON).")]
ExperimentId = Annotated[str, typer.Option(metavar="ID", help="Experiment of the listing.")]
Sample = Annotated[
    int,
    typer.Option(
        metavar="K", min=0, max=MOST_ENVIRONMENTS - 1, help="Number of the sampled environment and built car."
    ),
]


@dataclass(frozen=True)
class ListedRun:
    """``nominal`` is the body of the design, ``body`` that of the built car, which differs from it by ``variation``."""

    carsim: "Carsim"
    experiment: "Experiment"
    design: "Design"
    environment: "Environment"
    nominal: dict[str, Any]
    variation: dict[str, Any]
    body: dict[str, Any]
    scene: dict[str, Any]


def listed_run(listing: Path, experiment: str, settings: Sequence[str] | None, sample: int) -> ListedRun:
    """The run of those options; FoldcarError if they name no single design or the program is at fault."""
    from foldcar.car.body import body_json
    from foldcar.car.variation.vary_body import vary_body
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import read_study

    (chosen,) = read_study(listing, experiment).experiments
    design = chosen.family.narrowed(design_settings(settings or [])).single()
    carsim, environment, nominal = Carsim(), Environment(chosen), body_json(design)
    variation = environment.variation(sample)
    body = vary_body(nominal, variation, carsim.limits().numbers) if variation else nominal
    return ListedRun(carsim, chosen, design, environment, nominal, variation, body, environment.sample(sample))
