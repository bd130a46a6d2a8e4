"""Numbers as a picture that a notebook displays."""

import struct
import zlib

import numpy as np

# Colors from low to high, evenly spaced; linear in between.
_COLORS = np.array([[20, 20, 60], [60, 80, 190], [60, 180, 170], [240, 220, 80], [250, 250, 240]], dtype=np.float64)

# Where a number is missing.
_MISSING = (128, 128, 128)


class Heatmap:
    """A picture of a table of numbers: thickness, distance, t of a camera's rays.

    Parameters
    ----------
    values : (h, w) floats
        Row 0 is at the top. Numbers that are not finite, such as misses, are gray.
    low, high : float, optional
        The numbers of the first and the last color. Default: the least and the greatest finite number.

    Raises
    ------
    ValueError
        Another shape, or low above high, or one of them not finite.
    """

    def __init__(self, values, low=None, high=None):
        values = np.asarray(values, dtype=np.float64)
        if values.ndim != 2 or values.size == 0:
            raise ValueError(f"values have shape {values.shape}, not (h, w) with at least one number")
        finite = values[np.isfinite(values)]
        self.values = values
        self.low = float(low if low is not None else finite.min() if finite.size else 0.0)
        self.high = float(high if high is not None else finite.max() if finite.size else 1.0)
        if not (np.isfinite(self.low) and np.isfinite(self.high)):
            raise ValueError(f"low is {self.low} and high is {self.high}; they must be finite")
        if not self.low <= self.high:
            raise ValueError(f"low is {self.low}, above high, {self.high}")

    def pixels(self):
        """The picture: (h, w, 3) uint8, sRGB."""
        found = np.isfinite(self.values)
        # Halved, so that no difference overflows.
        span = self.high / 2 - self.low / 2
        share = np.clip((np.where(found, self.values, self.low) / 2 - self.low / 2) / (span if span > 0.0 else 1.0), 0.0, 1.0)
        at = share * (len(_COLORS) - 1)
        first = np.minimum(at.astype(int), len(_COLORS) - 2)
        between = (at - first)[..., None]
        colors = _COLORS[first] * (1.0 - between) + _COLORS[first + 1] * between
        return np.where(found[..., None], np.rint(colors), _MISSING).astype(np.uint8)

    def png(self):
        """The picture as the bytes of a PNG file."""
        pixels = self.pixels()
        height, width, _ = pixels.shape
        # Each row starts with its filter: none.
        rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)
        header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
        chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b"")]
        return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(name, data) for name, data in chunks)

    def save(self, path):
        """Writes a PNG file."""
        with open(path, "wb") as file:
            file.write(self.png())

    def _repr_png_(self):
        return self.png()

    def __repr__(self):
        height, width = self.values.shape
        return f"Heatmap({width} x {height}, {self.low:g} to {self.high:g})"


def _chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
