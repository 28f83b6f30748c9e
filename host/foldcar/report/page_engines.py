"""Runs of the same listed experiment in other engines, beside an experiment's own: a rate a design, and a sentence."""

from collections.abc import Sequence
from typing import Any

from foldcar.report.page_designs import Designs
from foldcar.simulation.engines import MULTIBODY, engine_title
from foldcar.simulation.results import OUTCOMES
from foldcar.store.info import ExperimentInfo


def other_engines(designs: Designs, experiments: Sequence[Designs]) -> list[dict[str, Any]]:
    """For each engine that simulated the same cars in the same samples, what page_data.py describes as ``engines``.

    Without runs that both engines judged there is no entry.
    """
    mine = _passed(designs)
    found = []
    for other in experiments:
        if other.info.engine == designs.info.engine or _listed(other.info) != _listed(designs.info):
            continue
        places = {tuple(sorted(one.items())): at for at, one in enumerate(other.designs)}
        place = [places.get(tuple(sorted(one.items()))) for one in designs.designs]
        theirs = _passed(other)
        pairs = [
            (passed, theirs[at, sample])
            for (design, sample), passed in mine.items()
            if (at := place[design]) is not None and (at, sample) in theirs
        ]
        if not pairs:
            continue
        counts = [(0, 0) if at is None else tuple(other.counted[at].tolist()) for at in place]
        alike = 100 * sum(a == b for a, b in pairs) / len(pairs)
        text = (
            f"{_engine(other.info)}: {sum(b for _, b in pairs):,} of the same {len(pairs):,} runs passed, in "
            f"{_engine(designs.info)} {sum(a for a, _ in pairs):,}; {alike:.1f} % of the runs have the same result "
            "in both."
        )
        passed, runs = ([count[k] for count in counts] for k in (0, 1))
        found.append({"id": other.info.id, "name": _engine(other.info), "passed": passed, "runs": runs, "text": text})
    return found


def _engine(info: ExperimentInfo) -> str:
    return engine_title(info.engine) or MULTIBODY


def _listed(info: ExperimentInfo) -> tuple[Any, ...]:
    """What two experiments have in common whose samples are the same."""
    what = (info.listed_id, info.under, info.vehicle_type, info.fixed, info.scenic_program, info.scenic_params, info.seed)
    return *what, info.condition, info.variation, info.variation_seed, info.success_defined and info.success_rule


def _passed(designs: Designs) -> dict[tuple[int, int], bool]:
    """Whether each run that belongs in a rate passed, by its design and sample."""
    runs = designs.runs.counted
    passed = runs.outcome == OUTCOMES.index("passed")
    return dict(zip(zip(runs.design.tolist(), runs.sample.tolist(), strict=True), passed.tolist(), strict=True))
