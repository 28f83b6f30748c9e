"""A step of the assembly: which folds are closed, what goes in on which way, what is joined, which tools must reach.

Everything stands at its pose in the finished car (folded/model.py), as far as the folds are closed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Vector = tuple[float, float, float]
# A piece or a mount: its kind, its name and which copy.
Thing = tuple[str, str, int]
# Fractions of folds' angles by piece and crease.
Folds = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, slots=True)
class Added:
    """A copy of a piece, a mount (by its name) or a unit that was put together apart, and its way into the assembly.

    ``way_mm`` are straight moves in the car's frame, in order; their sum leads to its place. No moves: it does not
    come in as a whole, but is bent, stuck on or laid out. ``body`` is that of the finished car. Of a screw, ``way_mm`` is
    that of head and shank, ``nut_mm`` that of its nut; ``passes`` are the things that its shank passes, from the head on.
    """

    kind: Literal["piece", "mount", "unit"]
    name: str
    copy: int
    body: str
    way_mm: tuple[Vector, ...] = ()
    nut_mm: tuple[Vector, ...] = ()
    passes: tuple[Thing, ...] = ()


@dataclass(frozen=True, slots=True)
class Reach:
    """A tool, plug or finger used in a step: the access ``index`` of a mount, or of a face of ``piece``.

    A driver comes with its screw.
    """

    name: str
    index: int
    piece: str = ""


@dataclass(frozen=True, slots=True)
class AssemblyStep:
    """One step. ``folds`` maps piece and crease to the fraction of its angle from this step on, 0 before it is named.

    ``joins`` are the numbers of the joins made in it. A step with a ``unit`` puts that unit together apart from the
    car, once for each body named by its ``adds``; a later step adds the unit to the car. In a step of service, ``adds``
    are the things that are taken out and put back.
    """

    title: str
    folds: Folds
    adds: tuple[Added, ...]
    joins: tuple[int, ...]
    reaches: tuple[Reach, ...] = ()
    unit: str = ""
