"""The picture of each experiment's recommended car, which stands on the page until the car drives there, and in print."""

from collections.abc import Iterable
from dataclasses import dataclass

from markupsafe import Markup

from foldcar.car.design import compose_columns
from foldcar.car.folded_car import folded_car
from foldcar.errors import FoldcarError
from foldcar.fabrication.assembly.finished_car import finished_car
from foldcar.report.page_data import Experiment


@dataclass(frozen=True)
class Still:
    """The recommended car of the experiment with the id ``experiment``: its design's name, and its picture as SVG."""

    experiment: str
    design: str
    svg: Markup


def stills(experiments: Iterable[Experiment]) -> list[Still]:
    """Return a picture for each experiment with a recommended design that this foldcar can fold."""
    result = []
    for experiment in experiments:
        if experiment.recommended is None:
            continue
        design = experiment.evidence.family[experiment.recommended]
        try:
            folded = folded_car(compose_columns(design.vehicle_type, design.design))
        except (FoldcarError, ValueError):
            # The component's file is not here, or is another one.
            continue
        result.append(Still(experiment.name, design.label, finished_car(folded, f"The folded car, {design.label}").svg))
    return result
