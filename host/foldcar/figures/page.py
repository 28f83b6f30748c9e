"""Templates of HTML pages, and the scripts and data in them."""

import json
from collections.abc import Callable, Mapping
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from foldcar.errors import FoldcarError
from foldcar.shown_text import markdown_text


def page_template(package: str, file: str, filters: Mapping[str, Callable[..., Any]] | None = None) -> Template:
    """Return a package's template ``file``, with ``filters`` and the filter ``markdown``, which escapes texts."""
    environment = Environment(
        loader=PackageLoader(package, "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"markdown": markdown_text, **(filters or {})}
    return environment.get_template(file)


def web_page(package: str, name: str, **values: Any) -> str:
    """Return web/NAME.html of a package with its style NAME.css and its bundled script NAME.js. Raises FoldcarError."""
    style = files(package).joinpath(f"web/{name}.css").read_text(encoding="utf-8")
    template = page_template(package, f"web/{name}.html", {"script_json": script_json})
    return template.render(style=Markup(style), program=bundle(f"{name}.js"), **values)


def bundle(name: str) -> Markup:
    """Return a page's script with its libraries, for a script element. Raises FoldcarError if it was not bundled."""
    file = files("foldcar").joinpath(f"bundles/{name}")
    if not file.is_file():
        raise FoldcarError(f"{file}: the page's script is missing: run `make setup` in the checkout, which bundles it")
    return Markup(file.read_text(encoding="utf-8").replace("</script", "<\\/script"))


def script_json(value: Any) -> Markup:
    """Return JSON that is safe inside a script element. Raises ValueError if a number is NaN or infinite."""
    return Markup(json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"))
