"""`--calibration NAME` and `--reality FILE`: a study simulated with other parameters of the simulator."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import Experiment, Study


def under_calibration(
    study: "Study", store: Path, name: str | None, reality: Path | None = None
) -> "tuple[Study, Callable[[Experiment], Environment]]":
    """The study and what makes its environments: changed ones if a calibration or a file is given. FoldcarError."""
    from foldcar.study.environments import Environment

    if name is None and reality is None:
        return study, Environment
    if name is not None and reality is not None:
        raise FoldcarError("--calibration and --reality: both say what to simulate with; give one of them")
    from foldcar.calibration.environment import as_calibration, calibrated_environment, calibrated_study, read_reality
    from foldcar.store.calibrations import calibration_named
    from foldcar.store.reader import Store

    if name is None:
        assert reality is not None
        calibration = as_calibration(reality, read_reality(reality))
    else:
        with Store.open(store) as opened:
            calibration = calibration_named(opened, name)
    return calibrated_study(study, calibration), partial(calibrated_environment, calibration=calibration)
