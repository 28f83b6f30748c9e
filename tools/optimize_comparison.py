"""Compares samplers of `foldcar optimize` with grid search on equal numbers of runs, and prints docs/optimize.md's table.

The family is swept once; every search then finds its runs in the store. What a search recommends after some number of
runs is judged in fresh environments. Example: `.venv/bin/python tools/optimize_comparison.py`.
`--risk 1000` measures instead how often a design is left early that would have ended as good as the best.
"""

import argparse
import itertools
import math
import os
import random
import statistics
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy
from scipy.stats import norm

from foldcar.simulation.carsim import Carsim
from foldcar.statistics.stopping import evidence_of_worse
from foldcar.store.frames import runs_frame
from foldcar.store.reader import Store
from foldcar.store.writer import write_store
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import Experiment, ListedStudy, read_study
from foldcar.study.plan import study_facts
from foldcar.study.search.design_simulator import RunRow, Values, open_simulator
from foldcar.study.search.objectives import OBJECTIVES
from foldcar.study.search.proposals import PRUNING_RISK, Proposals
from foldcar.study.search.search import Plan, batches, searched_study
from foldcar.study.sweep import Sweep

LISTING = Path(__file__).resolve().parents[1] / "examples" / "design_space.json"
# Designs that a search without pruning tries, each in all environments.
BUDGETS = (10, 20, 40, 80)
SUCCESS = OBJECTIVES["success"]
TIMEOUT_S = 60.0
# Sampler and whether designs are left early.
SEARCHES = {
    "TPE, leaving designs early": ("tpe", True),
    "TPE": ("tpe", False),
    "random": ("random", False),
    "grid": ("grid", False),
}


def swept(study: ListedStudy, store: Path, carsim: Carsim, jobs: int) -> dict[Values, list[RunRow]]:
    """The rows of every design, by its values."""
    (experiment,) = study.experiments
    Sweep(study, store, carsim, "tools/optimize_comparison.py", realities=0).run(jobs, announce=print)
    with Store.open(store) as opened:
        runs = runs_frame(opened, experiment.id)
    rows: dict[Values, list[RunRow]] = {}
    columns = [*experiment.family.columns(), "outcome", "elapsed_time_s", "consumed_energy_j"]
    # In the order of samples.
    for *values, outcome, time_s, energy_j in runs[columns].itertuples(index=False):
        rows.setdefault(tuple(values), []).append(RunRow(outcome, time_s, energy_j))
    return rows


def picks(
    experiment: Experiment, rows: dict[Values, list[RunRow]], sampler: str, prune: bool, seed: int
) -> Iterator[Values | None]:
    """What a search recommends after each of the budgets; None if it has tried no design in all environments."""
    if sampler == "tpe":
        yield from searched(experiment, rows, prune, seed)
        return
    levels = [sorted(values) for values in experiment.family.choices.values()]
    shuffled = random.Random(seed).sample(sorted(rows), len(rows))
    for budget in BUDGETS:
        # A grid is laid out for its number of designs; some of its points cannot be built.
        points = [tuple(values[i] for values, i in zip(levels, point, strict=True)) for point in grid(levels, budget)]
        designs = [values for values in points if values in rows] if sampler == "grid" else shuffled[:budget]
        yield max(designs, key=lambda values: passes(rows[values]), default=None)


def searched(experiment: Experiment, rows: dict[Values, list[RunRow]], prune: bool, seed: int) -> Iterator[Values | None]:
    """What `foldcar optimize` recommends after each of the budgets."""
    proposals = Proposals(experiment.family, [SUCCESS], seed)
    for budget in BUDGETS:
        while sum(proposal.environments for proposal in proposals.tried) < budget * experiment.environments:
            values = proposals.next()
            if values is None:
                break
            one_design(proposals, rows[values], prune)
        best = proposals.best(1)
        yield best[0].values if best else None


def grid(values: Sequence[Sequence[float]], points: int) -> list[tuple[int, ...]]:
    """Return at most ``points`` grid points, as indices of the ``values`` of each parameter.

    The coarsest parameter is divided further as long as that fits.
    """
    levels = [len(values_of_parameter) for values_of_parameter in values]
    counts = [1] * len(levels)

    def fits(axis: int) -> bool:
        new_count = counts[axis] + 1
        return new_count <= levels[axis] and math.prod(counts) // counts[axis] * new_count <= points

    while axes := [axis for axis in range(len(levels)) if fits(axis)]:
        counts[min(axes, key=lambda axis: counts[axis] / levels[axis])] += 1
    # Use the middles of equal parts.
    indices = [
        [(2 * i + 1) * level // (2 * count) for i in range(count)] for level, count in zip(levels, counts, strict=True)
    ]
    return list(itertools.product(*indices))


def one_design(proposals: Proposals, rows: list[RunRow], prune: bool) -> None:
    """Try the proposed design as `foldcar optimize` does."""
    assert SUCCESS.value is not None and OBJECTIVES["time"].value is not None
    seen: list[RunRow] = []
    pruned = False
    for batch in batches(len(rows)):
        seen += [rows[k] for k in batch]
        if prune and len(seen) < len(rows) and proposals.is_worse(seen, TIMEOUT_S):
            pruned = True
            break
    proposals.tell([SUCCESS.value(seen, 0.0)], seen, pruned, OBJECTIVES["time"].value(seen, TIMEOUT_S))


def judge(
    study: ListedStudy, fresh: Experiment, designs: set[Values], store: Path, carsim: Carsim, jobs: int
) -> dict[Values, float]:
    """The success of each design in the fresh environments."""
    assert SUCCESS.value is not None
    with write_store(store) as writer:
        writer.begin_study(study_facts(study, carsim, "tools/optimize_comparison.py"), carsim.build)
        with open_simulator(
            fresh, ExperimentEnvironment(fresh), writer, carsim, jobs, lambda runs: None, []
        ) as simulator:
            return {
                design: SUCCESS.value(simulator.rows(design, range(fresh.environments)), 0.0)
                for design in sorted(designs)
            }


def print_risk(pairs: int) -> None:
    """Print how often a design is left early, of ``pairs`` of designs whose results in an environment correlate.

    The best so far is the luckiest of some that pass equally often.
    """
    print("|environments|rate|best of, their rate|left early, %|of those that would end as good, %|better, %|runs|")
    print("|---|---|---|---|---|---|---|")
    for number, rate, others, best_rate in itertools.product((30, 100), (0.5, 0.8), (1, 5), (0.5, 0.8)):
        if best_rate < rate:
            continue
        generator = numpy.random.default_rng([number, others])
        left, gain, runs = (numpy.zeros(pairs) for _ in range(3))
        for pair in range(pairs):
            hard = generator.standard_normal(number)
            strengths = norm.ppf([best_rate] * others + [rate])[:, None] + generator.standard_normal((others + 1, number))
            *other_runs, own_runs = [
                [RunRow("passed" if good else "tipped", 1.0, 1.0) for good in row] for row in strengths > hard
            ]
            best = max(other_runs, key=passes)
            gain[pair], runs[pair] = passes(own_runs) - passes(best), number
            for batch in batches(number)[:-1]:
                if evidence_of_worse(*of_first(own_runs, batch.stop, best)) >= 1 / PRUNING_RISK:
                    left[pair], runs[pair] = 1, batch.stop
                    break
        shares = [100 * left[mask].mean() if mask.any() else math.nan for mask in (gain >= 0, gain > 0)]
        cells = [f"{100 * left.mean():.0f}", *(f"{share:.1f}" for share in shares), f"{runs.mean():.0f}"]
        print("|" + "|".join([f"{number}", f"{rate:g}", f"{others}, {best_rate:g}", *cells]) + "|", flush=True)


def passes(rows: list[RunRow]) -> int:
    """How many runs passed."""
    return sum(bool(row.passed) for row in rows)


def of_first(rows: list[RunRow], seen: int, best: list[RunRow]) -> tuple[list[float], int, float]:
    """What evidence_of_worse takes after so many runs."""
    losses = SUCCESS.compare(rows[:seen], best, TIMEOUT_S)
    return losses.differences, len(best), losses.max_gain


def main() -> None:
    """Sweep, search, judge, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--listing", type=Path, default=LISTING)
    parser.add_argument("--store", type=Path, default=Path("out/space.db"))
    parser.add_argument("--risk", type=int, metavar="PAIRS", help="measure the risk of leaving early instead")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--fresh", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    options = parser.parse_args()
    if options.risk:
        print_risk(options.risk)
        return
    study, carsim = read_study(options.listing), Carsim()
    (experiment,) = study.experiments
    fresh = searched_study(study, Plan((SUCCESS,), BUDGETS[-1], fresh=options.fresh)).experiments[1]
    rows = swept(study, options.store, carsim, options.jobs)

    facts: dict[str, list[list[Values | None]]] = {}
    for name, (sampler, prune) in SEARCHES.items():
        seeds = 1 if sampler == "grid" else options.seeds
        facts[name] = [list(picks(experiment, rows, sampler, prune, seed)) for seed in range(seeds)]
    by_sweep = sorted(rows, key=lambda values: -SUCCESS.value(rows[values], 0.0) if SUCCESS.value else 0.0)[:5]
    picked = {values for runs in facts.values() for row in runs for values in row if values is not None}
    rate = judge(study, fresh, picked | set(by_sweep), options.store, carsim, options.jobs)

    print(f"\n{len(rows)} designs; best of the sweep in fresh environments: {max(rate[k] for k in by_sweep):.2f}")
    counts = [f"{budget * experiment.environments} runs" for budget in BUDGETS]
    print(f"|search|{'|'.join(counts)}|\n|---|{'---|' * len(counts)}")
    for name, runs in facts.items():
        cells = []
        for index in range(len(BUDGETS)):
            reached = sorted(rate[row[index]] if row[index] is not None else 0.0 for row in runs)  # type: ignore[index]
            low, high = reached[len(reached) // 10], reached[-1 - len(reached) // 10]
            spread = f" ({100 * low:.0f} to {100 * high:.0f})" if len(reached) > 1 else ""
            cells.append(f"{100 * statistics.mean(reached):.0f}{spread}")
        print(f"|{name}|{'|'.join(cells)}|")


if __name__ == "__main__":
    main()
