"""The value of one component parameter, and the error of a component that cannot be made.

A slot gets its value from the component itself, from a parent or from a constraint; two sources that disagree are an
error that names both.
"""

from foldcar.car.compiler.parameter import Parameter
from foldcar.car.parts.catalogue import Catalogue
from foldcar.errors import FoldcarError

# Values that differ by less than this, a rounding error, are equal.
SAME = 1e-9


class ComponentError(FoldcarError):
    """A component that cannot be made. ``slot`` is the slot of the parameter at fault, or None."""

    def __init__(self, path: str, message: str, slot: "Slot | None" = None) -> None:
        super().__init__(f"{path}: {message}" if path else message)
        self.message = message
        self.slot = slot


class Slot:
    """The variable that holds one parameter's value; united slots share one value."""

    def __init__(self, parameter: Parameter, path: str, parts: Catalogue) -> None:
        self.parameter, self.path, self.parts = parameter, path, parts
        self._value: float | None = None
        self._source = ""
        self._same: Slot | None = None

    @property
    def head(self) -> "Slot":
        """The slot that holds the common value of all slots united with this one."""
        return self if self._same is None else self._same.head

    def unite(self, other: "Slot") -> None:
        """Let both slots share one value; its default is that of this slot's parameter."""
        mine, others = self.head, other.head
        if mine is others:
            return
        others._same = mine

    def assign(self, value: float, origin: str = "") -> None:
        """Set the value; ``origin`` says in messages where it comes from.

        ComponentError if this slot, or one united with it, has another value already.
        """
        head = self.head
        if head._value is not None and abs(head._value - value) > SAME:
            there = f"{head._value:g} at {head._source}"
            raise ComponentError(self.path, f"{value:g} here{origin}, but {there}; they must be equal", self)
        head._value, head._source = value, f"{self.path}{origin}"

    def read(self) -> float:
        """The value, or the default if none was assigned; ComponentError outside the limits of this slot's parameter."""
        head = self.head
        if head._value is None:
            head._value, head._source = head.parameter.default_with(head.parts), f"{head.path} (its default)"
        complaint = self.parameter.complaint(head._value, self.parts)
        if complaint:
            raise ComponentError(self.path, complaint, self)
        return head._value
