"""The store's tables, declared once; the SQL that creates them is generated from these declarations.

A run's metrics are those of :mod:`foldcar.simulation.results`. All tables are STRICT: SQLite checks types, required
values and choices whenever a row is written, and again in PRAGMA integrity_check.
"""

from dataclasses import dataclass
from functools import cached_property
from sqlite3 import Connection

from foldcar.simulation.results import METRICS, OUTCOMES
from foldcar.store.trial_records import BUILT, CARS, MEDIA_ENDINGS, TRIAL_OUTCOMES, UNKNOWN

# Raised by every change of a table or view that foldcar reads; stores of other versions are refused. Other tables in a
# store, such as those of earlier releases, are left unread.
VERSION = 6
# The first version whose trials are still read, by `foldcar trials import`.
OLDEST_TRIALS = 4

# SQL types of columns. JSON is a JSON text, VALUE a text or a number, COUNT a number from 0.
SQL_TYPES = {
    "INTEGER": "INTEGER", "COUNT": "INTEGER", "REAL": "REAL", "TEXT": "TEXT", "JSON": "TEXT", "VALUE": "ANY",
}  # fmt: skip
# Limits of numbers: finite, and far beyond any number that foldcar writes.
LIMITS = {"COUNT": (0, 10_000_000), "REAL": (-1e15, 1e15)}


@dataclass(frozen=True, slots=True)
class Column:
    """A column: ``type`` is a key of SQL_TYPES, ``refers`` the table whose ``id`` it contains.

    ``null`` allows an empty value; ``choices``, if there are any, are the possible values.
    """

    name: str
    type: str
    meaning: str
    null: bool = False
    refers: str | None = None
    choices: tuple[str | int, ...] = ()

    @property
    def sql(self) -> str:
        """The column's definition in CREATE TABLE."""
        parts = [self.name, SQL_TYPES[self.type]]
        if not self.null:
            parts.append("NOT NULL")
        if self.refers:
            parts.append(f"REFERENCES {self.refers} (id)")
        if self.choices:
            parts.append(f"CHECK ({self.name} IN {self.choices})")
        return " ".join(parts)


@dataclass(frozen=True)
class Table:
    """A table of the store. ``key`` names the columns that together identify a row.

    ``unique`` names a column, not in the key, that also identifies a row; None if there is no such column. ``order``
    lists the key's columns in the order in which SQLite sorts the rows in the file; () means the order of ``key``.
    """

    name: str
    meaning: str
    columns: tuple[Column, ...]
    key: tuple[str, ...] = ("id",)
    unique: str | None = None
    order: tuple[str, ...] = ()

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the columns."""
        return tuple(column.name for column in self.columns)

    @cached_property
    def json_columns(self) -> tuple[str, ...]:
        """The names of the columns of JSON texts."""
        return tuple(column.name for column in self.columns if column.type == "JSON")

    @property
    def sql(self) -> str:
        """The CREATE TABLE statement."""
        parts = [column.sql for column in self.columns]
        parts.append(f"PRIMARY KEY ({', '.join(self.order or self.key)})")
        if self.unique:
            parts.append(f"UNIQUE ({self.unique})")
        options = "WITHOUT ROWID, STRICT" if len(self.key) > 1 else "STRICT"
        return f"CREATE TABLE {self.name} ({', '.join(parts)}) {options}"


def _text_table(name: str, meaning: str) -> Table:
    """Return a table of JSON texts, each of which is stored once and found by its hash."""
    columns = (
        Column("id", "INTEGER", "number"),
        Column(
            "hash",
            "TEXT",
            "SHA-256 of the JSON text, and of the code's hash if the same text may mean another thing in another version",
        ),
        Column("json", "JSON", "the object; the names in it end with their units"),
    )
    return Table(name, meaning, columns, unique="hash")


def _fingerprint_table(name: str, meaning: str, *further_columns: Column) -> Table:
    """Return a table whose rows are found by their fingerprint: a hash of everything that distinguishes them."""
    columns = (
        Column("id", "INTEGER", "number"),
        Column("fingerprint", "TEXT", "hash of all that matters"),
        *further_columns,
    )
    return Table(name, meaning, columns, unique="fingerprint")


_SAMPLE = Column("sample", "COUNT", "number of the sample, from 0")
_RUN_KEY = tuple(
    Column(f"{name}_id", "INTEGER", meaning, refers=name)
    for name, meaning in (
        ("build", "the build of carsim"),
        ("body", "the car's body"),
        ("scene", "the scene"),
        ("settings", "speed, turn rate, time limit and the firmware's parameters"),
        ("variation", "how the car differs from its design"),
    )
)
_RUN_KEY_NAMES = tuple(column.name for column in _RUN_KEY)
# A sweep simulates all designs in a sample before the next, so this order appends new rows and fills pages.
_RUN_ORDER = ("build_id", "scene_id", "variation_id", "body_id", "settings_id")

RUN = Table(
    "run",
    "the result of a run under its key",
    (
        *_RUN_KEY,
        Column("outcome", "TEXT", "how the run ended", choices=OUTCOMES),
        *(Column(metric.name, "REAL", f"{metric.help}, in {metric.unit}", null=True) for metric in METRICS),
        Column("message", "TEXT", "why a failed run failed", null=True),
    ),
    key=_RUN_KEY_NAMES,
    order=_RUN_ORDER,
)
REALITY_RUN = Table(
    "reality_run",
    "a run in a reality of its own, from which the success rate is learned",
    (
        *(
            Column(f"{name}_id", "INTEGER", meaning, refers=name)
            for name, meaning in (
                ("build", "the build of carsim"),
                ("spread", "what realities are drawn from: priors, spread of the cars, seed"),
                ("body", "the car's body"),
                ("settings", "speed, turn rate, time limit and the firmware's parameters"),
                ("scene", "the scene"),
            )
        ),
        Column("number", "COUNT", "number of the run, from 0, which draws its reality, design, scene, car and start"),
        Column("scores", "JSON", "the scores of the reality's parameters, in the order of belief/priors.py"),
        Column(
            "passed", "INTEGER", "1 if it passed, 0 if not, empty if the simulation failed", null=True, choices=(0, 1)
        ),
    ),
    key=("build_id", "spread_id", "body_id", "settings_id", "scene_id", "number"),
    order=("build_id", "spread_id", "number", "scene_id", "body_id", "settings_id"),
)
RECORDED = Table(
    "recorded",
    "a value that a Scenic program recorded in a run",
    (
        *(Column(column.name, column.type, column.meaning) for column in _RUN_KEY),
        Column("name", "TEXT", "the record's name"),
        Column("kind", "TEXT", "when it was recorded", choices=("initial", "final", "series")),
        Column("value", "JSON", "the value; that of a series is a list of [time in s, value]"),
    ),
    key=(*_RUN_KEY_NAMES, "name"),
    order=(*_RUN_ORDER, "name"),
)
STUDY = Table(
    "study",
    "a fact of the latest sweep: versions, listing, command, time of creation",
    (Column("key", "TEXT", "name of the fact"), Column("value", "TEXT", "the fact")),
    key=("key",),
)
BUILD = Table(
    "build",
    "a build of carsim",
    (Column("id", "INTEGER", "number"), Column("name", "TEXT", "what `carsim --version` calls it")),
    unique="name",
)
ENVIRONMENT = _fingerprint_table(
    "environment",
    "an environment that scenes are sampled from",
    Column("dynamic", "INTEGER", "1 if its program runs beside the simulation, 0 if not, empty if unknown", null=True),
)
SAMPLE = Table(
    "sample",
    "which scene a sample of an environment is",
    (
        Column("environment_id", "INTEGER", "the environment", refers="environment"),
        _SAMPLE,
        Column("scene_id", "INTEGER", "its scene", refers="scene"),
        Column("objects", "JSON", "its terrain objects: [[name, {parameter: number}], …], units in the names", null=True),
    ),
    key=("environment_id", "sample"),
)
SPREAD = _fingerprint_table("spread", "a spread of built cars around their designs")
DRAW = Table(
    "draw",
    "which variation a sample of a spread is, the same for every design",
    (
        Column("spread_id", "INTEGER", "the spread", refers="spread"),
        _SAMPLE,
        Column("variation_id", "INTEGER", "its variation", refers="variation"),
    ),
    key=("spread_id", "sample"),
)
EXPERIMENT = Table(
    "experiment",
    "an experiment as it was last swept",
    (
        Column("id", "TEXT", "its name in the listing"),
        Column("position", "COUNT", "its place in reports, from 0"),
        Column("build_id", "INTEGER", "the build of carsim that simulated it", refers="build"),
        Column("environment_id", "INTEGER", "its environment", refers="environment"),
        Column("spread_id", "INTEGER", "the spread of its cars", refers="spread"),
        Column("environments", "COUNT", "how many samples of the environment it has"),
        Column("vehicle", "TEXT", "the vehicle's name in the listing"),
        Column("environment", "TEXT", "the environment's name in the listing"),
        Column("facts", "JSON", "what else the listing says of it"),
        Column("designs", "COUNT", "how many designs it has", null=True),
        Column("designs_fingerprint", "TEXT", "hash of all that its designs follow from, if it is known", null=True),
    ),
)
DESIGN = Table(
    "design",
    "a design of an experiment's family",
    (
        Column("experiment", "TEXT", "the experiment", refers="experiment"),
        Column("position", "COUNT", "its place in the family, from 0"),
        Column("parameters", "JSON", "the design's parameters by name, units in the names"),
        Column("body_id", "INTEGER", "the car's body", refers="body"),
        Column("settings_id", "INTEGER", "what it drives with", refers="settings"),
    ),
    key=("experiment", "position"),
)
TRIAL = Table(
    "trial",
    "a trial of a built or a simulated car; what is empty is not known",
    (
        Column("id", "INTEGER", "number"),
        Column("uuid", "TEXT", "identifies the trial in every store: made when it begins, or derived by its import"),
        Column("experiment", "TEXT", "the experiment's name"),
        Column("vehicle_type", "TEXT", "the car's modules, front to back"),
        Column("design", "JSON", "the design's parameters by name, units in the names"),
        Column("body_id", "INTEGER", "the car's body for the simulator", null=True, refers="body"),
        Column("settings_id", "INTEGER", "what it was driven with", null=True, refers="settings"),
        Column("environment_id", "INTEGER", "the environment", null=True, refers="environment"),
        Column("sample", "INTEGER", "the sample of the environment that was planned", null=True),
        Column("scene_id", "INTEGER", "the scene as it was placed", null=True, refers="scene"),
        Column("deviations", "JSON", "what stood elsewhere than planned: {name: [x in m, y in m, heading in rad]}"),
        Column("outcome", "TEXT", "how it went", choices=TRIAL_OUTCOMES),
        Column("ending", "TEXT", "what ended it; running until it is completed"),
        Column("elapsed_time_s", "REAL", "the drive's time by the car's clock, in s", null=True),
        Column("note", "TEXT", "the operator's note"),
        Column("operator", "TEXT", "who drove"),
        Column("started_utc", "TEXT", "when it began", null=True),
        Column("ended_utc", "TEXT", "when it was completed", null=True),
        Column("firmware_build", "TEXT", "the firmware's build as the car reported it", null=True),
        Column("design_hash", "TEXT", "the hash of its design as the car reported it", null=True),
        Column("port", "TEXT", "the port that the car was at", null=True),
        Column("log", "TEXT", "its log (MAVLink .tlog), relative to the store's folder", null=True),
        Column("log_sha256", "TEXT", "SHA-256 of the log", null=True),
        Column("source", "TEXT", "where a trial that was imported comes from", null=True),
        Column("car", "TEXT", "what drove, as the car or the imported file reported it", null=True, choices=CARS),
        Column("withdrawn", "INTEGER", "1 if it was withdrawn and does not count, else 0"),
        Column("scenic_program", "TEXT", "the environment's program as the listing names it", null=True),
        Column("car_name", "TEXT", "which built car drove; nameless trials of a design are of one", null=True),
    ),
    unique="uuid",
)
CORRECTION = Table(
    "correction",
    "what was changed of a trial afterwards",
    (
        Column("id", "INTEGER", "number"),
        Column("trial_id", "INTEGER", "the trial", refers="trial"),
        Column("corrected_utc", "TEXT", "when"),
        Column("field", "TEXT", "the column that was changed"),
        Column("before", "VALUE", "what stood there", null=True),
        Column("after", "VALUE", "what stands there since", null=True),
        Column("reason", "TEXT", "why"),
        Column("operator", "TEXT", "who corrected it"),
    ),
)
MEDIA = Table(
    "media",
    "photos and films of trials, kept where they are",
    (
        Column("trial_id", "INTEGER", "the trial", refers="trial"),
        Column("sha256", "TEXT", "SHA-256 of the file"),
        Column("kind", "TEXT", "what it is", choices=tuple(MEDIA_ENDINGS)),
        Column("file", "TEXT", "the file, relative to the store's folder if it is in there"),
        Column("added_utc", "TEXT", "when it was attached"),
    ),
    key=("trial_id", "sha256"),
)
MEASURED = Table(
    "measured",
    "a parameter of the simulator that was measured on the built cars and the obstacles of an experiment's trials",
    (
        Column("experiment", "TEXT", "the experiment's name, as trials have it"),
        Column("parameter", "TEXT", "the parameter's name, its unit in it"),
        Column("value", "REAL", "what was measured"),
    ),
    key=("experiment", "parameter"),
)

# Tables come after the tables to which they refer.
TABLES = (
    STUDY,
    BUILD,
    _text_table("body", "a car's body for the simulator"),
    _text_table("scene", "a scene"),
    _text_table("settings", "what a car is driven with: speed, turn rate, time limit, firmware parameters"),
    _text_table("variation", "how a built car differs from its design"),
    ENVIRONMENT,
    SAMPLE,
    SPREAD,
    DRAW,
    EXPERIMENT,
    DESIGN,
    RUN,
    RECORDED,
    REALITY_RUN,
    TRIAL,
    CORRECTION,
    MEDIA,
    MEASURED,
)
BY_NAME = {table.name: table for table in TABLES}

# The SQL from FROM on that pairs each design and sample of an experiment with its run: e is the table of experiments,
# d of designs, s of samples, w of draws, r of runs. A condition such as `AND e.id = ?` may follow.
RESULT_JOIN = """FROM experiment e CROSS JOIN design d CROSS JOIN sample s CROSS JOIN draw w CROSS JOIN run r
    WHERE d.experiment = e.id AND s.environment_id = e.environment_id AND s.sample < e.environments
        AND w.spread_id = e.spread_id AND w.sample = s.sample
        AND r.build_id = e.build_id AND r.body_id = d.body_id AND r.scene_id = s.scene_id
        AND r.settings_id = d.settings_id AND r.variation_id = w.variation_id"""

RESULT_VIEW = f"""CREATE VIEW result AS
    SELECT e.position AS experiment_position, e.id AS experiment, e.vehicle, e.environment,
        d.position AS design_position, d.parameters, s.sample, r.outcome,
        {"".join(f"r.{metric.name}, " for metric in METRICS)}r.message,
        (SELECT json_group_object(v.name, json_object('kind', v.kind, 'value', json(v.value)))
            FROM recorded v
            WHERE {" AND ".join(f"v.{name} = r.{name}" for name in _RUN_KEY_NAMES)}) AS recorded,
        {", ".join(f"r.{name}" for name in _RUN_KEY_NAMES)}
    {RESULT_JOIN}"""

# All trials with the columns that readers use; only trials with `counts` 1 belong in a success rate.
TRIAL_VIEW = f"""CREATE VIEW trial_result AS
    SELECT t.id AS trial, t.experiment, t.vehicle_type, t.design AS parameters, e.environment,
        coalesce(t.scenic_program, json_extract(e.facts, '$.scenic_program')) AS scenic_program, t.sample, t.outcome,
        t.elapsed_time_s, coalesce(t.car, '{UNKNOWN}') AS car, t.car_name, t.withdrawn,
        t.car IS '{BUILT}' AND NOT t.withdrawn AND t.outcome <> 'aborted' AS counts,
        CASE WHEN t.withdrawn THEN (SELECT c.reason FROM correction c
            WHERE c.trial_id = t.id AND c.field = 'withdrawn' ORDER BY c.id DESC LIMIT 1) END AS withdrawn_because,
        (SELECT count(*) FROM correction c WHERE c.trial_id = t.id) AS corrections,
        t.ending, t.note, t.operator, t.started_utc, t.ended_utc, t.deviations, t.log, t.source,
        t.environment_id, t.scene_id, t.body_id, t.settings_id
    FROM trial t LEFT JOIN experiment e
        ON e.id = t.experiment AND (t.environment_id IS NULL OR t.environment_id = e.environment_id)"""

VIEWS = {"result": RESULT_VIEW, "trial_result": TRIAL_VIEW}


def create_tables(connection: Connection) -> None:
    """Create the tables and the views of this version."""
    for table in TABLES:
        connection.execute(table.sql)
    for view_sql in VIEWS.values():
        connection.execute(view_sql)
