"""The template of an HTML page: a package's folder and a file in it in, what renders the page out.

Values are escaped unless they are Markup; a name that the template has but the caller does not is an error.
"""

from collections.abc import Callable, Mapping
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template


def page_template(package: str, file: str, filters: Mapping[str, Callable[..., Any]] | None = None) -> Template:
    """The template, with ``filters`` besides jinja's own."""
    environment = Environment(
        loader=PackageLoader(package, "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= filters or {}
    return environment.get_template(file)
