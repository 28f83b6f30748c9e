"""One run of a listing: a design of an experiment in a sample of its environment, as `run` and `link` take it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
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

    def with_design(self, design: "Design") -> "ListedRun":
        """The run of another design in the same environment, built with the same differences."""
        from foldcar.car.body import body_json
        from foldcar.car.variation import vary_body

        nominal = body_json(design)
        body = vary_body(nominal, self.variation, self.carsim.limits().numbers) if self.variation else nominal
        return replace(self, design=design, nominal=nominal, body=body)


def listed_run(
    listing: Path, experiment: str, settings: Sequence[str] | None, sample: int, engine: str = "multibody"
) -> ListedRun:
    """The run of those options; FoldcarError if they name no single design or the program is at fault."""
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import read_study

    (chosen,) = read_study(listing, experiment).experiments
    design = chosen.family.narrowed(design_settings(settings or [])).single()
    environment = Environment(chosen)
    variation, scene = environment.variation(sample), environment.sample(sample)
    return ListedRun(Carsim(engine=engine), chosen, design, environment, {}, variation, {}, scene).with_design(design)
