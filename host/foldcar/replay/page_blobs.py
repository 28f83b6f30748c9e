"""Bytes for a page: deflated and in base64, read there by DecompressionStream('deflate-raw') when they are wanted."""

import base64
import json
import zlib
from typing import Any


def blob(head: Any, content: bytes = b"") -> str:
    """``head`` as JSON, a line feed and ``content``, as text that is safe inside any element."""
    deflater = zlib.compressobj(9, wbits=-15)
    whole = json.dumps(head, separators=(",", ":"), allow_nan=False).encode() + b"\n" + content
    return base64.b64encode(deflater.compress(whole) + deflater.flush()).decode()
