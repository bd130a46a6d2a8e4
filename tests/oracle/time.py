"""Times Mitsuba on Sponza under a constant sky: `python time.py VARIANT [WIDTH HEIGHT SAMPLES]`.

Load (with the build of its trees), first picture (with the translation of its kernels, in variants that have any) and
the median of three more are printed each by itself, as seconds, with samples per second of the last.
"""

import statistics
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
        start = time.perf_counter()
        return work(), time.perf_counter() - start

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
    first = timed(lambda: render(0))[1]
    seconds = statistics.median(timed(lambda: render(seed))[1] for seed in (1, 2, 3))
    rate = int(width) * int(height) * int(samples) / seconds
    print(f"{variant}: load {load:.2f} s, first {first:.2f} s, then {seconds:.2f} s, {rate:.3g} samples/s")


if __name__ == "__main__":
    main(*sys.argv[1:])
