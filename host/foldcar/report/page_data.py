"""The data of the study page: one object of plain JSON values, from an open store. It is described only here.

``{"title", "notes", "engine_notes": [text], "experiments": [experiment]}``; an experiment is

- ``id``; ``headline`` (which car works), ``grounds`` (the evidence for it) and ``remarks`` (without what the trials have
  taught), all of `foldcar select`;
  ``thresholds`` (0 to 1, ascending: a design is good if it reaches the last), ``judged`` (whether success is defined),
  ``simulation`` (name of the engine in sentences), ``interval`` (name of the intervals of simulated rates),
  ``environments`` (their number), ``time_limit_s``.
- ``next``: what to do next, also of `foldcar select`: ``{"text", "steps": [{"text", "design": index, or null for a
  measurement, "gain": 0 to 1, "minutes"}]}``, the steps that were weighed, the best first.
  ``ranges``: sentences on gaps and ends of ranges; ``leader``: index of the design with the highest expected success of
  built cars, or null. ``recommended``: index of the design whose car to take; without a belief that with the highest
  share of passed runs, and null without any of both.
- ``realities``: null without a belief, or ``{"driven": whether a car was driven, "names": parameters of the simulator,
  "values": [a value of each for every reality], "rates": [success of each design in every reality, null outside the
  belief], "unknowns": [{"name", "unit", "meaning", "before", "after": [low, median, high], "measured": value or null,
  "taught": whether the trials say something}], "taught": sentences, "learned": {"runs", "error": 0 to 1 or null}}``. The
  realities are drawn by their weights.
- ``parameters``: those that vary, ``{"name", "label", "unit", "values": all that occur, ascending}``;
  ``fixed``: [label, text] of the others.
- ``designs``: columns with an entry per design, null for unknown values. ``value``: indices into the parameters' values;
  ``name``: the design's name for readers; ``swept``; ``runs`` and ``passed`` (rejected runs are in neither), ``rate``,
  ``low``, ``high`` (simulation, 95 %); ``outcomes``: a column per outcome; ``trials`` and ``trials_passed`` (those that
  count), ``cars`` (their number), ``trials_low``, ``trials_high`` (of these cars); ``belief``, ``belief_low``,
  ``belief_high``: success of a further built car, by simulation and trials; ``verdict``: "good", "bad" or "open" by the
  last threshold and the band of built cars, before trials and without a belief that of simulation; ``refuted``:
  "optimistic" or "pessimistic" if the design's trials contradict simulation; ``measures``: ``{"key", "label", "unit",
  "better": "less" | "more" | null, "value": column}``.
- ``exported``: of the tables that the page saves, ``{"vehicle", "environment"}``: as in the export's rows,
  ``"parameters"``: its columns of the design, in its order, ``"fixed": {column: value}`` of those that do not vary.
- ``engines``: for each other engine or reality that simulated the same cars in the same samples ``{"id": its
  experiment, "name", "passed", "runs": columns by design, "text": a sentence that compares them}``.
- ``runs``: columns ``design``, ``environment``, ``outcome``, ``time_s`` in the order of design and environment; null
  beyond MAX_RUNS, where ``runs_omitted`` says so.
- ``outcomes``, ``outcome_labels``: names and labels of the numbers in ``outcome``.
- ``drives``: null, or what the page needs to simulate runs, added by the caller: ``{"key": start of the blobs' names,
  "engine": carsim's option, "build": of the stored runs, "designs", "environments": which it can simulate,
  "path_interval_s", "sliders": [{"name", "unit", "meaning", "nominal", "low", "high"}]}``, see drives.py.
- ``trials``: ``{"number", "design": index or null, "car": the design's name, "car_name": that of the car itself or null,
  "standing": "built" | "simulated", "environment": index or null, "passed": null if aborted, "outcome", "time_s",
  "when", "note", "media": its photos and films, ``{"kind", "name", "address": relative, null for a missing file}``,
  added by the caller, "replay": null, or the drawing data of drives.py}``.
- ``effects``: for each parameter ``{"parameter": its index, "grid": values, "mean", "low", "high": success in
  simulation at each value, a mean over the same combinations of the other parameters, with the 95 % band of its
  difference from the mean over all values, "level": [low, high], the 95 % interval of that mean over all values,
  "curves": at most 20 single combinations, "over": a text on these combinations}``. Raw averages are not given, because
  they are of unequal combinations. ``importance``: ``{"parameter", "share", "low", "high"}``, the fraction of the
  variance of success over designs that would vanish if the parameter were fixed (the sum may exceed 1); empty with one
  parameter.
- ``causes``: ``{"name": the export's column, "label", "unit", "separation": 0 to 1, "low", "high",
  "rises": whether greater values pass, "bins": [{"from", "to", "runs", "passed"}]}``, the best first: how well the value
  separates passed from failed runs of the same design. It is informative if ``low`` is above 0. All intervals of an
  experiment hold together with 95 %.
- ``ends``: null, or where the runs that did not pass ended, by progress from the start towards the goal: ``{"from_m",
  "step_m", "bins", "goal_m": the goal's mean position, "obstacles": [{"name", "from_m", "to_m": its mean ends, "least_m",
  "most_m": ends of the range that contains it in nine of ten environments}], "design", "outcome", "bin", "obstacle",
  "count"}``. The last five are columns: the number of runs of a design with that outcome, bin and obstacle (-1: none).
- ``front``: null, or of a search ``{"objectives": [{"label", "unit", "better"}], "points": [{"design", "values", "low",
  "high", "fresh", "beaten"}]}``. Values with ``fresh`` are of environments that chose no design. Only such a point may be
  called best, if it is not ``beaten`` (by another of them, in all objectives). Values of the others are biased upwards.
- ``provenance``: [label, text]; ``files``: [label, relative address].
"""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import json5
import numpy
from threadpoolctl import threadpool_limits

from foldcar.evidence.adviser import Selection
from foldcar.evidence.design_evidence import design_label
from foldcar.evidence.evidence import Evidence, read_evidence, read_unswept
from foldcar.evidence.selecting import select_evidence
from foldcar.evidence.sentences import car_to_take
from foldcar.figures.style import OUTCOME_LABELS
from foldcar.report.environment_values import EnvironmentValues, environment_values
from foldcar.report.page_designs import DesignColumns, parameter_columns
from foldcar.report.page_effects import cause_rows, effect_rows, importance_rows, read_effects
from foldcar.report.page_front import search_front
from foldcar.report.page_measures import measures
from foldcar.report.page_ranges import range_sentences
from foldcar.report.page_realities import other_remarks, page_realities
from foldcar.report.page_remarks import remarks
from foldcar.report.page_run_ends import read_run_ends
from foldcar.report.page_simulations import other_simulations
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.statistics.effects import Effects
from foldcar.statistics.words import label_and_unit, value_text
from foldcar.store.info import ExperimentInfo, StudyInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial, select_trials
from foldcar.study.search.design_simulator import fresh_id

# Runs that the page holds one by one.
MAX_RUNS = 50_000
OMITTED = (
    "{:,} runs of {:,} designs are too many to list one by one: they are counted by design. "
    "`foldcar export` has them all."
)
# Of the publication's figure 6.
THRESHOLDS = (0.5, 0.75)


@dataclass(frozen=True)
class Experiment:
    """An experiment, prepared for page and figures; ``name`` identifies it on the page.

    ``trials`` are shown. ``effects`` is the smooth model of the parameters with indices ``parameter_indices``, None
    without one. ``fresh`` is the evidence on a search's best designs in fresh environments.
    """

    name: str
    evidence: Evidence
    selection: Selection
    trials: Sequence[Trial]
    thresholds: tuple[float, ...]
    effects: Effects | None
    parameter_indices: list[int]
    fresh: Evidence | None = None

    @property
    def info(self) -> ExperimentInfo:
        """The experiment in the store."""
        return self.evidence.info

    @cached_property
    def columns(self) -> DesignColumns:
        """The designs as columns."""
        return DesignColumns(self.evidence)

    @cached_property
    def recommended(self) -> int | None:
        """The index of the design whose car to take, as in :func:`works`, or else of that which passes most runs.

        None without a belief and without a run that counts.
        """
        belief, counts = self.evidence.belief, self.evidence.run_counts
        if belief is not None:
            owned = car_to_take(belief)
            row = belief.answers.best if owned is None else belief.answers.cars[owned].design
            return int(belief.design_indices[row])
        if not len(counts) or not counts[:, 1].any():
            return None
        return int((counts[:, 0] / numpy.maximum(counts[:, 1], 1)).argmax())


def read_experiments(store: Store, thresholds: Sequence[float] = (), simulated_trials: bool = False) -> list[Experiment]:
    """Read the experiments of a store in their order, then those with trials only.

    ``thresholds`` of success are 0 to 1; without any, each experiment has its listing's, or THRESHOLDS.
    With ``simulated_trials``, trials of simulated cars count as if built cars had driven them. Raises FoldcarError if the
    store cannot be read.
    """
    swept = read_evidence(store, simulated_trials=simulated_trials)
    # The advice is about the highest threshold.
    highest_threshold = max(thresholds, default=None)
    selections = select_evidence(swept, threshold=highest_threshold)
    by_id = {evidence.info.id: evidence for evidence in swept}
    unswept = read_unswept(store, simulated_trials)
    named = [*by_id.items(), *unswept.items()]
    selections += select_evidence(list(unswept.values()), threshold=highest_threshold)
    experiments = []
    for (name, evidence), selection in zip(named, selections, strict=True):
        info = evidence.info
        # Trials are not shown beside rates that are expected over realities.
        trials = [
            trial
            for trial in store.trials(info.listed_id)
            if not info.is_over_realities and (name in by_id or trial.vehicle_type == info.vehicle_type)
        ]
        shown, _ = select_trials(trials, simulated_trials)
        effects, indices = read_effects(evidence)
        fresh = by_id.get(fresh_id(name)) if info.searched else None
        good = tuple(sorted(set(thresholds))) or info.thresholds or THRESHOLDS
        experiments.append(Experiment(name, evidence, selection, shown, good, effects, indices, fresh))
    return experiments


def page_data(
    store: Store, command: Sequence[str] = (), experiments: Sequence[Experiment] | None = None
) -> dict[str, Any]:
    """Return the object that the file's head describes, without replays and files; ``command`` is that of the report.

    ``experiments`` are those of :func:`read_experiments`, read if None. Raises FoldcarError if the store cannot be read.
    """
    study = store.info() if store.holds_study() else None
    read = read_experiments(store) if experiments is None else experiments
    # For matrices of some tens of rows threads only wait for each other.
    with threadpool_limits(1):
        shown = [_experiment(store, study, experiment, read, command) for experiment in read]
    title, notes = _title(study)
    return {
        "title": title or (study.listing_name if study is not None else store.path.name),
        "notes": notes,
        "engine_notes": list(dict.fromkeys(experiment.info.warning for experiment in read if experiment.info.warning)),
        "experiments": shown,
    }


def _title(study: StudyInfo | None) -> tuple[str, str]:
    """Return title and notes of the listing, "" without them."""
    try:
        listing = json5.loads(study.listing_text) if study is not None else {}
        return str(listing.get("title", "")), str(listing.get("notes", ""))
    except (ValueError, AttributeError):
        # A search's text, or one of another version, need not be a listing.
        return "", ""


def _experiment(
    store: Store,
    study: StudyInfo | None,
    experiment: Experiment,
    experiments: Sequence[Experiment],
    command: Sequence[str],
) -> dict[str, Any]:
    info, evidence, effects = experiment.info, experiment.evidence, experiment.effects
    indices = experiment.parameter_indices
    threshold, listed = experiment.thresholds[-1], info.stored_runs <= MAX_RUNS
    values = environment_values(store, info) if evidence.swept else EnvironmentValues((), numpy.empty((0, 0)))
    columns, selection = experiment.columns, experiment.selection
    engines = other_simulations(evidence, [other.evidence for other in experiments])
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
        "designs": {**columns.page(threshold), "measures": costs},
        "exported": {
            "vehicle": info.vehicle,
            "environment": info.environment,
            "parameters": list(dict.fromkeys([*store.design_columns(), *info.fixed, *info.varied])),
            "fixed": dict(info.fixed),
        },
        "engines": engines,
        "effects": [] if effects is None else effect_rows(evidence, effects, indices),
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


def _next(names: Sequence[str], selection: Selection) -> dict[str, Any]:
    """Return the next step, and the steps that were weighed."""
    steps = [
        {
            "text": step.text,
            "design": names.index(step.label) if step.label in names else None,
            "gain": round(step.gain, 6),
            "minutes": step.minutes,
        }
        for step in selection.steps
    ]
    return {"text": selection.learn, "steps": steps}


def _leader(experiment: Experiment) -> int | None:
    """Return the index of the design with the highest expected rate; None without a belief."""
    belief = experiment.evidence.belief
    return None if belief is None else int(belief.design_indices[belief.answers.best])


def _provenance(study: StudyInfo | None, info: ExperimentInfo, command: Sequence[str]) -> list[list[str]]:
    """Return the facts from which the experiment follows, as label and text."""
    speed = "each car's full speed" if info.speed_m_s is None else f"{info.speed_m_s:g} m/s"
    program = info.scenic_program + (f" with {_assigned(info.scenic_params)}" if info.scenic_params else "")
    rows: list[tuple[str, str]] = [
        ("vehicle", ": ".join(filter(None, (info.vehicle, info.vehicle_type)))),
        ("environment", ": ".join(filter(None, (info.environment, program)))),
        ("frozen", _frozen(info)),
        ("built cars", f"seed {info.variation_seed}; spread: {_assigned(info.variation)}" if info.variation else ""),
        ("sampled environments", f"{info.environments:,}, seed {info.seed}" if info.environments else ""),
        ("time limit", f"{info.timeout_s:g} s" if info.environments else ""),
        ("set-point", f"{speed}, turn rate {info.yaw_rate_rad_s:g} rad/s" if info.environments else ""),
        ("rule", info.success_rule),
        ("runs", f"{info.stored_runs:,} stored of {info.planned_runs:,} planned" if info.environments else ""),
        ("simulated under", info.under or ""),
        ("engine", info.engine),
        ("carsim build", info.carsim_build),
    ]
    if study is not None:
        rows += [
            ("foldcar", study.foldcar_version),
            ("Scenic", study.scenic_version),
            ("swept (UTC)", study.created_utc),
            ("command of the sweep", study.command),
            ("command of the report", shlex.join(command)),
            (f"listing {study.listing_name}", study.listing_text),
        ]
    return [[label, text] for label, text in rows if text]


def _assigned(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {f'{value:g}' if isinstance(value, float) else value}" for name, value in values.items())


def _frozen(info: ExperimentInfo) -> str:
    if info.condition is None:
        return ""
    frozen = [*info.condition.get("objects", []), *info.condition.get("params", [])]
    return f"as in sample {info.condition['sample']}: {', '.join(frozen) or 'everything'}"


def _trial_rows(store: Store, experiment: Experiment) -> list[dict[str, Any]]:
    """Return a row for each trial, in their order; ``environment`` is None if the runs have other samples."""
    info, evidence = experiment.info, experiment.evidence
    ids_in_samples = store.trials_in_environment(info) if evidence.swept else set()
    return [
        {
            "number": trial.id,
            "design": evidence.index_of(trial),
            "car": design_label(info, trial.vehicle_type, trial.design),
            "car_name": trial.car_name,
            "standing": trial.standing,
            "environment": trial.sample if trial.id in ids_in_samples else None,
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


def _runs(evidence: Evidence) -> dict[str, list[Any]]:
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
