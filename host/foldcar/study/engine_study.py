"""A study simulated by another engine than multibody: its experiments have names of their own in stores."""

from dataclasses import replace

from foldcar.simulation.carsim import Carsim
from foldcar.store.info import engine_id
from foldcar.study.experiments import Study


def engine_study(study: Study, carsim: Carsim) -> Study:
    """The study with its experiments named for the simulator's engine."""
    named = (replace(one, id=engine_id(one.id, carsim.engine)) for one in study.experiments)
    return replace(study, experiments=tuple(named))
