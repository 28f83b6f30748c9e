"""The value of one component parameter, and the error of a component that cannot be made.

A slot gets its value from the component itself, from a parent or from a rule; two sources that disagree are an error
that names both.
"""

from foldcar.car.compiler.parameter import Parameter
from foldcar.errors import FoldcarError

# Numbers that differ by rounding only.
SAME = 1e-9


class ComponentError(FoldcarError):
    """A component that cannot be made. ``slot`` is the parameter at fault, if it is one."""

    def __init__(self, path: str, message: str, slot: "Slot | None" = None) -> None:
        super().__init__(f"{path}: {message}" if path else message)
        self.message = message
        self.slot = slot


class Slot:
    """The place of one parameter's value; places that were united share it."""

    def __init__(self, parameter: Parameter, path: str) -> None:
        self.parameter, self.path = parameter, path
        self._value: float | None = None
        self._source = ""
        self._same: Slot | None = None

    @property
    def head(self) -> "Slot":
        """The slot that holds the value of all that were united with this one."""
        return self if self._same is None else self._same.head

    def unite(self, other: "Slot") -> None:
        """From now on both have one value, by default this one's."""
        mine, others = self.head, other.head
        if mine is others:
            return
        others._same = mine

    def assign(self, value: float, origin: str = "") -> None:
        """ComponentError if the slot, or one that was united with it, has another value already."""
        head = self.head
        if head._value is not None and abs(head._value - value) > SAME:
            there = f"{head._value:g} at {head._source}"
            raise ComponentError(self.path, f"{value:g} here{origin}, but {there}; they must be equal", self)
        head._value, head._source = value, f"{self.path}{origin}"

    def read(self) -> float:
        """The value, or the default; ComponentError outside the limits of this slot's own parameter."""
        head = self.head
        if head._value is None:
            head._value, head._source = head.parameter.default_value, f"{head.path} (its default)"
        complaint = self.parameter.complaint(head._value)
        if complaint:
            raise ComponentError(self.path, complaint, self)
        return head._value
