"""Makes the data of the report's page from an open store. page_types.py describes it."""

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

import json5
import numpy
from threadpoolctl import threadpool_limits

from foldcar.evidence.adviser import Selection
from foldcar.evidence.design_evidence import design_label
from foldcar.evidence.evidence import Evidence
from foldcar.figures.style import OUTCOME_LABELS
from foldcar.report.environment_values import EnvironmentValues, environment_values
from foldcar.report.page_designs import parameter_columns
from foldcar.report.page_effects import cause_rows, effect_rows, importance_rows
from foldcar.report.page_front import search_front
from foldcar.report.page_measures import measures
from foldcar.report.page_ranges import range_sentences
from foldcar.report.page_realities import other_remarks, page_realities
from foldcar.report.page_remarks import remarks
from foldcar.report.page_run_ends import read_run_ends
from foldcar.report.page_simulations import other_simulations
from foldcar.report.page_types import NextStep, NextSteps, PageData, PageExperiment, RunTable, TrialRow
from foldcar.report.reported_experiment import ReportedExperiment, read_experiments
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.statistics.words import label_and_unit, value_text
from foldcar.store.info import ExperimentInfo, StudyInfo
from foldcar.store.reader import Store

# Runs that the page holds one by one.
MAX_RUNS = 50_000
OMITTED = (
    "{:,} runs of {:,} designs are too many to list one by one: they are counted by design. "
    "`foldcar export` has them all."
)


def page_data(
    store: Store, command: Sequence[str] = (), experiments: Sequence[ReportedExperiment] | None = None
) -> PageData:
    """Return the data of the page, without replays and files.

    ``command`` is the command that writes the report; the page shows it. ``experiments`` are the result of
    :func:`read_experiments`, which is called if they are None. Raises FoldcarError if the store cannot be read.
    """
    study = store.info() if store.holds_study() else None
    if experiments is None:
        experiments = read_experiments(store)
    # The matrices of the statistics are so small that several threads would only wait for each other.
    with threadpool_limits(1):
        shown = [_experiment(store, study, experiment, experiments, command) for experiment in experiments]
    title, notes = _title(study)
    if not title:
        title = store.path.name if study is None else study.listing_name
    warnings = [experiment.info.warning for experiment in experiments if experiment.info.warning]
    return {
        "title": title,
        "notes": notes,
        "engine_notes": list(dict.fromkeys(warnings)),
        "experiments": shown,
    }


def _title(study: StudyInfo | None) -> tuple[str, str]:
    """Return title and notes of the listing, "" without them."""
    if study is None:
        return "", ""
    try:
        listing = json5.loads(study.listing_text)
        return str(listing.get("title", "")), str(listing.get("notes", ""))
    except (ValueError, AttributeError):
        # A search's text, or one of another version, need not be a listing.
        return "", ""


def _experiment(
    store: Store,
    study: StudyInfo | None,
    experiment: ReportedExperiment,
    experiments: Sequence[ReportedExperiment],
    command: Sequence[str],
) -> PageExperiment:
    """Return the page's data of an experiment; ``experiments`` are all of the report, to be compared with it."""
    info, evidence, effects = experiment.info, experiment.evidence, experiment.effects
    indices = experiment.parameter_indices
    threshold, listed = experiment.thresholds[-1], info.stored_runs <= MAX_RUNS
    values = environment_values(store, info) if evidence.swept else EnvironmentValues((), numpy.empty((0, 0)))
    columns, selection = experiment.columns, experiment.selection
    engines = other_simulations(store, evidence, [other.evidence for other in experiments])
    costs = measures(store, info, [design.design for design in evidence.family], evidence.runs)
    areas = next((cost["value"] for cost in costs if cost["key"] == "sheet_area"), [None] * len(columns.names))
    return {
        "id": experiment.name,
        "headline": selection.works,
        "grounds": selection.grounds,
        "next": _next(columns.names, selection),
        "leader": _leader(experiment),
        "recommended": experiment.recommended,
        "realities": page_realities(evidence),
        "ranges": range_sentences(evidence, effects, indices, threshold),
        "remarks": other_remarks(evidence.belief, [*(engine["text"] for engine in engines), *remarks(store, experiment)]),
        "thresholds": list(experiment.thresholds),
        "judged": info.success_defined,
        "simulation": info.simulation,
        "interval": columns.interval_name,
        "environments": info.environments,
        "time_limit_s": info.timeout_s,
        "parameters": parameter_columns(evidence),
        "fixed": [[label_and_unit(name)[0], value_text(name, value)] for name, value in info.fixed.items()],
        "designs": columns.page(threshold, costs),
        "exported": {
            "vehicle": info.vehicle,
            "environment": info.environment,
            "parameters": list(dict.fromkeys([*store.design_columns(), *info.fixed, *info.varied])),
            "fixed": dict(info.fixed),
        },
        "engines": engines,
        "effects": [] if effects is None else effect_rows(effects, indices),
        "importance": [] if effects is None else importance_rows(effects, indices),
        "causes": cause_rows(evidence, values),
        "ends": read_run_ends(store, info, evidence.runs.counted) if evidence.swept else None,
        "runs": _runs(evidence) if listed else None,
        "runs_omitted": "" if listed else OMITTED.format(info.stored_runs, evidence.swept),
        "outcomes": list(OUTCOMES),
        "outcome_labels": [OUTCOME_LABELS[name] for name in OUTCOMES],
        "drives": None,
        "trials": _trial_rows(store, experiment),
        "front": search_front(evidence, areas, experiment.fresh),
        "provenance": _provenance(study, info, command),
        "files": [],
    }


def _next(names: Sequence[str], selection: Selection) -> NextSteps:
    """Return what to do next, in a sentence, and the possible steps; ``names`` are the designs' names on the page."""
    steps: list[NextStep] = []
    for step in selection.steps:
        design = names.index(step.label) if step.label in names else None
        steps.append({"text": step.text, "design": design, "gain": round(step.gain, 6), "minutes": step.minutes})
    return {"text": selection.learn, "steps": steps}


def _leader(experiment: ReportedExperiment) -> int | None:
    """Return the index of the design with the highest expected rate; None without a belief."""
    belief = experiment.evidence.belief
    return None if belief is None else int(belief.design_indices[belief.answers.best])


def _provenance(study: StudyInfo | None, info: ExperimentInfo, command: Sequence[str]) -> list[list[str]]:
    """Return what somebody needs to know to simulate the experiment again: pairs of a label and a text.

    ``command`` is the command that writes the report. Texts that do not apply to the experiment are left out.
    """
    rows = _provenance_of_experiment(info)
    if study is not None:
        rows |= {
            "foldcar": study.foldcar_version,
            "Scenic": study.scenic_version,
            "swept (UTC)": study.created_utc,
            "command of the sweep": study.command,
            "command of the report": shlex.join(command),
            f"listing {study.listing_name}": study.listing_text,
        }
    return [[label, text] for label, text in rows.items() if text]


def _provenance_of_experiment(info: ExperimentInfo) -> dict[str, str]:
    """Return how the runs of an experiment were made, as texts by their label; a text is "" if it does not apply."""
    program = info.scenic_program
    if info.scenic_params:
        program += f" with {_assigned(info.scenic_params)}"
    # An experiment without environments has no runs, only trials.
    sampled = time_limit = set_point = runs = ""
    if info.environments:
        sampled = f"{info.environments:,}, seed {info.seed}"
        time_limit = f"{info.timeout_s:g} s"
        speed = "each car's full speed" if info.speed_m_s is None else f"{info.speed_m_s:g} m/s"
        set_point = f"{speed}, turn rate {info.yaw_rate_rad_s:g} rad/s"
        runs = f"{info.stored_runs:,} stored of {info.planned_runs:,} planned"
    built_cars = ""
    if info.variation:
        built_cars = f"seed {info.variation_seed}; spread: {_assigned(info.variation)}"
    return {
        "vehicle": ": ".join(filter(None, (info.vehicle, info.vehicle_type))),
        "environment": ": ".join(filter(None, (info.environment, program))),
        "frozen": _frozen(info),
        "built cars": built_cars,
        "sampled environments": sampled,
        "time limit": time_limit,
        "set-point": set_point,
        "rule": info.success_rule,
        "runs": runs,
        "simulated under": info.under or "",
        "engine": info.engine,
        "carsim build": info.carsim_build,
    }


def _assigned(values: Mapping[str, Any]) -> str:
    """Return names with their values, such as ``friction 0.6, step_height 0.03``."""
    texts = []
    for name, value in values.items():
        value_shown = f"{value:g}" if isinstance(value, float) else value
        texts.append(f"{name} {value_shown}")
    return ", ".join(texts)


def _frozen(info: ExperimentInfo) -> str:
    """Return which objects and parameters keep the values of a sample; "" if all are sampled."""
    if info.condition is None:
        return ""
    frozen_names = [*info.condition.get("objects", []), *info.condition.get("params", [])]
    names = ", ".join(frozen_names) or "everything"
    return f"as in sample {info.condition['sample']}: {names}"


def _trial_rows(store: Store, experiment: ReportedExperiment) -> list[TrialRow]:
    """Return a row for each trial of an experiment, in their order.

    ``environment`` is the number of the sampled environment in which the trial was driven, so that the page can show it
    beside the runs in the same environment. It is None if there are no such runs, or if it is unknown.
    """
    info, evidence = experiment.info, experiment.evidence
    trials_beside_runs = store.trials_in_environment(info) if evidence.swept else set()
    return [
        {
            "number": trial.id,
            "design": evidence.index_of(trial),
            "car": design_label(info, trial.vehicle_type, trial.design),
            "car_name": trial.car_name,
            "standing": trial.standing,
            "environment": trial.sample if trial.id in trials_beside_runs else None,
            "passed": trial.outcome == "passed" if trial.completed else None,
            "outcome": trial.outcome.replace("_", " "),
            "time_s": trial.elapsed_time_s,
            "when": trial.started_utc,
            "note": trial.note or trial.source or "",
            "media": [],
            "replay": None,
        }
        for trial in experiment.trials
    ]


def _runs(evidence: Evidence) -> RunTable:
    """Return the runs in the order of design and environment, with their outcomes and times (s)."""
    runs = evidence.runs
    times_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")].round(3).tolist()
    return {
        "design": runs.design.tolist(),
        "environment": runs.sample.tolist(),
        "outcome": runs.outcome.tolist(),
        # The time of a failed run is NaN, which JSON does not have; only NaN differs from itself.
        "time_s": [None if time_s != time_s else time_s for time_s in times_s],
    }
