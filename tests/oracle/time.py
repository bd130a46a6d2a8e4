"""Times Mitsuba on Sponza under a constant sky: `python time.py VARIANT [WIDTH HEIGHT SAMPLES]`.

Load (with the build of its trees), first picture (with the translation of its kernels, in variants that have any) and
the median of three more, which is rendering alone, are printed each by itself: seconds, and seconds of all processors.
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import mitsuba as mi
import numpy as np


def main(variant, width=640, height=360, samples=16):
    mi.set_variant(variant)
    import scenes

    shot = replace(scenes.SHOTS["sponza-env"], size=(int(width), int(height)))

    def timed(work):
        start = np.array([time.perf_counter(), time.process_time()])
        return work(), [time.perf_counter(), time.process_time()] - start

    with tempfile.TemporaryDirectory() as folder:
        described = scenes.scene(shot, Path(folder))
        # Python cannot be called from a scalar kernel at speed: leaves are opaque, as in the plain path tracer.
        described["integrator"]["type"] = "path"
        for part in described.values():
            surface = part.get("bsdf", {}) if isinstance(part, dict) else {}
            if surface.get("type") == "mask":
                part["bsdf"] = surface["inner"]
        scene, load = timed(lambda: mi.load_dict(described))
    render = lambda seed: np.array(mi.render(scene, spp=int(samples), seed=seed))
    picture, first = timed(lambda: render(0))
    mean = picture.mean(axis=(0, 1))
    again = np.median([timed(lambda: render(seed))[1] for seed in (1, 2, 3)], axis=0)
    print(f"{variant}, {width}x{height}, {samples} samples per pixel, {mean} in the mean")
    for name, (wall, cpu) in [("load", load), ("first picture", first), ("another", again)]:
        print(f"{name}: {wall:.2f} s, {cpu:.2f} s of processors")


if __name__ == "__main__":
    main(*sys.argv[1:])
