"""A step of the assembly: folds that are closed, parts with their insertion paths, joins, and tools that are used.

Poses are those of the finished car (folded/model.py), as far as the folds are closed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

Vector = tuple[float, float, float]
# Fractions of folds' angles by piece and crease.
Folds = Mapping[str, Mapping[str, float]]


class PartKey(NamedTuple):
    """Identifies a copy of a piece, or a mount, whose ``copy`` is 0."""

    kind: Literal["piece", "mount"]
    name: str
    copy: int


@dataclass(frozen=True, slots=True)
class AddedPart:
    """What a step adds: a copy of a piece, a mount or a unit assembled outside the car; its insertion path ``way_mm``.

    The path is straight moves in the car's frame, in order, which end at its place. It is empty for a part that is bent,
    stuck on or laid out. ``body`` is that of the finished car. Of a screw, ``way_mm`` is the path of head and shank,
    ``nut_mm`` the path of its nut; ``passes`` are the parts that its shank passes through, from the head on.
    """

    kind: Literal["piece", "mount", "unit"]
    name: str
    copy: int
    body: str
    way_mm: tuple[Vector, ...] = ()
    nut_mm: tuple[Vector, ...] = ()
    passes: tuple[PartKey, ...] = ()


@dataclass(frozen=True, slots=True)
class ToolUse:
    """A tool, plug or finger used in a step: clearance ``index`` of mount ``name``, or of face ``name`` of ``piece``.

    A screwdriver is used when its screw is added.
    """

    name: str
    index: int
    piece: str = ""


@dataclass(frozen=True, slots=True)
class AssemblyStep:
    """One step. ``folds`` maps piece and crease to the fraction of its angle from this step on, 0 before it is named.

    ``joins`` are the numbers of the joins made in it. A step with a ``unit`` assembles that unit outside the car, once
    for each body named by its ``adds``; a later step adds the unit to the car. In a step of service, ``adds`` are the
    parts that are taken out and put back.
    """

    title: str
    folds: Folds
    adds: tuple[AddedPart, ...]
    joins: tuple[int, ...]
    tool_uses: tuple[ToolUse, ...] = ()
    unit: str = ""
