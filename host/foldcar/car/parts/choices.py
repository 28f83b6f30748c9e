"""The parts that a vehicle chooses: one of each kind, by name.

A choice is checked where it is read, so that everything downstream holds valid names. A type string names the choices
that are not the default ones, so that it says what a car is: ``W_B_W+tyre=none``.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

from foldcar.errors import FoldcarError
from foldcar.typed import did_you_mean

# Kind of part → its names; the data of a part are in KIND_NAME.json. Where the battery sits has none.
OPTIONS: dict[str, tuple[str, ...]] = {
    "film": ("0.127", "0.19", "0.25", "card_160", "card_300", "pp_0.5", "pp_0.8"),
    "horn": ("one_sided", "two_sided", "cross", "disc"),
    "tyre": ("none", "rubber_band", "silicone_band", "grip_tape", "shrink_tube"),
    "battery": ("4xaa_flat", "4xaa_square"),
    "battery_place": ("floor", "roof"),
}


class PartError(FoldcarError):
    """A kind or a name of a part that is not known. ``kind`` is the one whose name is at fault, or None."""

    def __init__(self, kind: str | None, message: str) -> None:
        super().__init__(f"{kind}: {message}" if kind else message)
        self.kind, self.message = kind, message


@dataclass(frozen=True, slots=True)
class PartChoices:
    """The names of the parts that a vehicle chooses, one of each kind (``OPTIONS`` lists them)."""

    film: str = "0.25"
    horn: str = "two_sided"
    tyre: str = "rubber_band"
    battery: str = "4xaa_square"
    battery_place: str = "floor"

    def changed(self, names: Mapping[str, str]) -> "PartChoices":
        """These choices with other names by kind; PartError, which lists the known ones, for an unknown one."""
        for kind, name in names.items():
            if kind not in OPTIONS:
                close = did_you_mean(kind, list(OPTIONS))
                raise PartError(None, f'unknown kind of part "{kind}"; known: {", ".join(OPTIONS)}{close}')
            if name not in OPTIONS[kind]:
                close = did_you_mean(name, list(OPTIONS[kind]))
                raise PartError(kind, f'unknown name "{name}"; known: {", ".join(OPTIONS[kind])}{close}')
        return replace(self, **names)

    @property
    def suffix(self) -> str:
        """What follows the modules in a type string: every name that is not the default one, as ``+tyre=none``."""
        usual = asdict(DEFAULT_CHOICES)
        return "".join(f"+{kind}={name}" for kind, name in asdict(self).items() if name != usual[kind])


DEFAULT_CHOICES = PartChoices()


def split_type(type_string: str) -> tuple[str, PartChoices]:
    """The modules (``W_B_W``) and the parts of a type string; PartError for parts that are not known."""
    modules, *named = type_string.split("+")
    names: dict[str, str] = {}
    for one in named:
        kind, equals, name = one.partition("=")
        if not equals or kind in names:
            raise PartError(None, f'"{type_string}": "+{one}" is no +KIND=NAME of a part, as in W_B_W+tyre=none')
        names[kind] = name
    try:
        return modules, DEFAULT_CHOICES.changed(names)
    except PartError as error:
        raise PartError(None, f'"{type_string}": {error}') from error
