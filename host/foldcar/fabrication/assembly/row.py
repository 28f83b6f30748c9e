"""A row of the bill of materials."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the bill of materials: a quantity of a part, with its total mass and cost; the cost is None if it
    is unknown.

    ``product`` is the number of a maker or a standard; it is "" where the part of any maker will do. ``search`` is
    what to search shops for.
    """

    name: str
    quantity: float
    unit: str
    mass_kg: float
    cost_usd: float | None
    note: str = ""
    product: str = ""
    search: str = ""

    @property
    def amount(self) -> str:
        """The quantity as text, with its unit."""
        decimals = {"m²": 4, "m": 2}
        return f"{self.quantity:.{decimals[self.unit]}f} {self.unit}" if self.unit else f"{self.quantity:g}"

    @property
    def dollars(self) -> str:
        """The cost as text, "" if unknown."""
        return "" if self.cost_usd is None else f"{self.cost_usd:.2f}"
