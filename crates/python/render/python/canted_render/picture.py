"""Arrays that a notebook displays as pictures."""

import struct
import zlib

import numpy as np

from . import _canted_render


class Picture(np.ndarray):
    """A picture: an array of shape (h, w, 3), float32, linear RGB, row 0 at the top.

    It is an array like any other. A notebook displays it; parts of it that are pictures, too.

    Attributes
    ----------
    aovs : dict
        The additional channels that were asked for, by name; empty for what is computed from a picture.
    """

    def __new__(cls, values, aovs=None):
        picture = np.asarray(values, dtype=np.float32).view(cls)
        picture.aovs = dict(aovs or {})
        return picture

    def __array_finalize__(self, other):
        self.aovs = {}

    def srgb(self):
        """The picture in 8 bits, as the program writes it: clamped to 0..1, encoded by the sRGB curve; (h, w, 3) uint8."""
        if self.ndim != 3 or self.shape[2] != 3 or self.size == 0:
            raise ValueError(f"an array of shape {self.shape} is no picture, which has (h, w, 3)")
        linear = np.ascontiguousarray(self, dtype=np.float32).reshape(-1)
        return np.frombuffer(_canted_render.srgb_bytes(np.asarray(linear)), np.uint8).reshape(self.shape)

    def png(self):
        """The picture as the bytes of a PNG file."""
        pixels = self.srgb()
        height, width, _ = pixels.shape
        # Each row starts with its filter: none.
        rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)
        header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
        chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b"")]
        return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(name, data) for name, data in chunks)

    def save(self, path):
        """Writes a PNG file."""
        data = self.png()
        with open(path, "wb") as file:
            file.write(data)

    def _repr_png_(self):
        # None makes a notebook show the numbers, as of any array.
        return self.png() if self.ndim == 3 and self.shape[2] == 3 and self.size > 0 else None


def _chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
