"""What `foldcar sweep --until` says of designs at its end: lines for readers, objects for `--json`."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from foldcar.analysis.stopping import StoppingRule
    from foldcar.study.experiments import Experiment
    from foldcar.study.stopping import DesignState

# Undecided designs that are named.
SHOWN = 12


def stopping_lines(experiment: "Experiment", rule: "StoppingRule", states: "Sequence[DesignState]") -> Iterator[str]:
    """How many designs of the experiment are decided, what that means, and which are not."""
    # Here, because it imports numpy, which other commands do without.
    from foldcar.analysis.stopping import LEAST_CHANCE

    mine = [state for state in states if state.experiment == experiment.id]
    undecided = [state for state in mine if not state.decided]
    rest = f", {len(undecided)} undecided" if undecided else ""
    made, most = sum(state.runs for state in mine), len(mine) * experiment.environments
    head = f"experiment {experiment.id}: {len(mine) - len(undecided)} of {len(mine)} designs decided"
    rejected = sum(state.rejected for state in mine)
    yield f"{head}{rest}; {made} of at most {most} runs{f', {rejected} rejected' if rejected else ''}"
    yield f"  decided: {rule.text}; that holds for each design by itself, whenever its runs stop"
    if undecided:
        varied = experiment.family.varied
        names = [_name(state, list(varied)) for state in undecided[:SHOWN]]
        head = f"{next(iter(varied))} " if len(varied) == 1 else ""
        more = f" and {len(undecided) - SHOWN} more" if len(undecided) > SHOWN else ""
        yield f"  undecided: {head}{', '.join(names)}{more}; --environments N allows more runs"
        left = sum(state.runs < experiment.environments for state in undecided)
        if left:
            chance = f"with a chance below {100 * LEAST_CHANCE:g} %"
            yield f"  {left} of these were left early: {experiment.environments} environments would decide them {chance}"


def state_objects(states: "Sequence[DesignState]") -> list[dict[str, Any]]:
    """The designs with their intervals."""
    return [asdict(state) for state in states]


def _name(state: "DesignState", varied: Sequence[str]) -> str:
    if len(varied) == 1:
        return f"{state.design[varied[0]]:g}"
    return " ".join(f"{name}={state.design[name]:g}" for name in varied) or "the only design"
