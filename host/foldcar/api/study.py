"""A study in Python: a store's content as tables, and its designs' success rates with intervals."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeVar

from foldcar.api.arguments import (
    checked_bool,
    checked_confidence,
    checked_experiment,
    checked_number,
    checked_path,
    column_named,
    columns_named,
)
from foldcar.api.modelled_success import ModelledSuccess
from foldcar.api.pictures import SIZE_IN, drawing_of, drawn, picture_html
from foldcar.errors import FoldcarError
from foldcar.evidence.adviser import Selection
from foldcar.evidence.comparison import MARGIN, Comparison, compare
from foldcar.evidence.remarks import trials_driven_otherwise
from foldcar.evidence.selecting import select
from foldcar.notebook_html import lines_html, table_html
from foldcar.shown_text import shown_value
from foldcar.simulation.results import no_rate_text
from foldcar.statistics.effects import Standardised, fit_effects
from foldcar.statistics.rate import Rate
from foldcar.statistics.words import count as count_text
from foldcar.store.connection import require_store
from foldcar.store.frames import runs_frame, trials_frame
from foldcar.store.reader import ExperimentInfo, Store

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from foldcar.report.reported_experiment import ReportedExperiment

T = TypeVar("T")


class Selections(list[Selection]):
    """The advice for each experiment, which a notebook shows as words, table and picture."""

    def __repr__(self) -> str:
        return "\n".join(map(repr, self))

    def _repr_html_(self) -> str:
        return "".join(selection._repr_html_() for selection in self)


class StudyRow(NamedTuple):
    """An experiment in the printed study, in texts: ``designs``, ``runs`` and ``trials`` are their numbers."""

    experiment: str
    vehicle: str
    environment: str
    designs: str
    runs: str
    trials: str


class Study:
    """A store that `foldcar sweep` or `foldcar log` has written; its tables are read once.

    Raises FoldcarError if the store does not exist or is damaged.

    >>> study = foldcar.Study("study.db")
    >>> study.runs[["width_mm", "sample", "outcome"]].shape
    (12, 3)
    """

    def __init__(self, store: str | Path) -> None:
        # Absolute, because the working directory may change later.
        self.path = checked_path("store", store, "a store").absolute()
        require_store(self.path)
        # What figures show, with and without trials of simulated cars.
        self._reported_experiments: dict[bool, Mapping[str, ReportedExperiment]] = {}

    def __repr__(self) -> str:
        lines = [
            f"  experiment {row.experiment}: {row.vehicle}, {row.environment}, {row.designs}, {row.runs}, {row.trials}"
            for row in self._contents()
        ]
        return "\n".join([f"Study({str(self.path)!r})", *lines])

    def _repr_html_(self) -> str:
        rows = list(self._contents())
        table = table_html(StudyRow._fields, rows) if rows else ""
        return lines_html([f"Study {self.path.name}"]) + table + self._picture(rows[0].experiment if rows else None)

    def _contents(self) -> Iterator[StudyRow]:
        """Yield a row for each experiment of the store."""
        trial_counts = Counter(self.trials["experiment"])
        # An experiment may have trials without having been swept.
        for name in dict.fromkeys([*self.experiments, *trial_counts]):
            info = self.experiments.get(name)
            trials_text = count_text(trial_counts[name], "trial")
            if info is None:
                yield StudyRow(name, vehicle="", environment="", designs="no design", runs="no run", trials=trials_text)
            else:
                yield StudyRow(
                    name,
                    vehicle=info.vehicle_type,
                    environment=Path(info.scenic_program).name,
                    designs=count_text(info.designs, "design"),
                    runs=count_text(info.stored_runs, "run"),
                    trials=trials_text,
                )

    def reload(self) -> None:
        """Forget the tables, so that the next access also reads new runs and trials.

        >>> study.reload()
        """
        for name in ("runs", "_runs", "trials", "_trials", "experiments"):
            self.__dict__.pop(name, None)
        self._reported_experiments.clear()

    @cached_property
    def runs(self) -> "pandas.DataFrame":
        """A table with a row for each simulated run; see :func:`foldcar.store.frames.runs_frame`.

        You may change it: the study computes its rates from a table of its own.
        """
        return self._runs.copy()

    @cached_property
    def trials(self) -> "pandas.DataFrame":
        """A table with a row for each trial, which you may change; see :func:`foldcar.store.frames.trials_frame`."""
        return self._trials.copy()

    @cached_property
    def _runs(self) -> "pandas.DataFrame":
        return self._read(runs_frame)

    @cached_property
    def _trials(self) -> "pandas.DataFrame":
        return self._read(trials_frame)

    @cached_property
    def experiments(self) -> Mapping[str, ExperimentInfo]:
        """The swept experiments by id, with environment, settings and rule of success."""
        return self._read(lambda store: store.info().experiments if store.holds_study() else {})

    def rate(
        self,
        *,
        experiment: str | None = None,
        source: Literal["simulation", "trials"] = "simulation",
        confidence: float = 0.95,
        **design: float,
    ) -> Rate:
        """Return the success rate of one design's runs, or of its counted trials, with its interval.

        The rate of trials is that of the cars that drove; :meth:`compare` also estimates that of a new car. Trials that
        were driven otherwise than the runs, such as at another speed, are left out; the rate's ``method`` says how many.

        Parameters are named as columns (``width_mm=95``), or without unit if that is unambiguous (``width=95``). Give
        enough of them to select one design. Rejected runs are left out. Raises FoldcarError if no design or several
        have these parameters, if success is undefined, or if there are no runs (trials).

        >>> rate = study.rate(width=95)
        >>> rate.low <= rate.value <= rate.high, rate.confidence
        (True, 0.95)
        """
        if not isinstance(source, str) or source not in ("simulation", "trials"):
            raise FoldcarError(f'source: {shown_value(source)} is neither "simulation" nor "trials"')
        checked_experiment(experiment)
        confidence = checked_confidence(confidence)
        table = self._runs if source == "simulation" else self._trials[self._trials["counts"]]
        design_rows = self._of_design(self._of_experiment(table, experiment, source), design, source)
        left_out_text = ""
        if source == "trials":
            design_rows, left_out_text = _like_runs(design_rows)
        has_passed = self._judged(design_rows)["passed"]
        passed, counted = int(has_passed.sum()), len(has_passed)
        if not counted:
            raise FoldcarError(f"rate: {no_rate_text(len(design_rows))}")
        counted_text = "simulated runs"
        if source == "trials":
            cars = count_text(design_rows["car_name"].nunique(dropna=False), "built car")
            counted_text = f"trials of {cars}"
        name = str(design_rows["experiment"].iloc[0])
        stopped = source == "simulation" and self.experiments[name].until is not None
        method = f"{passed} of {counted} {counted_text} that passed{left_out_text}"
        return Rate.from_counts(passed, counted, method, stopped, confidence)

    def select(
        self,
        *,
        threshold: float | None = None,
        experiment: str | None = None,
        simulated_trials: bool = False,
    ) -> "Selections":
        """Say for each experiment which car to take and what to do next; see :func:`foldcar.evidence.selecting.select`.

        Raises FoldcarError.

        >>> study.select()[0].leader is None  # the study of this example has no runs in other realities
        True
        """
        checked_experiment(experiment)
        checked_bool("simulated_trials", simulated_trials)
        limit = None if threshold is None else checked_number("threshold", threshold, 0, 1)
        selections = self._read(lambda store: select(store, limit, experiment, simulated_trials))
        return Selections(
            replace(selection, picture=partial(self._picture, selection.info.id, simulated_trials))
            for selection in selections
        )

    def compare(
        self, *, experiment: str | None = None, margin: float = MARGIN, simulated_trials: bool = False
    ) -> Comparison:
        """Compare simulation with trials of built cars; see :func:`foldcar.evidence.comparison.compare`.

        Raises FoldcarError.

        >>> print(study.compare().sentence)
        Nothing to compare: there are no trials of built cars yet. `foldcar select` says which cars to build.
        """
        checked_experiment(experiment)
        checked_bool("simulated_trials", simulated_trials)
        margin = checked_number("margin", margin, 0, 1)
        comparison = self._read(lambda store: compare(store, experiment, margin, simulated_trials))
        compared_ids = [compared.info.id for compared in comparison.experiments if compared.designs]
        if not compared_ids:
            return comparison
        # A notebook shows the comparison with a picture of its first experiment, which is drawn only then.
        picture = partial(self._picture, compared_ids[0], simulated_trials)
        return replace(comparison, picture=picture)

    def plot_success(self, *, experiment: str | None = None, figure: "Figure | None" = None) -> "Axes":
        """Draw how likely the cars are to work, as the report does, and return the matplotlib axes.

        If one parameter varies, these are the rates of simulation and of built cars with 95 % bands and the trials; if
        several vary, a map of the two that matter most. ``figure`` is an empty matplotlib figure or subfigure to draw
        into; without one, pyplot makes a figure. Raises FoldcarError if there is nothing to draw.

        >>> study.plot_success().get_ylabel()
        'passed (%)'
        """
        return self._draw(("feasibility", "map"), experiment, figure, "plot_success").axes[0]

    def plot_outcomes(self, *, experiment: str | None = None, figure: "Figure | None" = None) -> "Axes":
        """Draw how the runs of each design ended, and return the matplotlib axes; see :meth:`plot_success`.

        Raises FoldcarError if not exactly one parameter varies.

        >>> study.plot_outcomes().get_ylabel()
        'share of runs (%)'
        """
        return self._draw(("outcomes",), experiment, figure, "plot_outcomes").axes[0]

    def plot_effects(self, *, experiment: str | None = None, figure: "Figure | None" = None) -> "list[Axes]":
        """Draw success over each of several parameters, and return their matplotlib axes; see :meth:`plot_success`.

        Raises FoldcarError if fewer than two parameters vary.
        """
        return list(self._draw(("effects",), experiment, figure, "plot_effects").axes)

    def _draw(
        self,
        kinds: Sequence[str],
        experiment: str | None,
        figure: "Figure | None",
        caller: str,
        simulated_trials: bool = False,
    ) -> "Figure":
        """Draw a picture of an experiment into ``figure``, or into a new figure if that is None, and return the figure.

        The picture is the experiment's first drawing whose kind is one of ``kinds``. Error messages begin with the text
        ``caller``. If ``simulated_trials`` is True, trials of simulated cars are drawn as if built cars had driven them.
        """
        from foldcar.report.reported_experiment import read_experiments

        checked_experiment(experiment)
        if simulated_trials not in self._reported_experiments:
            experiments = self._read(lambda store: read_experiments(store, simulated_trials=simulated_trials))
            self._reported_experiments[simulated_trials] = {reported.name: reported for reported in experiments}
        drawing = drawing_of(self._reported_experiments[simulated_trials], kinds, experiment, caller)
        return drawn(drawing, figure)

    def _picture(self, experiment: str | None, simulated_trials: bool = False) -> str:
        """Return a figure of an experiment's success as HTML, "" if there is none."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=SIZE_IN, layout="constrained")
        with suppress(FoldcarError):
            kinds = ("feasibility", "map", "outcomes")
            return picture_html(self._draw(kinds, experiment, figure, "picture", simulated_trials))
        return ""

    def success_model(self, *parameters: str, experiment: str | None = None) -> "ModelledSuccess":
        """Model success as a smooth function of some design parameters, with credible bands, from the simulated runs.

        The model contains all parameters that vary. Each rate is a mean over the same combinations of the other
        parameters, because averages of the raw runs would mix in the effects of correlated parameters. Raises
        FoldcarError if there are too few designs or success is undefined.

        >>> rate, low, high = study.success_model("width").rates([[80], [95]])
        >>> len(rate), bool((low <= high).all())
        (2, True)
        """
        runs = self._judged(self._of_experiment(self._runs, experiment, "simulation"))
        varied = [name for name in _parameters(runs) if runs[name].nunique() > 1]
        columns = [column_named(name, _parameters(runs), "success_model") for name in parameters]
        if not columns:
            raise FoldcarError(f"success_model: name some of {', '.join(varied)}")
        model_columns = list(dict.fromkeys([*columns, *varied]))
        # Runs with the same values of all parameters form a group, which is a design of the model.
        groups = runs.groupby(model_columns, sort=False)
        designs = runs[model_columns].drop_duplicates()
        has_passed = runs["passed"].astype(float)
        effects = fit_effects(designs.to_numpy(dtype=float), groups.ngroup(), runs["sample"], has_passed)
        indices = tuple(model_columns.index(column) for column in columns)
        return ModelledSuccess(tuple(columns), Standardised(effects, indices))

    def _judged(self, table: "pandas.DataFrame") -> "pandas.DataFrame":
        """Return the rows without rejected runs. Raises FoldcarError if the experiment does not define success."""
        info = self.experiments.get(str(table["experiment"].iloc[0]))
        if info is not None and not info.success_defined and table["passed"].isna().any():
            raise FoldcarError(info.success_rule)
        return table[table["passed"].notna()]

    def _of_experiment(self, table: "pandas.DataFrame", experiment: str | None, source: str) -> "pandas.DataFrame":
        """Return the rows of ``table`` that belong to an experiment; None is the only experiment.

        ``source`` is "simulation" or "trials", and says what the rows are. Raises FoldcarError if there are no such rows,
        or if ``experiment`` is None and there are several.
        """
        ids = list(dict.fromkeys(table["experiment"]))
        if not ids:
            rows_text = "runs" if source == "simulation" else "trials of built cars that count"
            raise FoldcarError(f"{self.path}: has no {rows_text}")
        if experiment is None and len(ids) > 1:
            raise FoldcarError(f"{self.path}: has several experiments; choose with experiment=: {', '.join(ids)}")
        if experiment is not None and experiment not in ids:
            raise FoldcarError(f'{self.path}: has no "{experiment}" with {source}; it has {", ".join(ids)}')
        return table if experiment is None else table[table["experiment"] == experiment]

    def _of_design(self, table: "pandas.DataFrame", design: Mapping[str, float], source: str) -> "pandas.DataFrame":
        """Return the rows of ``table`` that belong to one design.

        ``design`` has the values of the design's parameters, or of enough of them to tell it from the other designs.
        ``source`` says in an error message what the rows are, such as "trials". Raises FoldcarError if no design has
        these values, or if several have them.
        """
        parameters = _parameters(table)
        result = table
        for column, value in columns_named(design, parameters, "rate").items():
            values = sorted(result[column].dropna().unique())
            result = result[result[column] == value]
            if result.empty:
                values_text = ", ".join(f"{number:g}" for number in values)
                raise FoldcarError(f"{self.path}: no {source} with {column} {value:g}; there are {values_text}")
        for column in parameters:
            values = sorted(result[column].dropna().unique())
            if len(values) > 1:
                values_text = ", ".join(f"{number:g}" for number in values[:5])
                rest_text = f", … {values[-1]:g}" if len(values) > 5 else ""
                raise FoldcarError(f"rate: {column} has several values ({values_text}{rest_text}): choose one")
        return result

    def _read(self, read: Callable[[Store], T]) -> T:
        """Open the store, and return the result of ``read``."""
        with Store.open(self.path) as store:
            return read(store)


def _like_runs(trials: "pandas.DataFrame") -> "tuple[pandas.DataFrame, str]":
    """Return the trials that were driven as the runs were, and a text on the others, such as "; 2 trials left out, …".

    The text is empty if no trial is left out. Raises FoldcarError if all trials were driven otherwise.
    """
    is_like_runs = trials["unlike_runs"].isna()
    left_out = trials[~is_like_runs]
    if left_out.empty:
        return trials, ""
    (remark,) = trials_driven_otherwise(left_out["unlike_runs"])
    text = remark.removesuffix(".")
    if not is_like_runs.any():
        raise FoldcarError(f"rate: {text}")
    return trials[is_like_runs], f"; {text}"


def _parameters(table: "pandas.DataFrame") -> list[str]:
    """Return the columns of design parameters: those between ``environment`` or ``vehicle_type`` and ``sample``.

    Parameters that no row has, because they are those of another experiment's cars, are left out.
    """
    columns: list[Any] = list(table.columns)
    first = max(columns.index(name) for name in ("environment", "vehicle_type") if name in columns)
    return [str(name) for name in columns[first + 1 : columns.index("sample")] if table[name].notna().any()]
