"""The data of the report's page, as types: page_data.py makes it, and the scripts in web/ read it.

`tools/web_bundles.py` writes these types as TypeScript (web/page_types.d.ts) and lets TypeScript check web/data.js by
them. All values are plain JSON. A rate or a share is 0 to 1, and an interval holds with 95 %. A *column* has one entry
for each design of the experiment, in the order of ``DesignTable.name``; a *design* is an index into the columns.
"""

from typing import Literal, TypedDict

Column = list[float | None]
IntColumn = list[int]


class PageData(TypedDict):
    """All data of the page."""

    # Title and notes (Markdown) of the listing.
    title: str
    notes: str
    # Warnings about engines that cannot simulate all of an experiment.
    engine_notes: list[str]
    experiments: list["PageExperiment"]


class PageExperiment(TypedDict):
    """An experiment of the store, or trials that belong to none."""

    id: str
    # Sentences of `foldcar select`: which car works, and the evidence for it.
    headline: str
    grounds: str
    # Remarks without what the trials have taught, which `realities` has.
    remarks: list[str]
    next: "NextSteps"
    # Sentences on gaps and ends of ranges.
    ranges: list[str]
    # The design with the highest expected success of built cars; null without a belief.
    leader: int | None
    # The design whose car to take; without a belief, that with the highest share of passed runs.
    recommended: int | None
    # Ascending; a design is good if it reaches the last one.
    thresholds: list[float]
    # Whether the experiment defines when a run has passed.
    judged: bool
    # The engine's name in sentences, and the name of the intervals of simulated rates.
    simulation: str
    interval: str
    # The number of environments.
    environments: int
    time_limit_s: float
    parameters: list["VariedParameter"]
    # Label and text of each parameter that does not vary.
    fixed: list[list[str]]
    designs: "DesignTable"
    exported: "ExportedColumns"
    engines: list["OtherSimulation"]
    # Null without a belief.
    realities: "PageRealities | None"
    effects: list["ParameterEffect"]
    # The most important parameter first; empty with one parameter.
    importance: list["ParameterImportance"]
    # The value that separates best first.
    causes: list["Cause"]
    # Null if no run that did not pass has a place.
    ends: "RunEnds | None"
    # Null if there are too many runs; `runs_omitted` then says so.
    runs: "RunTable | None"
    runs_omitted: str
    # Names and labels of the numbers in `RunTable.outcome`.
    outcomes: list[str]
    outcome_labels: list[str]
    # Null if the page cannot simulate the runs.
    drives: "Drives | None"
    trials: list["TrialRow"]
    # Null unless a search chose the designs.
    front: "SearchFront | None"
    # Label and text of the facts from which the experiment follows.
    provenance: list[list[str]]
    # Caption and relative address of each figure.
    files: list[list[str]]


class NextSteps(TypedDict):
    """What to do next: the sentence of `foldcar select`, and the steps that were weighed, the best first."""

    text: str
    steps: list["NextStep"]


class NextStep(TypedDict):
    """A step that was weighed; ``design`` is null for a measurement. ``gain`` is in the expected success rate."""

    text: str
    design: int | None
    gain: float
    minutes: float


class VariedParameter(TypedDict):
    """A parameter that varies; ``values`` are all that occur, ascending."""

    name: str
    label: str
    unit: str
    values: list[float]


class DesignTable(TypedDict):
    """The designs as columns."""

    # Of each design: the index of its value of each parameter in `VariedParameter.values`.
    value: list[list[int]]
    # Names for readers.
    name: list[str]
    swept: list[bool]
    # Simulated runs without rejected ones, with the interval of their rate.
    runs: IntColumn
    passed: IntColumn
    rate: Column
    low: Column
    high: Column
    # A column for each outcome.
    outcomes: list[IntColumn]
    # Trials that count, the number of cars that drove them, and the interval of the rate of these cars.
    trials: IntColumn
    trials_passed: IntColumn
    cars: IntColumn
    trials_low: Column
    trials_high: Column
    # Success of a further built car, by simulation and trials.
    belief: Column
    belief_low: Column
    belief_high: Column
    # By the last threshold and the band of built cars; before trials and without a belief, by the band of simulation.
    verdict: list[Literal["good", "bad", "open"] | None]
    # How the design's own trials contradict simulation.
    refuted: list[str | None]
    measures: list["Measure"]


class Measure(TypedDict):
    """A number of each design, such as its mass; ``better`` says which values are better."""

    key: str
    label: str
    unit: str
    better: Literal["less", "more"] | None
    value: Column


class ExportedColumns(TypedDict):
    """What the tables that the page saves contain, as `foldcar export` does."""

    vehicle: str
    environment: str
    # The columns of the design, in the export's order, and the values of those that do not vary.
    parameters: list[str]
    fixed: dict[str, float]


class OtherSimulation(TypedDict):
    """Another simulation of the same cars in the same samples; ``text`` compares the two."""

    id: str
    name: str
    passed: IntColumn
    runs: IntColumn
    text: str


class PageRealities(TypedDict):
    """Realities that are drawn by their weights, and what the trials have taught."""

    # Whether a built car has driven.
    driven: bool
    # The simulator's unknowns, and their values in each reality.
    names: list[str]
    values: list[list[float]]
    # The success of each design in each reality; null for designs outside the belief.
    rates: list[Column]
    unknowns: list["TaughtUnknown"]
    taught: list[str]
    learned: "LearnedRate"


class TaughtUnknown(TypedDict):
    """An unknown before and after the trials: low end, median and high end of its likely range."""

    name: str
    unit: str
    meaning: str
    before: list[float]
    after: list[float]
    measured: float | None
    # Whether the trials say something about it.
    taught: bool


class LearnedRate(TypedDict):
    """From how many runs in other realities the success rate was learned, and its error; null if that is unknown."""

    runs: int
    error: float | None


class ParameterEffect(TypedDict):
    """The success in simulation over one parameter, a mean over the same combinations of the other parameters.

    Raw averages are not given, because they would be of unequal combinations.
    """

    # The index of the parameter.
    parameter: int
    # Values of the parameter; the success at each; the band of its difference from the mean over all values.
    grid: list[float]
    mean: list[float]
    low: list[float]
    high: list[float]
    # The interval of the mean over all values.
    level: list[float]
    # At most 20 single combinations, and a text on all of them.
    curves: list[list[float]]
    over: str


class ParameterImportance(TypedDict):
    """The fraction of the variance of success that would vanish if the parameter were fixed; the sum may exceed 1."""

    parameter: int
    share: float
    low: float
    high: float


class Cause(TypedDict):
    """How well a random value separates passed from failed runs of the same design, 0 to 1.

    It is informative if ``low`` is above 0. The intervals of all causes of an experiment hold together.
    """

    # The column of the export.
    name: str
    label: str
    unit: str
    separation: float
    low: float
    high: float
    # Whether runs with greater values pass.
    rises: bool
    bins: list["CauseBin"]


# A functional definition, because `from` is a keyword.
CauseBin = TypedDict("CauseBin", {"from": float, "to": float, "runs": int, "passed": int})


class RunEnds(TypedDict):
    """Where the runs that did not pass ended, by their progress from the start towards the goal.

    The last five fields are columns: so many runs (``count``) of a design ended with that outcome, in that bin, at that
    obstacle (-1: at none).
    """

    from_m: float
    step_m: float
    bins: int
    # The goal's mean position.
    goal_m: float
    obstacles: list["ObstacleRange"]
    design: list[int]
    outcome: list[int]
    bin: list[int]
    obstacle: list[int]
    count: list[int]


class ObstacleRange(TypedDict):
    """The mean ends of an obstacle, and the ends of the range that contains it in nine of ten environments."""

    name: str
    from_m: float
    to_m: float
    least_m: float
    most_m: float


class RunTable(TypedDict):
    """The runs as columns, in the order of design and environment; the time of a failed run is null."""

    design: list[int]
    environment: list[int]
    outcome: list[int]
    time_s: Column


class Drives(TypedDict):
    """What the page needs to simulate runs; drives.py adds it."""

    # The blobs' names begin with it.
    key: str
    # The option of carsim that chooses the engine, and the build of the stored runs.
    engine: str
    build: str
    # Which designs and environments the page can simulate.
    designs: list[int]
    environments: list[int]
    path_interval_s: float
    sliders: list["Slider"]


class Slider(TypedDict):
    """An unknown that a reader can change."""

    name: str
    unit: str
    meaning: str
    nominal: float
    low: float
    high: float


class TrialRow(TypedDict):
    """A trial; ``environment`` is null if it was driven in no sample of these runs."""

    number: int
    design: int | None
    # The name of the design, and that of the car itself.
    car: str
    car_name: str | None
    standing: str
    environment: int | None
    # Null if the trial was aborted.
    passed: bool | None
    outcome: str
    time_s: float | None
    # When it began (UTC).
    when: str | None
    note: str
    media: list["MediaFile"]
    replay: "TrialReplay | None"


class MediaFile(TypedDict):
    """A photo or film; its relative address is null if the file is missing."""

    kind: str
    name: str
    address: str | None


class TrialReplay(TypedDict):
    """What is drawn of a trial."""

    # How many of car and obstacles stood off their planned poses.
    moved: int
    # Whether a blob has the trial's path.
    path: bool
    # Without a path: rows of time (s), pitch and roll (rad), and why there is no path.
    attitude: list[list[float]] | None
    missing: str | None


class SearchFront(TypedDict):
    """The designs of a search in the space of its objectives."""

    objectives: list["PageObjective"]
    points: list["FrontPoint"]


class PageObjective(TypedDict):
    """An objective of a search."""

    label: str
    unit: str
    better: Literal["less", "more"]


class FrontPoint(TypedDict):
    """A design of a search, with a value and an interval for each objective.

    ``fresh`` values are from environments that chose no design; all other values are biased upwards. Only a fresh point
    may be called best, unless it is ``beaten``: another fresh point is at least as good in all objectives.
    """

    design: int
    values: Column
    low: Column
    high: Column
    fresh: bool
    beaten: bool
