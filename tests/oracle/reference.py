"""Renders the references: `python reference.py [NAME...]`, all without a name.

Each is the mean of `N_RUNS` independent runs, as NAME.exr; its row of errors.tsv holds for each block of 16x16 pixels the
standard error of the block's mean (red, green, blue), from how the runs differ.
"""

import sys
import tempfile
import time
from pathlib import Path

import mitsuba as mi
import numpy as np

N_RUNS = 32
BLOCK = 16


def blocks(picture):
    """Means of blocks; those at the right and lower edge may be smaller."""
    height, width, _ = picture.shape
    rows = [picture[y : y + BLOCK] for y in range(0, height, BLOCK)]
    return np.array([[row[:, x : x + BLOCK].mean(axis=(0, 1)) for x in range(0, width, BLOCK)] for row in rows])


def runs(scene, samples):
    return np.array([np.array(mi.render(scene, spp=samples // N_RUNS, seed=seed), np.float64) for seed in range(N_RUNS)])


def write(path, picture):
    half = mi.Bitmap(np.float32(picture)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float16, False)
    half.write(str(path))


def write_errors(path, name, errors):
    """Adds or replaces the row of a picture."""
    rows = dict(line.split("\t") for line in path.read_text().splitlines()) if path.exists() else {}
    rows[name] = " ".join(np.format_float_scientific(x, trim="-") for x in np.float32(errors).reshape(-1))
    path.write_text("".join(f"{name}\t{numbers}\n" for name, numbers in sorted(rows.items())))


def main(names):
    mi.set_variant("llvm_ad_rgb")
    import scenes

    for name in names or scenes.PICTURES:
        picture, start = scenes.PICTURES[name], time.time()
        with tempfile.TemporaryDirectory() as folder:
            scene = mi.load_dict(scenes.scene(picture, Path(folder)))
        pictures = runs(scene, picture.samples)
        mean = pictures.mean(axis=0)
        error = np.std([blocks(picture) for picture in pictures], axis=0, ddof=1) / N_RUNS**0.5
        here = Path(__file__).parent
        write(here / f"{name}.exr", mean)
        write_errors(here / "errors.tsv", name, error)
        relative = np.max(error / np.maximum(blocks(mean), 1e-6))
        print(f"{name}: mean {mean.mean(axis=(0, 1))}, blocks within {relative:.1e}, {time.time() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
