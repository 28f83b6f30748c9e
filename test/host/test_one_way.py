"""Nothing imports against the stream: design → body; scenes; runs → store → export, report; commands."""

import ast
from pathlib import Path

import foldcar

PACKAGE = Path(foldcar.__file__).parent

# Upstream first. A module may import from its own group and from any group above it in this list.
STREAM = (
    {
        "errors",
        "results",
        "trial_records",
        "atomic_file",
        "atomic_folder",
        "time_limit",
        "recorded_values",
        "page_template",
        "mavlink_dialect",
    },
    {"parts", "mass"},
    {"sheet"},
    {"compiler", "design"},
    {"body", "controller", "variation"},
    {"car_file"},
    {"listing", "family", "experiments"},
    {"scene_reading", "scene_terrain", "scene_checks"},
    {"program_globals", "conditioning", "scenic_program", "scene_json", "scenes", "fingerprint"},
    {"carsim", "carsim_step"},
    {"link"},
    {"models"},
    {"scenic_ego", "scenic_runner", "scenic_simulator", "scenic_worker"},
    {"store_info", "store_schema", "store_connection", "store", "store_writer", "trial_writer"},
    {"environments", "chunks", "sweep"},
    {"trials"},
    {"export", "export_trials", "figures", "report"},
    {"patterns"},
    {"assembly"},
    {"drawing_files", "assembled_files"},
    {"making"},
    {"crosscheck"},
    {"commands"},
    {"cli", "__init__"},
)


def group_of(name: str) -> int:
    """Index in the stream of a module or of the folder it is in."""
    top = name.split(".")[0]
    return next(index for index, group in enumerate(STREAM) if top in group)


def imports_of(file: Path) -> set[str]:
    """The foldcar modules that a file imports anywhere, function bodies included."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("foldcar."):
            names.add(node.module.removeprefix("foldcar."))
        elif isinstance(node, ast.Import):
            names.update(n.name.removeprefix("foldcar.") for n in node.names if n.name.startswith("foldcar."))
        assert not (isinstance(node, ast.ImportFrom) and node.level), f"{file}: relative import"
    return names


def test_imports_go_one_way() -> None:
    edges = {
        (".".join(file.relative_to(PACKAGE).with_suffix("").parts), imported)
        for file in PACKAGE.rglob("*.py")
        for imported in imports_of(file)
    }

    against = [
        f"{name} imports {imported}" for name, imported in edges if group_of(imported) > group_of(name)
    ]

    assert len(edges) > 50
    assert against == []
