"""The numbers of the parts' data files: quantities with tolerance and source, boxes and holes on a part.

Lengths are in millimetres, as on data sheets, everything else in SI units unless its name says otherwise.
"""

from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict


class Data(BaseModel):
    """The base of everything in a data file; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Quantity(Data):
    """A number, its tolerance (half-width of its expected range) and its source."""

    value: float
    tolerance: float
    source: str

    @property
    def min_value(self) -> float:
        """The smallest expected value."""
        return self.value - self.tolerance

    @property
    def max_value(self) -> float:
        """The largest expected value."""
        return self.value + self.tolerance


class Box(Data):
    """A box on a part: its centre and size along x, y, z in the part's frame; the tolerance is that of each number."""

    at_mm: tuple[float, float, float]
    size_mm: tuple[float, float, float]
    tolerance: float
    source: str


class Places(Data):
    """Points (x, y) of a part's frame; the tolerance is that of each number."""

    at_mm: tuple[tuple[float, float], ...]
    tolerance: float
    source: str


class Holes(Places):
    """Equal round holes at these points."""

    diameter_mm: float


class PartData(BaseModel):
    """The base of all parts. The data file has the quantities by name; the class declares all other fields."""

    model_config = ConfigDict(extra="allow", frozen=True)
    __pydantic_extra__: dict[str, Quantity]

    name: str

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Quantity: ...


class Bought(PartData):
    """A part with a price; parts that come with another one cost nothing."""

    cost_usd: Quantity


class BoxPart(Bought):
    """A part modelled as a box: length along the car unless turned, width across, height up."""

    mass_kg: Quantity
    length_mm: Quantity
    width_mm: Quantity
    height_mm: Quantity

    @property
    def size_mm(self) -> tuple[float, float, float]:
        """Length, width and height."""
        return self.length_mm.value, self.width_mm.value, self.height_mm.value
