"""Folders of the package import one way only: from their own and from those above them in docs/overview.md's table."""

import ast
import re
from pathlib import Path

import foldcar

PACKAGE = Path(foldcar.__file__).parent
OVERVIEW = Path(__file__).resolve().parents[3] / "docs" / "overview.md"


def documented_rooms() -> list[str]:
    """The folders of the table under "Packages" in docs/overview.md, upstream first."""
    section = OVERVIEW.read_text(encoding="utf-8").partition("\n## Packages\n")[2].partition("\n## ")[0]
    return re.findall(r"^\|`([a-z_/]+)/`\|", section, re.MULTILINE)


def room_of(module: str) -> str:
    """The folder that a module, named by its path below the package, stands in; its own name at the top."""
    folder = (PACKAGE / module) if (PACKAGE / module).is_dir() else (PACKAGE / module).parent
    return folder.relative_to(PACKAGE).as_posix() if folder != PACKAGE else module


def imports_of(file: Path) -> set[str]:
    """The foldcar modules that a file imports anywhere, function bodies included, as paths below the package."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("foldcar."):
            names.add(node.module)
        elif isinstance(node, ast.Import):
            names.update(name.name for name in node.names if name.name.startswith("foldcar."))
        assert not (isinstance(node, ast.ImportFrom) and node.level), f"{file}: relative import"
    return {name.removeprefix("foldcar.").replace(".", "/") for name in names}


def edges() -> set[tuple[str, str]]:
    """(importing, imported) rooms of the package, those to the same room left out."""
    imports = set()
    for file in PACKAGE.rglob("*.py"):
        room = room_of(file.relative_to(PACKAGE).with_suffix("").as_posix())
        imports |= {(room, room_of(imported)) for imported in imports_of(file)}
    return {(a, b) for a, b in imports if a != b}


def test_the_overview_names_every_room() -> None:
    folders = {file.parent.relative_to(PACKAGE).as_posix() for file in PACKAGE.rglob("*.py")} - {"."}

    assert sorted(documented_rooms()) == sorted(folders)


def test_imports_go_one_way() -> None:
    # What stands at the top of the package is either for everybody, or imports everything.
    everybodys = ["version", "errors", "typed", "shown_text", "shown_console", "interrupts", "outputs", "installation"]
    everybodys += ["read_files", "source_imports", "system", "notebook_html"]
    order = [*everybodys, *documented_rooms(), "cli", "__main__", "__init__"]

    imports = edges()
    against = [f"{a} imports {b}" for a, b in sorted(imports) if order.index(b) > order.index(a)]

    assert len(imports) > 50
    assert against == []
