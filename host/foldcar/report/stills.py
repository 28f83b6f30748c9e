"""The picture of each experiment's recommended car, which stands on the page until the car drives there, and in print."""

from collections.abc import Iterable
from dataclasses import dataclass

from markupsafe import Markup

from foldcar.car.folded_car import folded_columns
from foldcar.fabrication.assembly.finished_car import finished_car
from foldcar.report.reported_experiment import ReportedExperiment


@dataclass(frozen=True)
class Still:
    """The recommended car of the experiment with the id ``experiment``: its design's name, and its picture as SVG."""

    experiment: str
    design: str
    svg: Markup


def stills(experiments: Iterable[ReportedExperiment]) -> list[Still]:
    """Return a picture of the recommended design of each experiment.

    An experiment without a recommended design has no picture. Nor has one whose design this version of foldcar cannot
    fold, because another version may have stored it.
    """
    result = []
    for experiment in experiments:
        if experiment.recommended is None:
            continue
        design = experiment.evidence.family[experiment.recommended]
        folded = folded_columns(design.vehicle_type, design.design)
        if folded is not None:
            picture = finished_car(folded, f"The folded car, {design.label}")
            result.append(Still(experiment.name, design.label, picture.svg))
    return result
