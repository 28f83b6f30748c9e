"""The report's page: one HTML file that needs neither other files nor a network. Its parts stand in the folder web/."""

from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from foldcar.page_template import bundle, page_template, script_json


def page_html(data: Mapping[str, Any], blobs: Mapping[str, str]) -> str:
    """The page as HTML of ``data`` (page_data.py); ``blobs`` are texts that it decodes when they are wanted, by id.

    An experiment's ``replay``, if it has one, has the ``key`` that its blobs' names begin with.
    """
    style = files("foldcar.report").joinpath("web/study.css").read_text(encoding="utf-8")
    return page_template("foldcar.report", "web/study.html", {"script_json": script_json}).render(
        data=data, blobs=blobs, style=Markup(style), program=bundle("study.js")
    )
