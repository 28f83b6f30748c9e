"""`--calibration NAME`: a study simulated under a calibration of its store."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import Experiment, Study


def under_calibration(
    study: "Study", store: Path, name: str | None
) -> "tuple[Study, Callable[[Experiment], Environment]]":
    """The study and what makes its environments: calibrated ones if ``name`` is given. FoldcarError."""
    from foldcar.study.environments import Environment

    if name is None:
        return study, Environment
    from foldcar.calibration.environment import calibrated_environment, calibrated_study
    from foldcar.store.calibrations import calibration_named
    from foldcar.store.reader import Store

    with Store.open(store) as opened:
        calibration = calibration_named(opened, name)
    return calibrated_study(study, calibration), partial(calibrated_environment, calibration=calibration)
