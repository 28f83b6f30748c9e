"""Translates a program's statements about its runs for carsim, so that Scenic need not run beside it.

Input: a compiled program, then its sampled scenes. Output: the member `program` of a scene (docs/carsim.md). Translated
are `terminate when`, `terminate after` and `record` of the top level.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from foldcar.scenes import scenic_private
from foldcar.scenes.native_expressions import NotNativeError, PerSample, Translator, is_truth
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
        records: list[dict[str, Any]] = []
        verdict: Any = None
        for record in self._records:
            if record.terms:
                value = _resolved(record.terms, sample)
                records.append({"name": record.name, "kind": record.kind, "value": value})
                as_verdict = _as_truth(record.node, value)
            else:
                # The record does not depend on the drive.
                constant = to_json(sample.value(record.node), record.name)
                records.append({"name": record.name, "kind": record.kind, "constant": constant})
                as_verdict = [bool(constant)]
            is_verdict = record.name == VERDICT and record.kind != "initial"
            if is_verdict:
                verdict = as_verdict
        return {
            "endings": endings,
            "time_limit_s": self._time_limit_s(sample, step_s),
            "verdict": verdict,
            "records": records,
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


def native_program(scenario: Any, program: Path, success: SuccessRule) -> tuple[NativeProgram | None, str]:
    """Return the translated program and ""; or None and the part, with its line, that needs Scenic beside carsim."""
    tree = parsed_program(read_text(program))
    # The line that is being translated, 0 for the whole program, for the reason.
    line = 0
    try:
        _check_only_translatable_parts(scenario)
        translator = Translator(tree, scenario)
        endings, limits, records = [], [], []
        conditions = (*scenario.terminationConditions, *scenario.terminateSimulationConditions)
        passing_lines = {condition.line for condition in conditions if str(condition) in success.endings}
        for statement_kind in ("TerminateWhen", "TerminateSimulationWhen"):
            for node in _statements(tree, statement_kind):
                line = node.lineno
                endings.append(_Ending(translator.truth(node.cond), is_pass=line in passing_lines))
        for node in _statements(tree, "TerminateAfter"):
            line = node.lineno
            if not translator.is_constant(node.duration.value):
                raise NotNativeError(shown(node.duration.value))
            limits.append(node.duration)
        for statement_kind, record_kind in RECORDS.items():
            for node in _statements(tree, statement_kind):
                line = node.lineno
                is_constant = translator.is_constant(node.value)
                terms = [] if is_constant else translator.recorded(node.value)
                record_name = _record_name(scenario, node)
                if record_name == VERDICT and translator.is_position(node.value):
                    raise NotNativeError(f"a position as `{VERDICT}`")
                records.append(_Record(name=record_name, kind=record_kind, node=node.value, terms=terms))
        expressions = (*scenario.recordedExprs, *scenario.recordedInitialExprs, *scenario.recordedFinalExprs)
        line = 0
        if len(endings) > MAX_STATEMENTS or len(records) > MAX_STATEMENTS:
            raise NotNativeError(f"more than {MAX_STATEMENTS} conditions or records")
        expressions_terms = [ending.terms for ending in endings] + [record.terms for record in records]
        if any(len(terms) > MAX_TERMS for terms in expressions_terms):
            raise NotNativeError(f"an expression of more than {MAX_TERMS} terms")
        # Scenic knows all statements; the syntax tree's top level has fewer if some stand in a block.
        if len(endings) != len(conditions) or len(records) != len(expressions) or len(limits) > 1:
            raise NotNativeError("statements that do not stand at the top level")
    except NotNativeError as reason:
        if line:
            return None, f"line {line}: {reason}"
        return None, str(reason)
    return NativeProgram(translator, endings, limits, records), ""


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


def _record_name(scenario: Any, node: Any) -> str:
    """Return the name under which Scenic keeps a record: the name in the statement, or one that Scenic makes."""
    records = (*scenario.recordedExprs, *scenario.recordedInitialExprs, *scenario.recordedFinalExprs)
    matching = (record for record in records if record.line == node.lineno and node.name in (None, record.name))
    return str(next(matching).name)


def _resolved(terms: Terms, sample: SampledValues) -> Terms:
    """Return the terms with those that depend on the sample replaced by their values in it."""
    resolved: Terms = []
    for term in terms:
        resolved += term.read(sample) if isinstance(term, PerSample) else [term]
    return resolved


def _as_truth(node: Any, terms: Terms) -> Terms:
    """Return the terms of a boolean: for an expression that is a number, whether it is not 0."""
    return terms if is_truth(node) else [*terms, "abs", 0.0, ">"]
