"""XML as the exports write it: elements with attributes, numbers with nine significant digits."""

from xml.etree.ElementTree import Element, SubElement, indent, tostring


def add(parent: Element, tag: str, **attributes: str) -> Element:
    """A new last child of ``parent``."""
    return SubElement(parent, tag, attributes)


def numbers(*values: float) -> str:
    """Values as the text of an attribute."""
    return " ".join(f"{value + 0.0:.9g}" for value in values)


def document(root: Element) -> str:
    """The text of a whole file, indented."""
    indent(root)
    return tostring(root, encoding="unicode") + "\n"
