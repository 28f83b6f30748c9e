"""Damage of written SVG, DXF, LightBurn and PDF files, which the checks must find."""

import io
import re
from collections.abc import Callable
from typing import Any

import ezdxf
import pytest
from pypdf import PdfWriter, Transformation

from foldcar.fabrication.make_car import TEXTS
from foldcar.fabrication.patterns.verify import check_pdf, check_text
from written_sheet import CHOSEN, Made, written_sample

# Up to the first closed path of CUT_OUTER, that path but for its z, and the rest of it.
OUTLINE = r'(?s)(id="CUT_OUTER".*?)(<path d="M[^"]*)z("/>\n)'


@pytest.fixture(scope="module")
def made() -> Made:
    return written_sample()


def replaced(pattern: str, other: str) -> Callable[[str], str]:
    return lambda text: re.sub(pattern, other, text, count=1)


def folds_swapped(text: str) -> str:
    return text.replace("FOLD_VALLEY", "~").replace("FOLD_MOUNTAIN", "FOLD_VALLEY").replace("~", "FOLD_MOUNTAIN")


SVG = [
    (replaced(OUTLINE, r"\1"), "a line on CUT_OUTER .* is missing"),
    (replaced(OUTLINE, r"\1\2z\3\2z\3"), "lines on each other"),
    (replaced(OUTLINE, r"\1\2\3"), "is not closed"),
    (folds_swapped, "a line on FOLD_.* is missing"),
    (replaced('width="300mm" height="200mm"', 'width="300" height="200"'), "not given in mm"),
    # As at 96 dots per inch.
    (replaced('viewBox="0 0 300 200"', 'viewBox="0 0 1133.858 755.906"'), "is missing"),
    (replaced('id="LABEL"', 'id="LABEL" transform="translate(-20 0)"'), "has a transform"),
    (lambda text: text[: len(text) // 2], "not SVG"),
    (replaced('<circle cx="', '<circle cx="1'), "CUT_INNER"),
]


def edited(change: Callable[[Any, Any], object]) -> Callable[[str], str]:
    """Damage made with ezdxf to a document and its modelspace."""

    def damage(text: str) -> str:
        document = ezdxf.read(io.StringIO(text))
        change(document, document.modelspace())
        written = io.StringIO()
        document.write(written)
        return written.getvalue()

    return damage


def first(space: Any, layer: str) -> Any:
    return space.query(f"LWPOLYLINE[layer=='{layer}']")[0]


ARC = [(0, 0, 0, 0, 1), (9, 9, 0, 0, 0)]
DXF = [
    (edited(lambda _, space: space.delete_entity(space.query("CIRCLE")[0])), "a line on CUT_INNER .* is missing"),
    (edited(lambda _, space: first(space, "CUT_OUTER").translate(0.05, 0, 0)), "a line on CUT_OUTER .* is missing"),
    (edited(lambda document, _: setattr(document, "units", ezdxf.units.IN)), r"\$INSUNITS is 1"),
    (edited(lambda _, space: first(space, "CUT_OUTER").set_points(ARC)), "has a LWPOLYLINE on CUT_OUTER"),
    (lambda text: text[: len(text) // 2], "not DXF|audit"),
]
LIGHTBURN = [
    (replaced(r"<VertList>V", "<VertList>V1"), "is missing"),
    (replaced(r'<name Value="CUT_INNER" />', '<name Value="CUT_OUTER" />'), "not cut in their order"),
    (replaced(r'Rx="[0-9.]+"', 'Rx="0.1"'), "has a Ellipse"),
    (replaced(r"<XForm>1 0 0 1 150 100", "<XForm>1 0 0 1 151 100"), "the sheet's corner is at 1, 0"),
    (replaced(r"</LightBurnProject>", ""), "not a LightBurn project"),
]


@pytest.mark.parametrize(
    ("ending", "damage", "said"),
    [(ending, *one) for ending, several in (("svg", SVG), ("dxf", DXF), ("lbrn2", LIGHTBURN)) for one in several],
)
def test_a_damaged_file_is_found(made: Made, ending: str, damage: Callable[[str], str], said: str) -> None:
    written = made.texts[ending]
    damaged = damage(written)
    _, read = TEXTS[ending]

    assert damaged != written
    assert re.search(said, "\n".join(check_text(read, made.sheet, damaged, CHOSEN)))


def rewritten(change: Callable[[PdfWriter], object]) -> Callable[[bytes], bytes]:
    """Damage made with pypdf."""

    def damage(binary: bytes) -> bytes:
        writer, written = PdfWriter(clone_from=io.BytesIO(binary)), io.BytesIO()
        change(writer)
        writer.write(written)
        return written.getvalue()

    return damage


def recolour(writer: PdfWriter) -> None:
    content = writer.pages[0].get_contents()
    assert content is not None
    content.set_data(content.get_data().replace(b"0 0 0 RG", b"1 0 0 RG"))
    writer.pages[0].replace_contents(content)


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        # As printer drivers do to fit the page.
        (rewritten(lambda one: one.pages[0].add_transformation(Transformation().scale(0.97))), "page 1: a line"),
        (rewritten(lambda one: one.remove_page(0)), "has 1 pages, should have 2"),
        (rewritten(recolour), "page 1: a line on CUT_OUTER .* is missing"),
        (lambda binary: binary[:200], "not PDF"),
    ],
)
def test_a_damaged_pdf_is_found(made: Made, damage: Callable[[bytes], bytes], said: str) -> None:
    assert re.search(said, "\n".join(check_pdf([made.sheet, made.sheet], damage(made.pdf))))
