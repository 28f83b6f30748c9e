"""docs/compiler.md says what the code does: its parameter table, its example, its component names."""

import re
from importlib import import_module
from pathlib import Path

from foldcar.car.design import parameters
from foldcar.car.parts.catalogue import catalogue

DOC = Path(__file__).parents[2] / "docs" / "compiler.md"


def test_the_parameter_table_is_that_of_the_components() -> None:
    rows = {
        f"|`{key}`|{' '.join(sorted(p.modules))}|{p.declared.unit}|{p.declared.default_with(catalogue()):g}"
        f"|{p.declared.least_with(catalogue()):g}|{p.declared.maximum:g}|{p.declared.help}|"
        for key, p in parameters().items()
    }

    written = set(re.findall(r"^\|`[\w.]+`\|[A-Z ]+\|(?:mm|deg)\|.*$", DOC.read_text(encoding="utf-8"), re.M))

    assert written == rows


def test_the_components_are_where_it_says() -> None:
    found = re.findall(r"^\|`(\w+)`(?: \w)?\|`(\w+)\.py`\|", DOC.read_text(encoding="utf-8"), re.M)

    assert len(found) == 5
    for name, module in found:
        assert hasattr(import_module(f"foldcar.car.components.{module}"), name), name
