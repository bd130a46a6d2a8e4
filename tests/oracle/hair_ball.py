"""Compares canted with Mitsuba on a ball of hair: time at equal samples, and whether the pictures agree.

    python hair_ball.py PATH/TO/canted [SAMPLES [WIDTH [PICTURES [RADIUS]]]]

10,000 strands of 20 round segments under a constant sky, Lambert surfaces, path tracing. The renderers alternate; each renders PICTURES pictures.
Prints a Markdown table of medians, and the ratio of the means. Times are of rendering only, without reading and building. RADIUS is that of a strand
at its root, relative to the ball.
"""

import json
import resource
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mitsuba as mi
import numpy as np

N_STRANDS, N_SEGMENTS = 10_000, 20
EYE, TARGET, FOV = (2.5872812, 1.6943223, 3.6949255), (0.0, -0.15, 0.0), 30.0


def strands(radius):
    """Points and radii: curls that lead away from a ball and hang a little."""
    rng = np.random.default_rng(7)
    unit = lambda v: v / np.linalg.norm(v, axis=1)[:, None]
    out = unit(rng.normal(size=(N_STRANDS, 3)))
    length = 0.5 * (0.8 + 0.4 * rng.random(N_STRANDS))
    side = rng.normal(size=(N_STRANDS, 3))
    side = unit(side - out * (side * out).sum(1)[:, None])
    s = np.linspace(0.0, 1.0, N_SEGMENTS + 1)
    turn = rng.random(N_STRANDS)[:, None] * 2 * np.pi + 12 * s
    curl = lambda axis, part: axis[:, None, :] * (0.03 * s * part)[:, :, None]
    points = out[:, None, :] * (1 + length[:, None] * s)[:, :, None]
    points += curl(side, np.cos(turn)) + curl(np.cross(out, side), np.sin(turn))
    points[:, :, 1] -= 0.15 * s**2
    return np.float32(points), np.broadcast_to(np.float32(radius * (1 - 0.7 * s)), points.shape[:2])


def write(folder, points, radii):
    """The strands as `ball.hair`, which has diameters, and as Mitsuba's text of a curve."""
    n_points = points.shape[0] * points.shape[1]
    head = b"HAIR" + struct.pack("<IIIIff", N_STRANDS, n_points, 2 | 4, N_SEGMENTS, 0.0, 0.0)
    head += struct.pack("<fff", 1.0, 1.0, 1.0) + bytes(88)
    (folder / "ball.hair").write_bytes(head + points.tobytes() + np.float32(2 * radii).tobytes())
    line = lambda point, radius: " ".join(f"{x:.9g}" for x in (*point, radius))
    text = ("\n".join(map(line, *strand)) for strand in zip(points, radii))
    (folder / "ball.txt").write_text("\n\n".join(text) + "\n")


def scene_of_canted(folder):
    words = lambda numbers: "[" + ", ".join(map(str, numbers)) + "]"
    (folder / "ball.toml").write_text(
        f"""lights = []
[camera]
eye = {words(EYE)}
target = {words(TARGET)}
fov_degrees = {FOV}
[environment]
constant = [1.0, 1.0, 1.0]
[[assets]]
name = "ball"
file = "ball.hair"
material = "hair"
[[instances]]
asset = "ball"
[[materials]]
name = "hair"
base_color = [0.5, 0.5, 0.5]
roughness = 1.0
specular = 0.0
"""
    )


def used(whom):
    return sum(resource.getrusage(whom)[:2])


def by_canted(program, folder, size, samples, seed):
    """A picture, its wall-clock and its CPU seconds."""
    out = folder / "ball.exr"
    how = f"--size={size[0]}x{size[1]} --spp={samples} --seed={seed} --integrator=path --filter=box --device=cpu --json"
    command = [program, "render", folder / "ball.toml", *how.split(), "-o", out]
    facts = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    stages = ("camera", "rays", "shading", "film")
    cpu = sum(facts[f"{stage}_thread_seconds"] for stage in stages)
    return np.array(mi.Bitmap(str(out)), np.float64)[:, :, :3], facts["trace_seconds"], cpu


def scene_of_mitsuba(folder, size, samples):
    view = mi.ScalarTransform4f().look_at(origin=EYE, target=TARGET, up=[0, 1, 0])
    film = {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}}
    sampler = {"type": "independent", "sample_count": samples}
    surface = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}}
    hair = {"type": "linearcurve", "filename": str(folder / "ball.txt"), "bsdf": {"type": "twosided", "surface": surface}}
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 34},
            "camera": {"type": "perspective", "fov": FOV, "fov_axis": "y", "to_world": view, "film": film, "sampler": sampler},
            "hair": hair,
            "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}},
        }
    )


def by_mitsuba(scene, samples, seed):
    start = time.perf_counter(), used(resource.RUSAGE_SELF)
    picture = np.array(mi.render(scene, spp=samples, seed=seed), np.float64)
    return picture[:, :, :3], time.perf_counter() - start[0], used(resource.RUSAGE_SELF) - start[1]


def main(program, samples=16, width=640, n_pictures=3, radius=0.004):
    samples, size, n_pictures = int(samples), (int(width), int(width) * 9 // 16), int(n_pictures)
    mi.set_variant("llvm_ad_rgb")
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        write(folder, *strands(float(radius)))
        scene_of_canted(folder)
        scene = scene_of_mitsuba(folder, size, samples)
        # The first picture compiles the kernels.
        by_mitsuba(scene, 1, 0)
        seeds = range(1, n_pictures + 1)
        taken = [(by_canted(program, folder, size, samples, seed), by_mitsuba(scene, samples, seed)) for seed in seeds]
    print(f"{size[0]}x{size[1]}, {samples} samples, {n_pictures} pictures\n\n| renderer | mean | seconds | CPU seconds |\n| --- | --- | --- | --- |")
    pictures = []
    for name, of in zip(("canted", "Mitsuba `llvm_ad_rgb`"), zip(*taken)):
        seconds, cpu = np.median([times for _, *times in of], axis=0)
        pictures.append(np.mean([picture for picture, *_ in of], axis=0))
        print(f"| {name} | {pictures[-1].mean():.6f} | {seconds:.2f} | {cpu:.2f} |")
    print(f"\nMeans differ by {100 * abs(pictures[0].mean() / pictures[1].mean() - 1):.3f} %.")


if __name__ == "__main__":
    main(*sys.argv[1:])
