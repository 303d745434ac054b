"""PNG files out of arrays."""

from __future__ import annotations

import base64
import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image


def encode_grey_alpha(pixels: NDArray[np.uint8]) -> bytes:
    """An 8-bit picture with transparency as PNG.

    Args:
        pixels: (rows, cols, 2) grey and alpha, row 0 on top.
    """
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] != 2 or not pixels.size:
        raise ValueError(f"expected uint8 (rows, cols, 2), got {pixels.dtype} {pixels.shape}")
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=6)
    return buffer.getvalue()


def data_uri(png: bytes) -> str:
    """The picture as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")
