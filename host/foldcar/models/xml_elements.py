"""Builds XML: elements with attributes, numbers with nine significant digits."""

from xml.etree.ElementTree import Element, SubElement, indent, tostring


def add(parent: Element, tag: str, **attributes: str) -> Element:
    """Append a new element to ``parent`` and return it."""
    return SubElement(parent, tag, attributes)


def numbers(*values: float) -> str:
    """Numbers as the text of an attribute, separated by spaces."""
    return " ".join(f"{value + 0.0:.9g}" for value in values)


def document(root: Element) -> str:
    """The text of an XML file with this root, indented."""
    indent(root)
    return tostring(root, encoding="unicode") + "\n"
