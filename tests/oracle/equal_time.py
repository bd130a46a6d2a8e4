"""Compares canted with Mitsuba on Sponza under a constant sky: time at equal samples, error, and error in equal time.

    python equal_time.py PATH/TO/canted [SAMPLES [PICTURES]]

Prints a Markdown table. The renderers alternate; each renders PICTURES pictures of SAMPLES samples per pixel with different
seeds. Times are of rendering only, without loading, building and kernel compilation. Both estimates are unbiased, so the mean
squared error is the variance between pictures of one renderer. The slow scalar variant takes `SCALAR_SHARE` of the samples, as
its row shows.

Leaves are opaque on both sides, because calling Python from a scalar kernel is slow; textures use bilinear lookups at full
size.
"""

import json
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from importlib import reload
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
import scenes

SIZE = (320, 180)
SCALAR_SHARE = 1 / 8


class Mitsuba:
    def __init__(self, variant, sampler, samples, folder, rr_depth=None):
        self.name = f"Mitsuba `{variant}`, `{sampler}`" + (f", `rr_depth` {rr_depth}" if rr_depth else "")
        self.variant, self.samples = variant, samples
        mi.set_variant(variant)
        reload(scenes)
        described = scenes.scene(scenes.replace(scenes.SPONZA, environment=scenes.BLUE, size=SIZE), folder)
        described["integrator"]["type"] = "path"
        if rr_depth:
            described["integrator"]["rr_depth"] = rr_depth
        described["camera"]["sampler"] = {"type": sampler, "sample_count": samples}
        for part in described.values():
            surface = part.get("bsdf", {}) if isinstance(part, dict) else {}
            if surface.get("type") == "mask":
                part["bsdf"] = surface["inner"]
        self.scene = mi.load_dict(described)
        # The first picture compiles the kernels.
        self.picture(0)

    def picture(self, seed):
        """A picture, with its wall-clock and CPU seconds."""
        mi.set_variant(self.variant)
        start = time.perf_counter(), time.process_time()
        picture = np.array(mi.render(self.scene, spp=self.samples, seed=seed), np.float64)
        return picture, time.perf_counter() - start[0], time.process_time() - start[1]


class Canted:
    def __init__(self, program, sampler, samples, folder):
        self.name, self.samples = f"canted, `{sampler}`", samples
        self.folder, self.out = folder, folder / "out.exr"
        picture = scenes.SPONZA
        words = lambda numbers: ",".join(map(str, numbers))
        view = f"--eye={words(picture.eye)} --target={words(picture.target)} --fov={picture.fov} --env={words(scenes.BLUE)}"
        how = f"--integrator=path --lod=none --device=cpu --sampler={sampler} --json -o {self.out}"
        self.command = [program, "render", folder / "sponza.obj", *view.split(), *how.split()]
        # Overhead, measured with a picture of one sample.
        self.setup = self.run((1, 1), 1, 0)[1]

    def run(self, size, samples, seed):
        """Facts about a run, and its CPU seconds."""
        used = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
        start = used()
        settings = [f"--size={size[0]}x{size[1]}", f"--spp={samples}", f"--seed={seed}"]
        done = subprocess.run([*self.command, *settings], check=True, capture_output=True)
        assert b"warning" not in done.stderr, done.stderr
        return json.loads(done.stdout), used() - start

    def picture(self, seed):
        facts, processors = self.run(SIZE, self.samples, seed)
        return np.array(mi.Bitmap(str(self.out)), np.float64), facts["trace_seconds"], processors - self.setup


def opaque_sponza(folder):
    """Sponza without masks, as `sponza.obj` in the folder."""
    source = (scenes.ASSETS / "sponza").resolve()
    shutil.copy(source / "sponza.obj", folder)
    shutil.copytree(source / "textures", folder / "textures")
    lines = (source / "sponza.mtl").read_text().splitlines()
    (folder / "sponza.mtl").write_text("\n".join(line for line in lines if not line.startswith("map_d")))


def main(program, samples=64, n_pictures=8):
    samples, n_pictures = int(samples), int(n_pictures)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        opaque_sponza(folder)
        contestants = [
            Mitsuba("llvm_ad_rgb", "independent", samples, folder),
            Mitsuba("llvm_ad_rgb", "multijitter", samples, folder),
            # Russian roulette from the same vertex as ours.
            Mitsuba("llvm_ad_rgb", "independent", samples, folder, rr_depth=2),
            Mitsuba("llvm_ad_rgb", "multijitter", samples, folder, rr_depth=2),
            Mitsuba("scalar_rgb", "independent", int(samples * SCALAR_SHARE), folder),
            *(Canted(program, sampler, samples, folder) for sampler in ("random", "stratified", "sobol")),
        ]
        # Alternating, so that other load affects all renderers alike.
        taken = [[each.picture(seed) for each in contestants] for seed in range(1, n_pictures + 1)]
    head = ["renderer, sampler", "samples", "mean", "seconds", "CPU seconds", "MSE / mean²"]
    head += ["× seconds, relative to the first", "× CPU seconds"]
    print(f"| {' | '.join(head)} |\n{'| --- ' * len(head)}|")
    first = None
    for each, taken in zip(contestants, zip(*taken)):
        pictures = np.array([picture for picture, _, _ in taken])
        mean = pictures.mean()
        error = pictures.var(axis=0, ddof=1).mean() / mean**2
        times = np.median([times for _, *times in taken], axis=0)
        first = error * times if first is None else first
        costs = error * times / first
        numbers = f"{each.samples} | {mean:.5f} | {times[0]:.2f} | {times[1]:.2f} | {error:.4f} | {costs[0]:.2f} | {costs[1]:.2f}"
        print(f"| {each.name} | {numbers} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
