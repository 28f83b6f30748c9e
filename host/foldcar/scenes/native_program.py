"""Translates a program's statements about its runs for carsim, so that Scenic need not run beside it.

Input: a compiled program, then its sampled scenes. Output: the member `program` of a scene (docs/carsim.md). Translated
are `terminate when`, `terminate after` and `record` of the top level.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from foldcar.scenes import scenic_private
from foldcar.scenes.native_expressions import NotNativeError, PerSample, Translator, is_condition
from foldcar.scenes.program import parsed_program
from foldcar.scenes.reading import UnusableError, finite, outer_step_s
from foldcar.scenes.recorded import to_json
from foldcar.scenes.sampled_values import SampledValues, Terms, shown
from foldcar.scenes.success import VERDICT, SuccessRule
from foldcar.typed import read_text

# A time limit beyond carsim's own, which ends every run, has no effect.
MAX_TIME_LIMIT_S = 3600.0
# carsim's limits (program_input.cpp). An expression with at most this number of terms before sampling has room for the
# terms that a sample adds.
MAX_STATEMENTS, MAX_TERMS = 100, 400
RECORDS = {"RecordInitial": "initial", "RecordFinal": "final", "Record": "series"}


class _Ending(NamedTuple):
    """A condition that ends a run; the run has then passed, or not."""

    terms: Terms
    is_pass: bool


class _Record(NamedTuple):
    """A `record` statement: its name, when it records, and its expression with the terms, [] for a constant."""

    name: str
    kind: str
    node: Any
    terms: Terms


class NativeProgram:
    """A program's statements about its runs, in a form that :meth:`of_scene` completes for each sampled scene.

    ``limits`` are the durations of its `terminate after`: none or one, because programs with several are not translated.
    """

    def __init__(self, translator: Translator, endings: list[_Ending], limits: list[Any], records: list[_Record]) -> None:
        self._names = translator.names
        self._endings = endings
        self._limits = limits
        self._records = records

    def of_scene(self, scene: Any) -> dict[str, Any]:
        """Return the member `program` of a scene (docs/carsim.md): endings, time limit, verdict and records.

        Random values of the program have the values of this scene. Raises UnusableError or FoldcarError.
        """
        sample = SampledValues(scene, self._names)
        step_s = outer_step_s(scene.params)
        endings = []
        for ending in self._endings:
            outcome = "passed" if ending.is_pass else "terminated"
            endings.append({"when": _resolved(ending.terms, sample), "outcome": outcome})
        # The record whose value at the end of a run says whether the run has passed.
        verdict_records = [record for record in self._records if record.name == VERDICT and record.kind != "initial"]
        return {
            "endings": endings,
            "time_limit_s": self._time_limit_s(sample, step_s),
            "verdict": _verdict(verdict_records[-1], sample) if verdict_records else None,
            "records": [_record_of_scene(record, sample) for record in self._records],
            "step_s": step_s,
        }

    def _time_limit_s(self, sample: SampledValues, step_s: float) -> float | None:
        """Return the limit of `terminate after` (s), or None if there is no limit below carsim's own."""
        if not self._limits:
            return None
        (duration,) = self._limits
        unit_s = 1.0 if type(duration).__name__ == "Seconds" else step_s
        limit_s = finite("terminate after", sample.value(duration.value)) * unit_s
        if limit_s <= 0:
            raise UnusableError(f"terminate after {limit_s:g} s: is not above 0")
        return limit_s if limit_s < MAX_TIME_LIMIT_S else None


class Translation(NamedTuple):
    """A program's statements about its runs, translated for carsim, or why this is not possible.

    If carsim cannot evaluate all of them, ``program`` is None, and ``needs_scenic`` names a part that it cannot evaluate,
    with its line. Otherwise ``needs_scenic`` is "".
    """

    program: NativeProgram | None
    needs_scenic: str = ""


def native_program(scenario: Any, program: Path, success: SuccessRule) -> Translation:
    """Translate the statements of a compiled program about its runs, so that carsim evaluates them without Scenic."""
    try:
        return Translation(_translated(scenario, parsed_program(read_text(program)), success))
    except NotNativeError as reason:
        return Translation(None, needs_scenic=str(reason))


def _translated(scenario: Any, tree: Any, success: SuccessRule) -> NativeProgram:
    """Return the translated statements of a program with the syntax ``tree``.

    Raises NotNativeError if a statement needs Scenic. Its message begins with the line of the statement.
    """
    _check_only_translatable_parts(scenario)
    translator = Translator(tree, scenario)
    endings, limits, records = [], [], []
    conditions = (*scenario.terminationConditions, *scenario.terminateSimulationConditions)
    # The lines of the conditions that end a run as passed.
    passing_lines = {condition.line for condition in conditions if str(condition) in success.endings}
    for statement_kind in ("TerminateWhen", "TerminateSimulationWhen"):
        for node in _statements(tree, statement_kind):
            with _errors_with_line_of(node):
                endings.append(_Ending(translator.condition(node.cond), is_pass=node.lineno in passing_lines))
    for node in _statements(tree, "TerminateAfter"):
        with _errors_with_line_of(node):
            if not translator.is_constant(node.duration.value):
                raise NotNativeError(shown(node.duration.value))
            limits.append(node.duration)
    for statement_kind, record_kind in RECORDS.items():
        for node in _statements(tree, statement_kind):
            with _errors_with_line_of(node):
                records.append(_translated_record(translator, scenario, node, record_kind))
    if len(endings) > MAX_STATEMENTS or len(records) > MAX_STATEMENTS:
        raise NotNativeError(f"more than {MAX_STATEMENTS} conditions or records")
    expressions = [ending.terms for ending in endings] + [record.terms for record in records]
    if any(len(terms) > MAX_TERMS for terms in expressions):
        raise NotNativeError(f"an expression of more than {MAX_TERMS} terms")
    # Scenic knows all statements of the program, but only those of the top level were translated here.
    lacks_endings = len(endings) != len(conditions)
    lacks_records = len(records) != len(_scenic_records(scenario))
    if lacks_endings or lacks_records or len(limits) > 1:
        raise NotNativeError("statements that do not stand at the top level")
    return NativeProgram(translator, endings, limits, records)


@contextlib.contextmanager
def _errors_with_line_of(node: Any) -> Iterator[None]:
    """Let a NotNativeError of the block begin with the line of the statement ``node``."""
    try:
        yield
    except NotNativeError as reason:
        raise NotNativeError(f"line {node.lineno}: {reason}") from None


def _translated_record(translator: Translator, scenario: Any, node: Any, kind: str) -> _Record:
    """Translate a `record` statement. Raises NotNativeError."""
    terms = [] if translator.is_constant(node.value) else translator.recorded(node.value)
    name = _record_name(scenario, node)
    if name == VERDICT and translator.is_position(node.value):
        raise NotNativeError(f"a position as `{VERDICT}`")
    return _Record(name=name, kind=kind, node=node.value, terms=terms)


def _check_only_translatable_parts(scenario: Any) -> None:
    """Raise NotNativeError, with its name, if the program has a part that carsim cannot evaluate."""
    dynamic = scenario.dynamicScenario
    if scenic_private.is_modular(dynamic) or scenic_private.has_compose(dynamic):
        raise NotNativeError("a modular scenario")
    if scenario.monitors:
        raise NotNativeError("monitors")
    if scenic_private.agents(dynamic):
        raise NotNativeError("behaviors")
    if any(requirement.proposition.has_temporal_operator for requirement in scenario.requirements):
        raise NotNativeError("a requirement on the run")


def _statements(tree: Any, kind: str) -> Iterator[Any]:
    """Yield the statements of a kind, such as "TerminateWhen", at the top level of a program's syntax tree."""
    return (node for node in tree.body if type(node).__name__ == kind)


def _scenic_records(scenario: Any) -> list[Any]:
    """Return Scenic's objects of all `record` statements of a program."""
    return [*scenario.recordedExprs, *scenario.recordedInitialExprs, *scenario.recordedFinalExprs]


def _record_name(scenario: Any, node: Any) -> str:
    """Return the name under which Scenic keeps a record: the name in the statement, or one that Scenic makes."""
    for record in _scenic_records(scenario):
        if record.line == node.lineno and node.name in (None, record.name):
            return str(record.name)
    raise AssertionError("Scenic knows each record of the program")


def _resolved(terms: Terms, sample: SampledValues) -> Terms:
    """Return the terms with those that depend on the sample replaced by their values in it."""
    resolved: Terms = []
    for term in terms:
        resolved += term.read(sample) if isinstance(term, PerSample) else [term]
    return resolved


def _record_of_scene(record: _Record, sample: SampledValues) -> dict[str, Any]:
    """Return a record as carsim reads it: its name, its kind, and either terms or a constant."""
    entry = {"name": record.name, "kind": record.kind}
    if record.terms:
        return {**entry, "value": _resolved(record.terms, sample)}
    # The record does not depend on the drive.
    return {**entry, "constant": to_json(sample.value(record.node), record.name)}


def _verdict(record: _Record, sample: SampledValues) -> Terms:
    """Return the terms of the condition that a record's value is true: a number is true if it is not 0."""
    if not record.terms:
        constant = to_json(sample.value(record.node), record.name)
        return [bool(constant)]
    terms = _resolved(record.terms, sample)
    return terms if is_condition(record.node) else [*terms, "abs", 0.0, ">"]
