"""What `foldcar run` prints of an answer and of a variation: lines of name and value, or an object."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from foldcar.simulation import results


def answer_lines(answer: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Outcome, metrics and recorded values; for a failed run its error."""
    yield "outcome", results.outcome_of(answer)
    if "error" in answer:
        yield "message", answer["error"]
        return
    for name in results.NUMBERS:
        yield name, _value_text(answer[name])
    for name, recorded in answer.get("recorded", {}).items():
        yield f"recorded {name}", _recorded_text(recorded["kind"], recorded["value"])


def answer_object(answer: Mapping[str, Any]) -> dict[str, Any]:
    """Outcome, message of a failed run, metrics by name, and recorded values; numbers of a failed run are None."""
    return {
        "outcome": results.outcome_of(answer),
        "message": answer.get("error"),
        "metrics": {name: answer.get(name) for name in results.NUMBERS},
        "recorded": answer.get("recorded", {}),
    }


def variation_text(variation: Mapping[str, Any]) -> str:
    """The variation with three digits of each number: ``supply_v=-0.0931 servo_speed=0.0214,-0.0113,…``."""
    return " ".join(
        f"{name}={','.join(f'{v:.3g}' for v in value) if isinstance(value, list) else format(value, '.3g')}"
        for name, value in variation.items()
    )


def _recorded_text(kind: str, value: Any) -> str:
    """The value; for a series its length and its last value."""
    if kind == "initial":
        return f"{_value_text(value)} at the start"
    if kind == "final":
        return _value_text(value)
    if not value:
        return "series of 0"
    t_s, last = value[-1]
    return f"series of {len(value)}, {_value_text(last)} at {t_s:.3f} s"


def _value_text(value: Any) -> str:
    """A number with three decimals, a list of values, "-" for null; texts and booleans as JSON."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.3f}"
    if isinstance(value, list):
        return f"[{', '.join(map(_value_text, value))}]"
    return json.dumps(value)
