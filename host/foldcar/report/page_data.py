"""What the study page shows: one object of plain JSON values, from an open store. This text is its one description.

``{"title", "engine_notes": [text], "experiments": [experiment]}``; an experiment is

- ``id``, ``headline`` (a sentence), ``remarks`` (what a reader must know besides), ``thresholds`` (0 to 1, ascending: a
  design is good above the last), ``judged`` (whether success is defined), ``simulation`` (what sentences call its
  engine), ``interval`` (what the intervals of simulated rates are called), ``environments`` (how many there are),
  ``time_limit_s``.
- ``likely`` (the designs most likely to work) and ``learn`` (those whose trials would tell most; a gap to sweep):
  ``{"text", "designs": [index], "why": [text for each]}``; ``edge``: sentences on ends of ranges.
- ``parameters``: those that vary, ``{"name", "label", "unit", "values": all that occur, ascending}``;
  ``fixed``: [label, text] of the others.
- ``designs``: columns, an entry per design, null for what is not known. ``value``: per design the indices into the
  parameters' values (null where the design lacks the parameter); ``name``: the one way in which a design is written;
  ``swept``; ``runs`` and ``passed`` (rejected runs are in neither), ``rate``, ``low``, ``high`` (simulation, 95 %);
  ``outcomes``: a column per outcome; ``trials``, ``trials_passed`` (those that count), ``cars`` (how many drove them),
  ``trials_low``, ``trials_high`` (of these cars); ``belief``, ``belief_low``, ``belief_high``: what simulation and trials
  together say of a further car, simulation's rate where no trial tells of it; ``verdict``: "good", "bad" or "open" by the
  belief's interval and the last threshold; ``refuted``: "optimistic" or "pessimistic" where the design's own trials
  contradict simulation; ``measures``:
  ``{"key", "label", "unit", "better": "less" | "more" | null, "value": column}``.
- ``engines``: for each other engine that simulated the same cars in the same samples ``{"id": its experiment, "name",
  "passed", "runs": columns by design, "text": a sentence that compares the results}``.
- ``runs``: columns ``design``, ``environment``, ``outcome``, ``time_s`` in the order of design and environment; null
  beyond MOST_RUNS, where ``runs_omitted`` says so.
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
from dataclasses import dataclass
from typing import Any

import numpy
from threadpoolctl import threadpool_limits

from foldcar.analysis.effects import Effects
from foldcar.analysis.words import label_and_unit, value_text
from foldcar.figures.style import OUTCOME_LABELS
from foldcar.report.environment_values import EnvironmentValues, environment_values
from foldcar.report.page_advice import Advice
from foldcar.report.page_designs import Designs, parameter_columns, read_designs
from foldcar.report.page_effects import cause_rows, effect_rows, importance_rows, read_effects
from foldcar.report.page_front import search_front
from foldcar.report.page_remarks import other_engines, remarks
from foldcar.report.page_run_ends import read_run_ends
from foldcar.search.design_simulator import fresh_id
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.store.info import ExperimentInfo, StudyInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial, select_trials

# Runs that the page holds one by one.
MOST_RUNS = 50_000
OMITTED = (
    "{:,} runs of {:,} designs are too many to list one by one: they are counted by design. "
    "`foldcar export` has them all."
)
# Of the publication's figure 6.
THRESHOLDS = (0.5, 0.75)
# What is not known of an experiment that was not swept.
UNKNOWN: dict[str, Any] = {
    **dict.fromkeys(("speed_m_s", "seed", "condition", "variation_seed")),
    **dict.fromkeys(("environments", "timeout_s", "yaw_rate_rad_s", "planned_runs", "stored_runs"), 0),
    **dict.fromkeys(("vehicle", "environment", "carsim_build"), ""),
}


@dataclass(frozen=True)
class Experiment:
    """An experiment as page and figures take it; ``name`` is its own on the page, ``fresh`` that of a search's best.

    ``trials`` are those that are shown, ``left_out`` counts the others by standing; ``effects`` is the smooth model of
    the parameters at ``places``, None if there is none.
    """

    name: str
    designs: Designs
    trials: Sequence[Trial]
    left_out: Counter[str]
    thresholds: tuple[float, ...]
    effects: Effects | None
    places: list[int]
    fresh: Designs | None = None

    @property
    def info(self) -> ExperimentInfo:
        """The experiment in the store."""
        return self.designs.info


def read_experiments(store: Store, thresholds: Sequence[float] = (), simulated_trials: bool = False) -> list[Experiment]:
    """The experiments of a store in their order, then those with trials only. FoldcarError.

    ``thresholds`` of success, 0 to 1; without any, each experiment has its listing's, or THRESHOLDS.
    ``simulated_trials``: show trials of simulated cars too; they count in no rate.
    """
    infos = store.info().experiments if store.holds_study() else {}
    everything = {name: (one, list(store.trials(one.listed_id))) for name, one in infos.items()}
    found = []
    for name, (info, trials) in (everything | _unswept_experiments(store)).items():
        shown, left_out = select_trials(trials, simulated_trials)
        designs = read_designs(store, info, shown)
        effects, places = read_effects(designs)
        again = infos.get(fresh_id(name)) if info.searched else None
        fresh = None if again is None else read_designs(store, again, ())
        good = tuple(sorted(set(thresholds))) or info.thresholds or THRESHOLDS
        found.append(Experiment(name, designs, shown, left_out, good, effects, places, fresh))
    return found


def _unswept_experiments(store: Store) -> dict[str, tuple[ExperimentInfo, list[Trial]]]:
    """The experiments that have trials only, one for each type of car, as if swept without a run, by their names."""
    infos = store.info().experiments.values() if store.holds_study() else ()
    known = {name for info in infos for name in (info.id, info.listed_id)}
    groups: dict[tuple[str, str], list[Trial]] = {}
    for trial in store.trials():
        if trial.experiment not in known:
            groups.setdefault((trial.experiment, trial.vehicle_type), []).append(trial)
    return {f"{name}: {kind}, trials only": (_unswept(some), some) for (name, kind), some in groups.items()}


def _unswept(trials: Sequence[Trial]) -> ExperimentInfo:
    first, designs = trials[0], [trial.design for trial in trials]
    values = {name: sorted({one[name] for one in designs if name in one}) for one in designs for name in one}
    varied = {name: tuple(some) for name, some in values.items() if len(some) > 1}
    return ExperimentInfo(
        **UNKNOWN,
        id=first.experiment,
        vehicle_type=first.vehicle_type,
        varied=varied,
        fixed={name: some[0] for name, some in values.items() if name not in varied},
        scenic_program=first.scenic_program or "an unknown program",
        scenic_params={},
        variation={},
        success_rule="a trial has passed as its operator judged",
        success_defined=True,
    )


def page_data(
    store: Store, command: Sequence[str] = (), experiments: Sequence[Experiment] | None = None
) -> dict[str, Any]:
    """The object described above, without replays and files; ``command`` is that of the report.

    ``experiments`` are those of the store if the caller has them. FoldcarError.
    """
    study = store.info() if store.holds_study() else None
    some = read_experiments(store) if experiments is None else experiments
    # Threads for matrices of some tens of rows only wait for each other.
    with threadpool_limits(1):
        shown = [_experiment(store, study, one, some, command) for one in some]
    return {
        "title": study.listing_name if study is not None else store.path.name,
        "engine_notes": list(dict.fromkeys(one.info.warning for one in some if one.info.warning)),
        "experiments": shown,
    }


def _experiment(
    store: Store, study: StudyInfo | None, one: Experiment, experiments: Sequence[Experiment], command: Sequence[str]
) -> dict[str, Any]:
    info, designs, effects, places = one.info, one.designs, one.effects, one.places
    threshold, few = one.thresholds[-1], info.stored_runs <= MOST_RUNS
    values = environment_values(store, info) if designs.swept else EnvironmentValues((), numpy.empty((0, 0)))
    advice = Advice(designs, effects, places, threshold)
    columns = designs.columns(threshold)
    headline, likely = advice.headline(), advice.likely()
    if one.fresh is not None:
        headline, likely = advice.judged(Advice(one.fresh, None, places, threshold))
    engines = other_engines(designs, [other.designs for other in experiments])
    areas = next(
        (some["value"] for some in columns["measures"] if some["key"] == "sheet_area"), [None] * len(designs.names)
    )
    return {
        "id": one.name,
        "headline": headline,
        "remarks": [*(engine["text"] for engine in engines), *remarks(designs, one.trials, one.left_out)],
        "thresholds": list(one.thresholds),
        "judged": info.success_defined,
        "simulation": info.simulation,
        "interval": designs.interval_name,
        "environments": info.environments,
        "time_limit_s": info.timeout_s,
        "likely": likely,
        "learn": advice.learn(),
        "edge": advice.edges(),
        "parameters": parameter_columns(designs),
        "fixed": [[label_and_unit(name)[0], value_text(name, value)] for name, value in info.fixed.items()],
        "designs": columns,
        "engines": engines,
        "effects": [] if effects is None else effect_rows(designs, effects, places),
        "importance": [] if effects is None else importance_rows(effects, places),
        "causes": cause_rows(designs, values),
        "ends": read_run_ends(store, info, designs.runs.counted) if designs.swept else None,
        "runs": _runs(designs) if few else None,
        "runs_omitted": "" if few else OMITTED.format(info.stored_runs, designs.swept),
        "outcomes": list(OUTCOMES),
        "outcome_labels": [OUTCOME_LABELS[name] for name in OUTCOMES],
        "replays": [],
        "trials": _trial_rows(store, info, designs, one.trials),
        "front": search_front(designs, areas, one.fresh),
        "provenance": _provenance(study, info, command),
        "files": [],
    }


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
    return ", ".join(f"{name} {f'{one:g}' if isinstance(one, float) else one}" for name, one in values.items())


def _frozen(info: ExperimentInfo) -> str:
    if info.condition is None:
        return ""
    what = [*info.condition.get("objects", []), *info.condition.get("params", [])]
    return f"as in sample {info.condition['sample']}: {', '.join(what) or 'everything'}"


def _trial_rows(store: Store, info: ExperimentInfo, designs: Designs, trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """A row for each trial, in their order; ``environment`` only where the runs have the same samples."""
    here = store.trials_here(info) if designs.swept else set()
    indices = [designs.index_of(trial) for trial in trials]
    return [
        {
            "number": trial.id,
            "design": index,
            "car": designs.name_of(trial) if index is None else designs.names[index],
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
        for trial, index in zip(trials, indices, strict=True)
    ]


def _runs(designs: Designs) -> dict[str, list[Any]]:
    """The runs in the order of design and environment, with their outcomes and times (s)."""
    runs = designs.runs
    times_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")].round(3).tolist()
    return {
        "design": runs.design.tolist(),
        "environment": runs.sample.tolist(),
        "outcome": runs.outcome.tolist(),
        "time_s": [None if time_s != time_s else time_s for time_s in times_s],
    }
