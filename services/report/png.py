"""PNG files out of arrays, by zlib alone."""

from __future__ import annotations

import base64
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY_ALPHA = 4
_FILTER_UP = 2


def encode_grey_alpha(pixels: NDArray[np.uint8]) -> bytes:
    """An 8-bit picture with transparency as PNG.

    Args:
        pixels: (rows, cols, 2) grey and alpha, row 0 on top.
    """
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] != 2 or not pixels.size:
        raise ValueError(f"expected uint8 (rows, cols, 2), got {pixels.dtype} {pixels.shape}")
    rows, columns, _ = pixels.shape
    lines = pixels.reshape(rows, -1)
    # Each line as its difference to the one above: terrain is smooth, so that packs well.
    above = np.zeros_like(lines)
    above[1:] = lines[:-1]
    packed = np.concatenate((np.full((rows, 1), _FILTER_UP, np.uint8), lines - above), axis=1)
    header = struct.pack(">IIBBBBB", columns, rows, 8, _GREY_ALPHA, 0, 0, 0)
    return b"".join(
        (
            _SIGNATURE,
            _chunk(b"IHDR", header),
            _chunk(b"IDAT", zlib.compress(packed.tobytes(), 9)),
            _chunk(b"IEND", b""),
        )
    )


def _chunk(kind: bytes, content: bytes) -> bytes:
    body = kind + content
    return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))


def data_uri(png: bytes) -> str:
    """The picture as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")
