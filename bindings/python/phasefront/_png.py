"""PNG files of 8-bit RGB or grey with a text. Written without a library, so that NumPy is the only dependency."""

from __future__ import annotations

import os
import secrets
import stat
import struct
import zlib
from pathlib import Path

import numpy
from numpy.typing import NDArray


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def encoded(image: NDArray[numpy.uint8], texts: dict[str, str]) -> bytes:
    """Returns the file of `image`, (H, W, 3) or (H, W, 1), with `texts` under their keywords, all Latin-1."""
    height, width, colours = image.shape
    rows = numpy.zeros((height, 1 + colours * width), numpy.uint8)  # each row begins with its filter type: 0, none
    rows[:, 1:] = image.reshape(height, -1)
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2 if colours == 3 else 0, 0, 0, 0)),
        *((b"tEXt", keyword.encode("latin-1") + b"\0" + text.encode("latin-1")) for keyword, text in texts.items()),
        (b"IDAT", zlib.compress(rows.data)),
        (b"IEND", b""),
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks)


def write(path: Path, content: bytes) -> None:
    """Writes a file. The write is atomic. A file that is replaced keeps its permissions."""
    beside = path.parent / f".phasefront-{secrets.token_hex(6)}.tmp"
    file = open(beside, "xb")  # `tempfile` would make it private
    try:
        with file:
            file.write(content)
        if path.exists():
            os.chmod(beside, stat.S_IMODE(path.stat().st_mode))
        os.replace(beside, path)
    except BaseException:
        os.unlink(beside)
        raise
