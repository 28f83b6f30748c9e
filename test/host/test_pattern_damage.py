"""Damage of written SVG, DXF, LightBurn and PDF files, which the checks must find."""

import io
import re
from collections.abc import Callable

import ezdxf
import pytest
from pypdf import PdfWriter, Transformation

from foldcar.fabrication.make_car import TEXTS
from foldcar.fabrication.patterns.verify import check_pdf, check_text
from written_sheet import CHOSEN, Made, written_sample


@pytest.fixture(scope="module")
def made() -> Made:
    return written_sample()


def first_outline(text: str) -> re.Match[str]:
    """The first closed path of CUT_OUTER."""
    found = re.compile(r'<path d="M[^"]*z"/>\n').search(text, text.index('id="CUT_OUTER"'))
    assert found is not None
    return found


def without_outline(text: str) -> str:
    return text.replace(first_outline(text)[0], "", 1)


def outline_twice(text: str) -> str:
    return text.replace(first_outline(text)[0], 2 * first_outline(text)[0], 1)


def outline_open(text: str) -> str:
    return text.replace(first_outline(text)[0], first_outline(text)[0].replace("z", ""), 1)


def outline_moved(text: str) -> str:
    """The outline moved by 0.05 mm to the right."""
    path = first_outline(text)[0]
    x = re.search(r"M([0-9.]+)", path)
    assert x is not None
    return text.replace(path, path.replace(x[0], f"M{float(x[1]) + 0.05:.4f}", 1), 1)


def folds_swapped(text: str) -> str:
    return text.replace("FOLD_VALLEY", "~").replace("FOLD_MOUNTAIN", "FOLD_VALLEY").replace("~", "FOLD_MOUNTAIN")


def in_pixels(text: str) -> str:
    return text.replace('width="300mm" height="200mm"', 'width="300" height="200"')


def at_96_dpi(text: str) -> str:
    return text.replace('viewBox="0 0 300 200"', 'viewBox="0 0 1133.858 755.906"')


def off_the_sheet(text: str) -> str:
    return text.replace('id="LABEL"', 'id="LABEL" transform="translate(-20 0)"')


SVG = [
    (without_outline, "a line on CUT_OUTER .* is missing"),
    (outline_twice, "lines on each other"),
    (outline_open, "is not closed"),
    (outline_moved, "a line on CUT_OUTER .* is missing"),
    (folds_swapped, "a line on FOLD_.* is missing"),
    (in_pixels, "not given in mm"),
    (at_96_dpi, "is missing"),
    (off_the_sheet, "has a transform"),
    (lambda text: text.replace("LABEL", "Layer 1"), 'has a layer "Layer 1"'),
    (lambda text: text[: len(text) // 2], "not SVG"),
    (lambda text: text.replace('<circle cx="', '<circle cx="1', 1), "CUT_INNER"),
]


def edited(change: Callable[[ezdxf.document.Drawing], None]) -> Callable[[str], str]:
    """Damage made with ezdxf."""

    def damage(text: str) -> str:
        document = ezdxf.read(io.StringIO(text))
        change(document)
        written = io.StringIO()
        document.write(written)
        return written.getvalue()

    return damage


def drop_circle(document: ezdxf.document.Drawing) -> None:
    space = document.modelspace()
    space.delete_entity(space.query("CIRCLE")[0])


def move_polyline(document: ezdxf.document.Drawing) -> None:
    document.modelspace().query("LWPOLYLINE[layer=='CUT_OUTER']")[0].translate(0.05, 0, 0)


def open_polyline(document: ezdxf.document.Drawing) -> None:
    document.modelspace().query("LWPOLYLINE[layer=='CUT_OUTER']")[0].closed = False


def in_inches(document: ezdxf.document.Drawing) -> None:
    document.units = ezdxf.units.IN


def bulge(document: ezdxf.document.Drawing) -> None:
    document.modelspace().query("LWPOLYLINE[layer=='CUT_OUTER']")[0].set_points([(0, 0, 0, 0, 1), (9, 9, 0, 0, 0)])


def copy_fold(document: ezdxf.document.Drawing) -> None:
    space = document.modelspace()
    space.add_entity(space.query("LWPOLYLINE[layer=='FOLD_VALLEY']")[0].copy())


DXF = [
    (edited(drop_circle), "a line on CUT_INNER .* is missing"),
    (edited(move_polyline), "a line on CUT_OUTER .* is missing"),
    (edited(open_polyline), "is not closed"),
    (edited(in_inches), r"\$INSUNITS is 1"),
    (edited(bulge), "has a LWPOLYLINE on CUT_OUTER"),
    (edited(copy_fold), "lines on each other"),
    (lambda text: text[: len(text) // 2], "not DXF|audit"),
]


def replaced(pattern: str, other: str) -> Callable[[str], str]:
    return lambda text: re.sub(pattern, other, text, count=1)


LIGHTBURN = [
    (replaced(r"<VertList>V", "<VertList>V1"), "is missing"),
    (replaced(r'<name Value="CUT_INNER" />', '<name Value="CUT_OUTER" />'), "not cut in their order"),
    (replaced(r"LineClosed", "LineOpen"), "is not closed|is missing"),
    (replaced(r'Rx="[0-9.]+"', 'Rx="0.1"'), "has a Ellipse"),
    (replaced(r"<XForm>1 0 0 1 150 100", "<XForm>1 0 0 1 151 100"), "the sheet's corner is at 1, 0"),
    (replaced(r"</LightBurnProject>", ""), "not a LightBurn project"),
]


@pytest.mark.parametrize(
    ("ending", "damage", "said"),
    [(ending, *one) for ending, several in (("svg", SVG), ("dxf", DXF), ("lbrn2", LIGHTBURN)) for one in several],
)
def test_a_damaged_file_is_found(made: Made, ending: str, damage: Callable[[str], str], said: str) -> None:
    write, read = TEXTS[ending]
    damaged = damage(write(made.sheet))

    assert damaged != write(made.sheet)
    assert re.search(said, "\n".join(check_text(read, made.sheet, damaged, CHOSEN)))


def rewritten(change: Callable[[PdfWriter], None]) -> Callable[[bytes], bytes]:
    """Damage made with pypdf."""

    def damage(binary: bytes) -> bytes:
        writer = PdfWriter(clone_from=io.BytesIO(binary))
        change(writer)
        written = io.BytesIO()
        writer.write(written)
        return written.getvalue()

    return damage


def fit_to_page(writer: PdfWriter) -> None:
    """Scale the page to fit, as printer drivers do."""
    writer.pages[0].add_transformation(Transformation().scale(0.97))


def shift_page(writer: PdfWriter) -> None:
    writer.pages[1].add_transformation(Transformation().translate(0.2, 0))


def drop_page(writer: PdfWriter) -> None:
    writer.remove_page(0)


def recolour(writer: PdfWriter) -> None:
    page = writer.pages[0]
    content = page.get_contents()
    assert content is not None
    content.set_data(content.get_data().replace(b"0 0 0 RG", b"1 0 0 RG"))
    page.replace_contents(content)


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (rewritten(fit_to_page), "page 1: a line"),
        (rewritten(shift_page), "page 2: a line"),
        (rewritten(drop_page), "has 1 pages, should have 2"),
        (rewritten(recolour), "page 1: a line on CUT_OUTER .* is missing"),
        (lambda binary: binary[:200], "not PDF"),
    ],
)
def test_a_damaged_pdf_is_found(made: Made, damage: Callable[[bytes], bytes], said: str) -> None:
    assert re.search(said, "\n".join(check_pdf([made.sheet, made.sheet], damage(made.pdf))))
