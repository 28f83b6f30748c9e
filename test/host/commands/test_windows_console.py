"""Keys in Windows' console, whose module `msvcrt` is played here: a person types a script of keys."""

import sys
from collections.abc import Iterator
from types import ModuleType

import pytest

from foldcar import system
from foldcar.system import TypedInput


class Console(ModuleType):
    """Has the functions of `msvcrt` that foldcar calls; ``keys`` are pressed and not read yet."""

    def __init__(self, keys: str) -> None:
        super().__init__("msvcrt")
        self.keys = keys

    def kbhit(self) -> bool:
        return bool(self.keys)

    def getwch(self) -> str:
        key, self.keys = self.keys[0], self.keys[1:]
        return key


@pytest.fixture
def console(monkeypatch: pytest.MonkeyPatch) -> Iterator[Console]:
    played = Console("")
    monkeypatch.setitem(sys.modules, "msvcrt", played)
    monkeypatch.setattr(system, "CAN_SELECT_FILES", False)
    monkeypatch.setattr(system.os, "isatty", lambda _: True)
    yield played


@pytest.mark.parametrize(
    ("typed", "key"), [("", None), ("p", "p"), ("ps", "s"), ("\xe0H", None), ("x\x00;", "x"), ("p\r", "p")]
)
def test_a_key_counts_without_enter_and_arrows_do_not(console: Console, typed: str, key: str | None) -> None:
    console.keys = "of before"
    with TypedInput().keys() as pressed:
        assert pressed() is None
        console.keys = typed
        assert pressed() == key
        console.keys = "left over"

    assert console.keys == ""


def test_ctrl_c_ends_as_on_linux(console: Console) -> None:
    with pytest.raises(KeyboardInterrupt), TypedInput().keys() as pressed:
        console.keys = "\x03"
        pressed()


def test_a_line_is_read_once_its_first_key_is_pressed(console: Console, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = iter([b"11\r\n"])
    monkeypatch.setattr(system.os, "read", lambda *_: next(lines))
    typed = TypedInput()

    assert typed.read(0.03) is None
    console.keys = "1"
    assert typed.read(0.03) == b"11\r\n"
