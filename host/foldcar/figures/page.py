"""Templates of HTML pages, and the scripts and data in them."""

import json
from base64 import b64encode
from collections.abc import Callable, Mapping
from hashlib import sha256
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
    template = page_template(package, f"web/{name}.html", {"script_json": script_json})
    style = files(package).joinpath(f"web/{name}.css").read_text(encoding="utf-8")
    program = bundle(f"{name}.js")
    return template.render(style=Markup(style), program=program, policy=content_policy(program), **values)


def content_policy(program: str = "") -> str:
    """Return the Content-Security-Policy of a page, which tells a browser what the page may do.

    The page may run the script ``program`` and no other one. So a browser does not run a script that somebody has put
    into a name or a note of a store. The page may show pictures and films from its own folder, also if it was opened as a
    file, and it cannot contact another computer. It may start workers, which are threads of the browser, from its own
    text.
    """
    # 'wasm-unsafe-eval' allows the page to compile WebAssembly, which it needs for the simulator.
    digest = b64encode(sha256(program.encode()).digest()).decode()
    scripts = f"'sha256-{digest}' 'wasm-unsafe-eval'" if program else "'none'"
    return (
        f"default-src 'none'; script-src {scripts}; worker-src blob:; style-src 'unsafe-inline'; "
        "img-src 'self' file:; media-src 'self' file:; base-uri 'none'; form-action 'none'"
    )


def bundle(name: str) -> Markup:
    """Return a page's script with its libraries, for a script element. Raises FoldcarError if it was not bundled."""
    file = files("foldcar").joinpath(f"bundles/{name}")
    if not file.is_file():
        raise FoldcarError(f"{file}: the page's script is missing: run `make setup` in the checkout, which bundles it")
    return Markup(file.read_text(encoding="utf-8").replace("</script", "<\\/script"))


def script_json(value: Any) -> Markup:
    """Return JSON that is safe inside a script element. Raises ValueError if a number is NaN or infinite."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    # A "<" could begin the end tag of the script element.
    return Markup(text.replace("<", "\\u003c"))
