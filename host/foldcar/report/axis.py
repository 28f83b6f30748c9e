"""The axis of a design parameter: its label from its name, positions to scale for numbers, in a row for texts.

Also how values, shares and intervals are written in tables.
"""

from collections.abc import Sequence

import numpy
from matplotlib.axes import Axes

from foldcar.report.series import Extent, Tally, Value
from foldcar.report.trial_series import TrialTally

UNITS = ("mm", "m", "deg", "rad", "kg", "g", "s", "v")


def parameter_label(parameter: str) -> str:
    """``wheel_radius_mm`` → ``wheel radius (mm)``."""
    name, _, unit = parameter.rpartition("_")
    if name and unit in UNITS:
        return f"{name} ({unit.upper() if unit == 'v' else unit})".replace("_", " ")
    return parameter.replace("_", " ")


def value_text(value: Value) -> str:
    """A number without trailing zeros (95, 12.5), or the text itself."""
    return value if isinstance(value, str) else f"{value:g}"


def extent_text(extent: Extent | None) -> str:
    """Mean and range as ``1.25 (0.9 to 1.6)``; a dash if nothing was recorded."""
    return f"{extent.mean:.4g} ({extent.lowest:.4g} to {extent.highest:.4g})" if extent else "–"


def success_text(tally: Tally | TrialTally) -> str:
    """The success in per cent with one decimal; ``undefined`` if it is that, a dash if no run counts."""
    if not tally.counted:
        return "–"
    return "undefined" if tally.success is None else f"{100 * tally.success:.1f}"


def interval_text(interval: tuple[float, float] | None) -> str:
    """An interval of shares in per cent, ``12.1 – 45.0``; a dash without one."""
    return "–" if interval is None else f"{100 * interval[0]:.1f} – {100 * interval[1]:.1f}"


class ParameterAxis:
    """Positions of a parameter's values along an axis: numbers to scale, texts at equal distances."""

    def __init__(self, values: Sequence[Value]) -> None:
        self.values = list(values)
        self.to_scale = all(not isinstance(value, str) for value in values)
        places = [float(value) for value in values] if self.to_scale else range(len(values))
        self._place = dict(zip(values, places, strict=True))
        gaps = numpy.diff(sorted(self._place.values()))
        self.bar_width = 0.8 * float(gaps.min()) if len(gaps) else 0.8

    def place(self, value: Value) -> float:
        """The coordinate of a value."""
        return self._place[value]

    def label(self, axes: Axes, parameter: str) -> None:
        """Label the axis, with a tick for each value if there are few."""
        axes.set_xlabel(parameter_label(parameter))
        if not self.to_scale or len(self.values) <= 12:
            axes.set_xticks(list(self._place.values()), [value_text(value) for value in self.values])
        margin = self.bar_width * 0.8
        axes.set_xlim(min(self._place.values()) - margin, max(self._place.values()) + margin)
