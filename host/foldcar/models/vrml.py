"""Writes VRML as Webots' world and PROTO files use it: nodes with fields.

A field's value is a number, a boolean, a string, a Node, None, the value of a PROTO's field (``Is``), a Vector, or a
list of these.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

# The oldest version with these nodes; later ones read its files, older ones refuse them.
HEADER = "#VRML_SIM R2023b utf8"


@dataclass(frozen=True)
class Node:
    """A node: ``name { field value … }``."""

    name: str
    fields: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Is:
    """A reference to a field of the PROTO."""

    name: str


class Vector(tuple[float, ...]):
    """Numbers that are one value: a position, a direction or a rotation."""


def vector(*values: float) -> Vector:
    """A Vector of these numbers."""
    return Vector(values)


def node_text(node: Node, depth: int = 0) -> str:
    """The node as text, indented by two spaces per level."""
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
