"""The runs of a study as both engines need them: a car, a scene, settings.

Input: a study. Output: cases, sample by sample, all designs in one before the next, as in a sweep.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from foldcar.car.body import body_json
from foldcar.car.variation.vary_body import vary_body
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.study.environments import Environment
from foldcar.study.experiments import Study


@dataclass(frozen=True)
class Case:
    """One design of an experiment in one sample of its environment; ``columns`` has its parameters.

    ``beside`` is None unless the environment's program has to run beside the simulation; then ``identity``
    tells its scenes from others that look the same.
    """

    experiment: str
    design: int
    sample: int
    columns: Mapping[str, float]
    body: Mapping[str, Any]
    scene: Mapping[str, Any]
    settings: Mapping[str, Any]
    beside: Environment | None = None
    identity: str = ""

    @property
    def label(self) -> str:
        """The case as messages name it."""
        return f"experiment {self.experiment}, design {self.design + 1}, sample {self.sample}"


def cases_of(study: Study, carsim: Carsim) -> Iterator[Case]:
    """All cases of all experiments. FoldcarError if a program or a design is at fault."""
    table, limits = carsim.parameter_table(), carsim.limits().numbers
    for experiment in study.experiments:
        environment = Environment(experiment)
        beside = environment if environment.dynamic else None
        if not environment.success.defined:
            rule = environment.success.text
            raise FoldcarError(f"{experiment.place}: engines are compared by success, and {rule}")
        designs = []
        for design in experiment.family:
            body = body_json(design)
            designs.append((design.columns, body, experiment.settings(design, body, table)))
        for sample in range(experiment.environments):
            scene, variation = environment.sample(sample), environment.variation(sample)
            identity = environment.scene_identity(sample, environment.dynamic)
            for index, (columns, body, settings) in enumerate(designs):
                car = vary_body(body, variation, limits) if variation else body
                yield Case(experiment.id, index, sample, columns, car, scene, settings, beside, identity)
