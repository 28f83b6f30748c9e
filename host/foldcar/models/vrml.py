"""Webots' scene language as text: nodes with fields, as in its world and PROTO files.

A field's value is a number, a truth, a text, a Node, None, a name taken over from the PROTO (``Is``), a
Vector, or a list of any of these.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

HEADER = "#VRML_SIM R2025a utf8"


@dataclass(frozen=True)
class Node:
    """``name { field value … }``"""

    name: str
    fields: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Is:
    """A field of the PROTO."""

    name: str


class Vector(tuple[float, ...]):
    """Numbers that are one value: a place, a direction, a turn."""


def vector(*values: float) -> Vector:
    """A Vector of the numbers."""
    return Vector(values)


def node_text(node: Node, depth: int = 0) -> str:
    """The node, indented by two spaces a level."""
    inner = "  " * (depth + 1)
    lines = [f"{inner}{name} {_value(value, depth + 1)}" for name, value in node.fields.items()]
    return "\n".join([f"{node.name} {{", *lines, "  " * depth + "}"])


def _value(value: Any, depth: int) -> str:
    if isinstance(value, Node):
        return node_text(value, depth)
    if isinstance(value, Is):
        return f"IS {value.name}"
    if isinstance(value, Vector):
        return " ".join(_number(number) for number in value)
    if value is None:
        return "NULL"
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, int | float):
        return _number(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return _list(value, depth)


def _list(values: Sequence[Any], depth: int) -> str:
    if not values:
        return "[ ]"
    if not isinstance(values[0], Node):
        separator = ", " if isinstance(values[0], Vector) else " "
        return f"[ {separator.join(_value(value, depth) for value in values)} ]"
    inner = "  " * (depth + 1)
    lines = [inner + _value(value, depth + 1) for value in values]
    return "\n".join(["[", *lines, "  " * depth + "]"])


def _number(number: float) -> str:
    return f"{number + 0.0:.9g}"
