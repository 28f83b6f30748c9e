"""What mkdocs adds to docs/ for `make docs`: the README as first page, live reports, the API, files that pages name."""

import ast
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
# Pages of the site, and what they are made from.
PAGES = {"index.md": "README.md", "contributing.md": "CONTRIBUTING.md", "changelog.md": "CHANGELOG.md"}
# A page of the site that stands in a folder.
SIMULATOR = "sim2d/README.md"
# Reports that `make docs` has written, in which a visitor drives simulated cars.
LIVE = ROOT / "out" / "live"
LIVE_REPORTS = ("width_study", "six_wheels")
# The first thing to try, above the README's pictures.
TRY = (
    "**[Drive a simulated car in your browser](live/width_study/index.html).** Nothing needs to be installed. The page "
    "is the report of a study: it says which of 37 cars to build, and drives them.\n\n"
)
# What a page of docs/ says of a report, and its link on the site.
LINKED = {"design_space.md": ("*live report*", "[live report](live/six_wheels/index.html)")}
ABOVE = "|a car of the family|"
API = ROOT / "host" / "foldcar" / "__init__.py"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages, and each file outside docs/ that a page links to."""
    for name, source in PAGES.items():
        page = (ROOT / source).read_text(encoding="utf-8").replace("](docs/", "](")
        assert name != "index.md" or ABOVE in page, f"{source} has no {ABOVE}"
        files.append(File.generated(config, name, content=_to_pages(page.replace(ABOVE, TRY + ABOVE, 1), "")))
    for report in LIVE_REPORTS:
        for path in sorted((LIVE / report).iterdir()):
            files.append(File.generated(config, f"live/{report}/{path.name}", abs_src_path=str(path)))
    files.append(File.generated(config, "api.md", content=_api()))
    for path in sorted(Path(config.docs_dir).glob("*.md")):
        for name in _outside(path.read_text(encoding="utf-8")):
            if name not in PAGES.values() and name not in files.src_uris:
                files.append(File.generated(config, name, abs_src_path=str(ROOT / name)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links to what is outside docs/ lead to its copy on the site."""
    if page.file.src_uri == SIMULATOR:
        return _to_pages(markdown.replace("](../docs/", "](../"), "../", "../")
    if page.file.src_uri in LINKED:
        words, link = LINKED[page.file.src_uri]
        assert words in markdown, f"{page.file.src_uri} does not say {words}"
        markdown = markdown.replace(words, link)
    return _to_pages(markdown, "../").replace("](../", "](")


def _to_pages(markdown: str, folder: str, site: str = "") -> str:
    for name, source in PAGES.items():
        markdown = markdown.replace(f"]({folder}{source}", f"]({site}{name}")
    return markdown


def _outside(text: str) -> list[str]:
    return re.findall(r"\]\(\.\./([^)#]+)", text)


def _api() -> str:
    """A section for each public name, from its docstring."""
    modules = re.search(r"^_MODULES = (\{.*?^\})", API.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert modules is not None
    names = ast.literal_eval(modules[1])
    sections = [f"::: {module}.{name}" for name, module in sorted(names.items(), key=lambda item: item[0].lower())]
    return "\n\n".join(["# Python API", "[A tour](python.md) comes first.", *sections, "::: foldcar.condition"]) + "\n"
