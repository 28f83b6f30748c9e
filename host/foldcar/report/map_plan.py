"""Which two parameters a map of success shows, and what the others are: the plan of its panels.

Input: a table of designs. Output: panels, each with its designs and a smooth model of their success.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from foldcar.analysis.gaussian_process import SuccessModel, success_model
from foldcar.errors import FoldcarError
from foldcar.report.axis import parameter_label, value_text
from foldcar.report.design_table import DesignTable, assigned, spread

MOST_PANELS = 4
# Points of a model's surface along each axis.
FINE = 81


@dataclass(frozen=True)
class Panel:
    """Success over ``x`` and ``y``, the parameters of ``table``; the others have the values ``fixed``.

    ``y`` is None where no other parameter varies.
    """

    x: str
    y: str | None
    fixed: Mapping[str, float]
    table: DesignTable

    @cached_property
    def model(self) -> SuccessModel | None:
        """Success as a smooth function of x, or of (x, y); None if designs or runs are too few for one."""
        if self.table.single:
            return None
        order = [self.table.names.index(name) for name in (self.x, self.y) if name is not None]
        parameters = numpy.array([[values[at] for at in order] for values in self.table.cells], dtype=float)
        counts = list(self.table.cells.values())
        try:
            # Matrices this small take many times as long when BLAS shares them among threads.
            with threadpool_limits(1):
                return success_model(parameters, [one.passed for one in counts], [one.runs for one in counts])
        except FoldcarError:
            return None

    @cached_property
    def surface(self) -> tuple[NDArray[Any], ...] | None:
        """The model between the designs: x (n,), y (n,), rate and its band (low, high), each (n, n) and 0 to 1."""
        if self.model is None:
            return None
        x, y = (numpy.linspace(low, low + span, FINE) for low, span in zip(self.model.low, self.model.span, strict=True))
        across, up = numpy.meshgrid(x, y)
        with threadpool_limits(1):
            rates = self.model.rates(numpy.column_stack([across.ravel(), up.ravel()]))
        return x, y, *(values.reshape(across.shape) for values in rates)

    @property
    def fixed_text(self) -> str:
        """``tail length 80 mm, height 50 mm``; nothing if no other parameter varies."""
        return ", ".join(assigned(name, value) for name, value in self.fixed.items())


@dataclass(frozen=True)
class MapPlan:
    """A map: its axes, its panels, and what was left out, in words (empty if nothing was)."""

    x: str
    y: str
    panels: tuple[Panel, ...]
    choice: str

    @property
    def middle(self) -> Panel:
        """The panel whose others are nearest to the middle of their values."""
        return self.panels[(len(self.panels) - 1) // 2]


def plan_map(table: DesignTable, x: str | None = None) -> MapPlan | None:
    """The map over ``x`` and the other parameter that success depends on most, or over the two that do.

    One further parameter has up to MOST_PANELS of its values, at even distances, a panel each. Of several, the two that
    success depends on most are at their lowest and highest values, the rest at their middle one. None without two
    parameters of at least two values.
    """
    varied = [name for name in table.names if len(table.values(name)) > 1]
    if len(varied) < 2 or x not in (None, *varied):
        return None
    # A search may have run one value only of a parameter that it could vary.
    table = table.where({name: table.values(name)[0] for name in table.names if name not in varied})
    ranked = sorted((name for name in varied if name != x), key=lambda name: -table.effect(name))
    axes = [x, *ranked][:2] if x is not None else sorted(ranked[:2], key=lambda name: -len(table.values(name)))
    others = [name for name in ranked if name not in axes]
    chosen = {name: _chosen(table.values(name), at, len(others)) for at, name in enumerate(others)}
    panels = []
    for values in product(*chosen.values()):
        fixed = dict(zip(others, values, strict=True))
        designs = table.where(fixed)
        if designs.cells:
            panels.append(Panel(axes[0], axes[1], fixed, designs))
    if not panels:
        return None
    return MapPlan(axes[0], axes[1], tuple(panels), _choice(table, varied, chosen, x))


def _chosen(values: list[float], rank: int, others: int) -> list[float]:
    if others == 1:
        return spread(values, MOST_PANELS)
    return [values[0], values[-1]] if rank < 2 else [values[(len(values) - 1) // 2]]


def _choice(table: DesignTable, varied: list[str], chosen: Mapping[str, list[float]], x: str | None) -> str:
    if not chosen:
        return ""
    count = "the one" if x is not None else "the two"
    shown = "; ".join(
        f"{parameter_label(name)} {', '.join(map(value_text, values))}"
        + ("" if len(values) == len(table.values(name)) else f" of {len(table.values(name))} values")
        for name, values in chosen.items()
    )
    return (
        f"{len(varied)} parameters vary; the axes are {count} that success depends on most"
        f"{', beside ' + parameter_label(x) if x is not None else ''}. The others are fixed: {shown}."
    )
