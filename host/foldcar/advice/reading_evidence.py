"""Reads the evidence of a store: each swept experiment's runs with the trials of its designs."""

from collections import Counter
from collections.abc import Container, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy
import pandas

from foldcar.advice.evidence import Design, DesignEvidence, Evidence, PairedTrial
from foldcar.advice.resimulation import Resimulation
from foldcar.advice.words import count, design_text, rejected_text
from foldcar.simulation.results import REJECTED
from foldcar.store.frames import runs_frame
from foldcar.store.info import REALITY_KIND, ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import SIMULATED, Trial, left_out_text, select_trials

# Designs that are named in one remark.
SHOWN = 5


def read_evidence(
    store: Store, experiment: str | None = None, runs: pandas.DataFrame | None = None, simulated_trials: bool = False
) -> list[Evidence]:
    """The evidence of every swept experiment, or of one; none if no sweep has begun.

    ``runs`` is the store's :func:`runs_frame` if the caller has it. ``simulated_trials``: trials of simulated cars
    instead of those of built ones; a remark says so. FoldcarError.
    """
    if not store.holds_study():
        return []
    infos = store.info().experiments
    names = store.experiment_ids(experiment)
    table = runs_frame(store, experiment) if runs is None else runs
    again = Resimulation(store)
    return [
        _evidence(store, infos[name], table[table["experiment"] == name], again, simulated_trials) for name in names
    ]


def unswept_trials(store: Store, experiment: str | None = None, simulated_trials: bool = False) -> list[Trial]:
    """The trials of built cars that count, or of simulated ones instead, in experiments that were not swept."""
    kept, _ = _kept(store, experiment, simulated_trials)
    swept = swept_ids(store)
    return [trial for trial in kept if trial.completed and trial.experiment not in swept]


def swept_ids(store: Store) -> set[str]:
    """The experiments that trials may be compared with, by their names in the listing and in the store."""
    infos = store.info().experiments if store.holds_study() else {}
    return {*infos, *(info.listed_id for info in infos.values())}


def _evidence(
    store: Store, info: ExperimentInfo, runs: pandas.DataFrame, again: Resimulation, simulated_trials: bool
) -> Evidence:
    trials, remarks = _trials(store, info, simulated_trials)
    designs = {_key(info.vehicle_type, one.design): one for one in _swept(store, info, runs)}
    by_design: dict[Any, list[Trial]] = {}
    for trial in trials:
        by_design.setdefault(_key(trial.vehicle_type, trial.design), []).append(trial)
    unswept = [key for key in by_design if key not in designs]
    # Those with most trials first: not all of many are simulated.
    made = {key: _unswept(info, by_design[key][0], again) for key in sorted(unswept, key=lambda k: -len(by_design[k]))}
    designs |= {key: made[key][0] for key in unswept}
    remarks += _unswept_remarks([made[key] for key in unswept])
    rejected = rejected_text(store.design_counts(info.id))
    if rejected is not None:
        remarks.insert(0, rejected)
    stored = info.stored_runs
    if stored < info.planned_runs:
        remarks.insert(0, f"Unfinished: {stored} of {info.planned_runs} runs are stored; the same sweep resumes.")
    if info.warning:
        remarks.insert(0, info.warning)
    here = store.trials_here(info)
    found = [_with_trials(info, one, by_design.get(key, []), here, again) for key, one in designs.items()]
    return Evidence(info, tuple(found), (*remarks, *_pair_remarks(found), *again.remarks(info.id)))


def _swept(store: Store, info: ExperimentInfo, runs: pandas.DataFrame) -> Iterator[DesignEvidence]:
    """The designs of the family with their runs."""
    designs = list(store.designs(info.id).values())
    names = list(designs[0]) if designs else []
    groups = runs.groupby([*info.varied], sort=False, dropna=False).indices if info.varied else {(): range(len(runs))}
    keyed = {key if isinstance(key, tuple) else (key,): rows for key, rows in groups.items()}
    samples, elapsed_s = runs["sample"].to_numpy(), runs["elapsed_time_s"].to_numpy()
    codes, outcomes = pandas.factorize(runs["outcome"])
    for design in designs:
        rows = numpy.asarray(keyed.get(tuple(design[name] for name in info.varied), []), dtype=int)
        counts = numpy.bincount(codes[rows], minlength=len(outcomes)).tolist()
        discarded = numpy.isin(codes[rows], numpy.flatnonzero(outcomes == REJECTED))
        rejected, rows = frozenset(samples[rows[discarded]].tolist()), rows[~discarded]
        times = elapsed_s[rows][~numpy.isnan(elapsed_s[rows])]
        yield DesignEvidence(
            info.vehicle_type,
            {name: design[name] for name in names},
            design_text({name: design[name] for name in info.varied}),
            True,
            samples[rows],
            numpy.isin(codes[rows], numpy.flatnonzero(outcomes == "passed")),
            Counter({outcome: number for outcome, number in zip(outcomes, counts, strict=True) if number}),
            float(times.mean()) if len(times) else None,
            stopped=info.until is not None,
            rejected=rejected,
        )


def _unswept(info: ExperimentInfo, trial: Trial, again: Resimulation) -> tuple[DesignEvidence, str | None]:
    """A design of trials that the sweep lacks, simulated now if that is possible; else why not."""
    differing = {name: value for name, value in trial.design.items() if info.fixed.get(name) != value}
    label = design_text({name: value for name, value in trial.design.items() if name in info.varied or name in differing})
    if trial.vehicle_type != info.vehicle_type:
        label = f"{trial.vehicle_type} of {label}"
    found, why_not = again.design(info, trial)
    outcomes = [outcome for outcome, _ in found]
    times = [time_s for _, time_s in found if time_s is not None]
    evidence = DesignEvidence(
        trial.vehicle_type,
        trial.design,
        label,
        False,
        numpy.arange(len(found)),
        numpy.array([outcome == "passed" for outcome in outcomes], dtype=bool),
        Counter(outcomes),
        float(numpy.mean(times)) if times else None,
    )
    return evidence, why_not


def _unswept_remarks(made: Sequence[tuple[DesignEvidence, str | None]]) -> Iterator[str]:
    """What is said of designs that the sweep lacks: of each, or of many with the same fate together."""
    fates: dict[str | None, list[DesignEvidence]] = {}
    for one, why_not in made:
        fates.setdefault(why_not, []).append(one)
    for why_not, some in fates.items():
        names = [f"{one.label} is" for one in some]
        if len(some) > SHOWN:
            more = count(len(some) - SHOWN, "further design")
            names = [f"{', '.join(one.label for one in some[:SHOWN])} and {more} are"]
        for name in names:
            was = "it was" if name.endswith(" is") else "they were"
            if why_not is None:
                yield f"{name} not in the sweep: {was} simulated now, in {some[0].runs} environments."
            else:
                yield f"{name} not in the sweep, and cannot be simulated now: {why_not}."


def _kept(store: Store, experiment: str | None, simulated_trials: bool) -> tuple[list[Trial], list[str]]:
    """The trials of built cars, or of simulated ones instead, aborted ones among them, and what is said of the others."""
    kept, left_out = select_trials(store.trials(experiment), simulated_trials)
    text = left_out_text(left_out)
    remarks = [] if text is None else [text]
    if not simulated_trials:
        return kept, remarks
    simulated = [trial for trial in kept if trial.standing == SIMULATED]
    built = f"; {count(len(kept) - len(simulated), 'trial')} of built cars left out" if len(simulated) < len(kept) else ""
    return simulated, [f"SIMULATED trials: of simulated cars, not of built ones{built}.", *remarks]


def _trials(store: Store, info: ExperimentInfo, simulated_trials: bool) -> tuple[list[Trial], list[str]]:
    """The trials to compare, aborted ones among them, and what is said of those left out or driven elsewhere."""
    kept, remarks = _kept(store, info.listed_id, simulated_trials)
    if info.under is not None and kept and info.under.startswith(REALITY_KIND):
        remarks.append(f"The runs are of {info.under}: parameters of a file, not what trials say.")
    elif info.under is not None and kept:
        remarks.append(
            f"The runs are of the {info.under}, which goes by trials of experiment {info.listed_id}: where they agree "
            "with those trials it is by fit, which later trials may test."
        )
    corrected = sum(trial.corrections > 0 for trial in kept)
    if corrected:
        remarks.append(f"{count(corrected, 'trial')} corrected afterwards: the latest correction counts.")
    elsewhere = store.trials_elsewhere(info)
    other = [trial for trial in kept if trial.id in elsewhere and elsewhere[trial.id] != info.scenic_program]
    moved = [trial for trial in kept if trial.id in elsewhere and elsewhere[trial.id] == info.scenic_program]
    for program, number in Counter(elsewhere[trial.id] or "an unknown program" for trial in other).items():
        remarks.append(f"{count(number, 'trial')} left out: driven in {program}, not in {info.scenic_program}.")
    if moved:
        remarks.append(
            f"{count(len(moved), 'trial')} were driven in other samples of {info.scenic_program} than the runs: "
            "its text, parameters or seed, or foldcar, have changed."
        )
    others = {trial.id for trial in other}
    return [trial for trial in kept if trial.id not in others], remarks


def _with_trials(
    info: ExperimentInfo,
    evidence: DesignEvidence,
    trials: Sequence[Trial],
    here: Container[int],
    again: Resimulation,
) -> DesignEvidence:
    stored = dict(zip(evidence.samples.tolist(), evidence.passed.tolist(), strict=True))
    found = []
    for trial in trials:
        if not trial.completed:
            continue
        planned = trial.id in here and not trial.deviations and trial.sample is not None
        if planned and (trial.sample in stored or trial.sample in evidence.rejected):
            simulation = stored.get(trial.sample)
            known = None if simulation is None else int(simulation)
            found.append(PairedTrial(trial.id, trial.outcome, trial.sample, known, False))
            continue
        outcome = again.trial(info, trial)
        simulated = None if outcome is None else int(outcome == "passed")
        sample = trial.sample if trial.id in here else None
        found.append(PairedTrial(trial.id, trial.outcome, sample, simulated, simulated is not None))
    aborted = sum(not trial.completed for trial in trials)
    return replace(evidence, trials=tuple(found), aborted=aborted) if trials else evidence


def _pair_remarks(designs: Sequence[DesignEvidence]) -> Iterator[str]:
    trials = [trial for one in designs for trial in one.trials]
    again = sum(trial.again for trial in trials)
    if again:
        what = "placed otherwise than planned, or has no stored run" if again == 1 else "placed otherwise, or have no run"
        yield f"{count(again, 'trial')} {what}: simulated again as placed."
    alone = sum(trial.simulated is None for trial in trials)
    if trials and alone:
        yield (
            f"{alone} of {len(trials)} trials cannot be paired with a run of the same environment, which is not known, "
            "not simulated or rejected: they count by their rate alone."
        )
    repeated = sum(
        number - 1
        for one in designs
        for number in Counter(trial.sample for trial in one.trials if trial.sample is not None).values()
    )
    if repeated:
        yield (
            f"{count(repeated, 'trial')} repeat an environment of the same design: intervals take all trials as "
            "independent, and are too narrow by that."
        )


def _key(vehicle_type: str, design: Design) -> Any:
    return vehicle_type, tuple(sorted(design.items()))
