"""Loads the template of an HTML page, and what goes into its scripts.

Input: a package and a file in its folder. Output: a jinja template. Values are escaped unless they are Markup; a name
in the template that the caller does not define is an error.
"""

import json
from collections.abc import Callable, Mapping
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from foldcar.errors import FoldcarError


def page_template(package: str, file: str, filters: Mapping[str, Callable[..., Any]] | None = None) -> Template:
    """The template, with ``filters`` in addition to jinja's."""
    environment = Environment(
        loader=PackageLoader(package, "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= filters or {}
    return environment.get_template(file)


def bundle(name: str) -> Markup:
    """A page's script with the libraries that it needs, for a script element. FoldcarError if it was not bundled."""
    file = files("foldcar").joinpath(f"bundles/{name}")
    if not file.is_file():
        raise FoldcarError(f"{file}: the page's script is not there: run `make setup` in the checkout, which bundles it")
    return Markup(file.read_text(encoding="utf-8").replace("</script", "<\\/script"))


def script_json(value: Any) -> Markup:
    """JSON that is safe inside a script element. ValueError if a number is NaN or infinite."""
    return Markup(json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))
