"""The environment of an experiment in random realities: each sample has a reality and a car of its own.

All designs share the reality of a sample, so that their rates are compared in pairs. The fraction of a design's runs that
pass estimates its expected success over realities without bias: what a built car is expected to do before any trial. The
environment has fingerprints of its own, so that stores keep its runs apart from the nominal ones.
"""

from collections.abc import Mapping
from dataclasses import replace

from foldcar.belief.priors import built_priors, values_of
from foldcar.store.info import RANDOM_REALITIES, VARIANT
from foldcar.study.experiments import Experiment, ListedStudy
from foldcar.study.reality_draws import draw_sample_scores
from foldcar.study.reality_environment import ChangedEnvironment, hashed
from foldcar.study.reality_runs import realities_fingerprint


class RandomRealities(ChangedEnvironment):
    """Built from an experiment of :func:`study_over_realities`.

    Raises FoldcarError if its program needs Scenic in runs.
    """

    def __init__(self, experiment: Experiment) -> None:
        # How the message ends if the program runs during the simulation, which is an error here.
        end_of_message = "realities cannot change; search for the nominal rate with --objective success"
        super().__init__(experiment, end_of_message)
        # The priors of a car that will be built from foldcar's sheets. `select` assumes the same before any trial.
        self._priors = built_priors(experiment.family.vehicle_type, from_sheets=True)
        priors = {str(index): (prior.mean, prior.sd) for index, prior in self._priors.items()}
        self.spread_fingerprint = hashed(RANDOM_REALITIES, realities_fingerprint(experiment), priors)
        self.fingerprint = hashed(self.fingerprint, self.spread_fingerprint)

    @property
    def reality(self) -> dict[str, str]:
        """That the realities are random, their fingerprint, and the listed experiment, as in ExperimentInfo."""
        listed_id = self._experiment.id
        # The names in listings are never those of variants.
        while VARIANT.search(listed_id):
            listed_id = VARIANT.sub("", listed_id)
        return {"name": RANDOM_REALITIES, "fingerprint": self.spread_fingerprint, "experiment": listed_id}

    def values(self, k: int) -> Mapping[str, float]:
        """Return the simulator's parameters by name in the reality of sample ``k``."""
        scores = draw_sample_scores(self._seed, k, self._priors)
        return values_of(scores[None])[0]


def study_over_realities(study: ListedStudy) -> ListedStudy:
    """Return the study with the names of its experiments in random realities: "width (realities)"."""
    renamed = (replace(experiment, id=f"{experiment.id} (realities)") for experiment in study.experiments)
    return replace(study, experiments=tuple(renamed))
