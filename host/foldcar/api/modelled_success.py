"""Success as a smooth function of design parameters, with the names by which Python users know them."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.api.arguments import checked_confidence, column_named
from foldcar.errors import FoldcarError
from foldcar.shown_text import shown_value
from foldcar.statistics.effects import Standardised


@dataclass(frozen=True)
class ModelledSuccess:
    """Success as a function of ``parameters`` (columns of tables), averaged over the other parameters that vary."""

    parameters: tuple[str, ...]
    model: Standardised

    def __repr__(self) -> str:
        return f"success_model({', '.join(map(repr, self.parameters))})"

    def rates(self, values: ArrayLike, confidence: float = 0.95) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Return the success rates of m designs and the ends of their bands: (rate, low, high), each (m,) and 0 to 1.

        ``values`` has a row for each design, with the values of the model's parameters in their order. It may also be a
        pandas table whose columns have the parameters' names. Raises FoldcarError if it is neither, or if a value is
        outside the range of the designs that were simulated.
        """
        level = checked_confidence(confidence)
        table: Any = values
        if hasattr(table, "columns"):
            table = table[self._columns(table.columns)]
        try:
            rows = numpy.asarray(table, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise FoldcarError(f"rates: {shown_value(values)} is not a row of numbers for each design") from None
        return self.model.rates(rows, level)

    def _columns(self, names: Iterable[Any]) -> list[Any]:
        """Return which columns of a table are the parameters of the model, in the order of the parameters.

        ``names`` are all columns of the table, which may have columns besides the parameters. Raises FoldcarError if a
        parameter is missing. Its message begins with "rates", the method that the user has called.
        """
        columns: dict[str, Any] = {}
        for name in names:
            # A column that is not a parameter raises an error and is left out.
            with suppress(FoldcarError):
                parameter = column_named(name, self.parameters, "rates")
                if parameter not in columns:
                    columns[parameter] = name
        # A short name such as "length" may fit several columns. A column with the whole name of a parameter always wins.
        columns.update({name: name for name in names if name in self.parameters})
        missing = [parameter for parameter in self.parameters if parameter not in columns]
        if missing:
            raise FoldcarError(f"rates: the table has no column {missing[0]}")
        return [columns[parameter] for parameter in self.parameters]
