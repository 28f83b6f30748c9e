"""What the study page shows: one object of plain JSON values, from an open store. This text is its one description.

``{"title", "notes", "engine_notes": [text], "experiments": [experiment]}``; an experiment is

- ``id``, ``headline`` (what is known), ``grounds`` (what that rests on), ``remarks`` (what a reader must know besides),
  ``thresholds`` (0 to 1, ascending: a design is good if it reaches the last), ``judged`` (whether success is defined),
  ``simulation`` (what sentences call its engine), ``interval`` (what the intervals of simulated rates are called),
  ``environments`` (how many there are), ``time_limit_s``.
- ``next``: what to do next, ``{"text", "designs": [index], "why": [text for each]}``. This, headline and grounds are
  those of `foldcar select`. ``ranges``: sentences on gaps and ends of ranges; ``leader``: index of a design, or null.
- ``parameters``: those that vary, ``{"name", "label", "unit", "values": all that occur, ascending}``;
  ``fixed``: [label, text] of the others.
- ``designs``: columns, an entry per design, null for what is not known. ``value``: per design the indices into the
  parameters' values; ``name``: the one way in which a design is written;
  ``swept``; ``runs`` and ``passed`` (rejected runs are in neither), ``rate``, ``low``, ``high`` (simulation, 95 %);
  ``outcomes``: a column per outcome; ``trials``, ``trials_passed`` (those that count), ``cars`` (how many drove them),
  ``trials_low``, ``trials_high`` (of these cars); ``smooth``, ``smooth_low``, ``smooth_high``: success in this simulator,
  smoothed over designs; ``belief``, ``belief_low``, ``belief_high``: what simulation and trials together say of a further
  built car; ``verdict``: "good", "bad" or "open" by the last threshold and the band of built cars, before trials that of
  simulation; ``refuted``: "optimistic" or "pessimistic" where the design's own trials
  contradict simulation; ``measures``:
  ``{"key", "label", "unit", "better": "less" | "more" | null, "value": column}``.
- ``engines``: for each other engine or calibration that simulated the same cars in the same samples ``{"id": its
  experiment, "name", "passed", "runs": columns by design, "text": a sentence that compares them, "corrected": null,
  or columns ``rate``, ``low``, ``high``: rates in a slower engine, estimated from all runs and its few}``.
- ``runs``: columns ``design``, ``environment``, ``outcome``, ``time_s`` in the order of design and environment; null
  beyond MAX_RUNS, where ``runs_omitted`` says so.
- ``outcomes``, ``outcome_labels``: what the numbers of ``outcome`` stand for.
- ``replays``: ``{"design", "environment", "outcome", "blob"}``, the caller's.
- ``trials``: ``{"number", "design": index or null, "car": the design's name, "car_name": that of the car itself or null,
  "standing": "built" | "simulated", "environment": index or null, "passed": null if aborted, "outcome", "time_s",
  "when", "note", "replay": null, or by replay.py what is drawn of it}``.
- ``effects``: for each parameter ``{"parameter": its place, "grid": values, "mean", "low", "high": success in
  simulation, a mean over the same combinations of the other parameters for each value, with the 95 % band of its
  difference to the mean over all values, "level": [low, high], the 95 % interval of that mean over all values, "curves":
  at most 20 single combinations, "over": which combinations these are, in words}``. Raw averages are of unequal
  combinations and stand nowhere. ``importance``: ``{"parameter", "share", "low", "high"}``, the share of the variance of
  success over designs that would go if it were fixed (shares may add up to more than 1); empty with one parameter.
- ``causes``: ``{"name": the export's column, "label", "unit", "separation": 0 to 1, "low", "high",
  "rises": whether greater values pass, "bins": [{"from", "to", "runs", "passed"}]}``, the best first: how well the value
  separates passed from failed runs of the same design. It tells something where ``low`` is above 0; all intervals of an
  experiment hold together with 95 %.
- ``ends``: null, or where the runs that did not pass ended, by progress from the start towards the goal: ``{"from_m",
  "step_m", "bins", "goal_m": the goal's mean place, "obstacles": [{"name", "from_m", "to_m": its mean ends, "least_m",
  "most_m": between which it lies in nine of ten environments}], "design", "outcome", "bin", "obstacle", "count"}``. The
  last five are columns: how many runs of a design ended so, in that bin, at that obstacle (-1: at none).
- ``front``: null, or of a search ``{"objectives": [{"label", "unit", "better"}], "points": [{"design", "values", "low",
  "high", "fresh", "beaten"}]}``. Values of designs with ``fresh`` are of environments by which nothing was chosen; only
  of these one that is not ``beaten`` (by another of them, in all objectives) may be called best. The others are too good.
- ``provenance``: [label, text]; ``files``: [label, relative address].
"""

import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import json5
import numpy
from threadpoolctl import threadpool_limits

from foldcar.figures.style import OUTCOME_LABELS
from foldcar.inference.design_evidence import design_label
from foldcar.inference.evidence import Evidence, read_evidence, read_unswept
from foldcar.inference.selecting import Selection, measure_first, select_evidence
from foldcar.report.environment_values import EnvironmentValues, environment_values
from foldcar.report.page_designs import DesignColumns, parameter_columns
from foldcar.report.page_effects import cause_rows, effect_rows, importance_rows, read_effects
from foldcar.report.page_front import search_front
from foldcar.report.page_measures import measures
from foldcar.report.page_ranges import range_sentences
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
    """An experiment as page and figures take it; ``name`` is its own on the page.

    ``trials`` are those that are shown, ``left_out`` counts the others by standing; ``elsewhere``: those that were driven
    in other environments than the runs, with their Scenic programs. ``effects`` is the smooth model of
    the parameters at ``places``, None if there is none. ``fresh`` is the evidence on a search's best designs in fresh
    environments.
    """

    name: str
    evidence: Evidence
    selection: Selection
    trials: Sequence[Trial]
    left_out: Counter[str]
    elsewhere: Mapping[int, str | None]
    thresholds: tuple[float, ...]
    effects: Effects | None
    places: list[int]
    fresh: Evidence | None = None

    @property
    def info(self) -> ExperimentInfo:
        """The experiment in the store."""
        return self.evidence.info

    @cached_property
    def columns(self) -> DesignColumns:
        """The designs as columns."""
        return DesignColumns(self.evidence, [trial for trial in self.trials if trial.id not in self.elsewhere])


def read_experiments(store: Store, thresholds: Sequence[float] = (), simulated_trials: bool = False) -> list[Experiment]:
    """Read the experiments of a store in their order, then those with trials only. Raises FoldcarError.

    ``thresholds`` of success, 0 to 1; without any, each experiment has its listing's, or THRESHOLDS.
    ``simulated_trials``: show trials of simulated cars too; they count in no rate.
    """
    swept = read_evidence(store)
    limit = max(thresholds, default=None)
    selections = select_evidence(swept, threshold=limit, with_cost=False)
    by_id = {evidence.info.id: evidence for evidence in swept}
    unswept = read_unswept(store)
    named = [*by_id.items(), *unswept.items()]
    selections += select_evidence(list(unswept.values()), threshold=limit, with_cost=False)
    experiments = []
    for (name, evidence), selection in zip(named, selections, strict=True):
        info = evidence.info
        trials = [
            trial for trial in store.trials(info.listed_id) if name in by_id or trial.vehicle_type == info.vehicle_type
        ]
        shown, left_out = select_trials(trials, simulated_trials)
        effects, places = read_effects(evidence)
        fresh = by_id.get(fresh_id(name)) if info.searched else None
        good = tuple(sorted(set(thresholds))) or info.thresholds or THRESHOLDS
        advice = replace(selection, remarks=(*measure_first(store, selection), *selection.remarks))
        elsewhere = store.trials_elsewhere(info) if evidence.swept else {}
        experiments.append(Experiment(name, evidence, advice, shown, left_out, elsewhere, good, effects, places, fresh))
    return experiments


def page_data(
    store: Store, command: Sequence[str] = (), experiments: Sequence[Experiment] | None = None
) -> dict[str, Any]:
    """Return the object described above, without replays and files; ``command`` is that of the report.

    ``experiments`` are those of the store if the caller has them. Raises FoldcarError.
    """
    study = store.info() if store.holds_study() else None
    some = read_experiments(store) if experiments is None else experiments
    # Threads for matrices of some tens of rows only wait for each other.
    with threadpool_limits(1):
        shown = [_experiment(store, study, experiment, some, command) for experiment in some]
    title, notes = _title(study)
    return {
        "title": title or (study.listing_name if study is not None else store.path.name),
        "notes": notes,
        "engine_notes": list(dict.fromkeys(experiment.info.warning for experiment in some if experiment.info.warning)),
        "experiments": shown,
    }


def _title(study: StudyInfo | None) -> tuple[str, str]:
    """Title and notes of the listing; empty without."""
    try:
        listing = json5.loads(study.listing_text) if study is not None else {}
        return str(listing.get("title", "")), str(listing.get("notes", ""))
    except (ValueError, AttributeError):
        # A search's text, or one of another version, need not be a listing.
        return "", ""


def _experiment(
    store: Store, study: StudyInfo | None, one: Experiment, experiments: Sequence[Experiment], command: Sequence[str]
) -> dict[str, Any]:
    info, evidence, effects, places = one.info, one.evidence, one.effects, one.places
    threshold, few = one.thresholds[-1], info.stored_runs <= MAX_RUNS
    values = environment_values(store, info) if evidence.swept else EnvironmentValues((), numpy.empty((0, 0)))
    columns, selection = one.columns, one.selection
    engines = other_simulations(evidence, [other.evidence for other in experiments])
    costs = measures(store, info, [design.design for design in evidence.family], evidence.runs)
    areas = next((cost["value"] for cost in costs if cost["key"] == "sheet_area"), [None] * len(columns.names))
    return {
        "id": one.name,
        "headline": selection.headline,
        "grounds": selection.grounds,
        "next": _next(columns.names, selection),
        "leader": _leader(columns.names, one),
        "ranges": range_sentences(evidence, effects, places, threshold),
        "remarks": [*(engine["text"] for engine in engines), *remarks(store, one)],
        "thresholds": list(one.thresholds),
        "judged": info.success_defined,
        "simulation": info.simulation,
        "interval": columns.interval_name,
        "environments": info.environments,
        "time_limit_s": info.timeout_s,
        "parameters": parameter_columns(evidence),
        "fixed": [[label_and_unit(name)[0], value_text(name, value)] for name, value in info.fixed.items()],
        "designs": {**columns.page(threshold), "measures": costs},
        "engines": engines,
        "effects": [] if effects is None else effect_rows(evidence, effects, places),
        "importance": [] if effects is None else importance_rows(effects, places),
        "causes": cause_rows(evidence, values),
        "ends": read_run_ends(store, info, evidence.runs.counted) if evidence.swept else None,
        "runs": _runs(evidence) if few else None,
        "runs_omitted": "" if few else OMITTED.format(info.stored_runs, evidence.swept),
        "outcomes": list(OUTCOMES),
        "outcome_labels": [OUTCOME_LABELS[name] for name in OUTCOMES],
        "replays": [],
        "trials": _trial_rows(store, one),
        "front": search_front(evidence, areas, one.fresh),
        "provenance": _provenance(study, info, command),
        "files": [],
    }


def _next(names: Sequence[str], selection: Selection) -> dict[str, Any]:
    """What to do next, with the indices of the recommended designs."""
    known = {name: index for index, name in enumerate(names)}
    shown = [recommendation for recommendation in selection.recommendations if recommendation.label in known]
    designs, reasons = [known[design.label] for design in shown], [design.reason for design in shown]
    return {"text": selection.next_step, "designs": designs, "why": reasons}


def _leader(names: Sequence[str], one: Experiment) -> int | None:
    """The design of the best chance."""
    belief = (one.fresh or one.evidence).belief
    if belief is None:
        return None
    label = belief.labels[int(belief.chances(one.thresholds[-1]).argmax())]
    return names.index(label) if label in names else None


def _provenance(study: StudyInfo | None, info: ExperimentInfo, command: Sequence[str]) -> list[list[str]]:
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
    what = [*info.condition.get("objects", []), *info.condition.get("params", [])]
    return f"as in sample {info.condition['sample']}: {', '.join(what) or 'everything'}"


def _trial_rows(store: Store, one: Experiment) -> list[dict[str, Any]]:
    """A row for each trial, in their order; ``environment`` only where the runs have the same samples."""
    info, evidence = one.info, one.evidence
    here = store.trials_here(info) if evidence.swept else set()
    return [
        {
            "number": trial.id,
            "design": evidence.index_of(trial),
            "car": design_label(info, trial.vehicle_type, trial.design),
            "car_name": trial.car_name,
            "standing": trial.standing,
            "environment": trial.sample if trial.id in here else None,
            "passed": trial.outcome == "passed" if trial.completed else None,
            "outcome": trial.outcome.replace("_", " "),
            "time_s": trial.elapsed_time_s,
            "when": trial.started_utc,
            "note": trial.note or trial.source or "",
            "replay": None,
        }
        for trial in one.trials
    ]


def _runs(evidence: Evidence) -> dict[str, list[Any]]:
    """The runs in the order of design and environment, with their outcomes and times (s)."""
    runs = evidence.runs
    times_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")].round(3).tolist()
    return {
        "design": runs.design.tolist(),
        "environment": runs.sample.tolist(),
        "outcome": runs.outcome.tolist(),
        "time_s": [None if time_s != time_s else time_s for time_s in times_s],
    }
