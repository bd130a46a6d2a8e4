"""The table of benches/PYTHON.md: wrong answers and speed of this package and of its peers, on the same meshes and rays.

    python table.py [MODEL] [RAYS] [ROUNDS]

MODEL is a scan, such as the Stanford bunny; without it, or where it is no file, a sphere takes its place. Default: 20,000 rays, 3 rounds. Prints
Markdown. `cargo xtask python` runs it with 1,000,000 rays and writes the file. Engines that are not installed have no column; the overhead
over Rust is measured where CANTED_RATE names the built example `bindings`.
"""

import os
import platform
import subprocess
import sys
import tempfile
import time
import warnings

import missing_hits
import numpy as np
import speed
import trimesh

import canted

ENGINES = ("canted.Bvh", "canted.trimesh", "trimesh + embreex", "Open3D")


def flange(n=256):
    """A CAD part: a flange with bolts, whose triangles are long and thin, as tessellated cylinders are."""
    parts = [trimesh.creation.annulus(r_min=1.0, r_max=4.0, height=0.5, sections=n)]
    parts.append(trimesh.creation.annulus(r_min=1.0, r_max=1.4, height=3.0, sections=n))
    for i in range(16):
        angle = 2 * np.pi * i / 16
        at = [3.2 * np.cos(angle), 3.2 * np.sin(angle), 0.0]
        for radius, height in ((0.2, 1.4), (0.35, 0.9)):
            bolt = trimesh.creation.cylinder(radius=radius, height=height, sections=n // 2)
            parts.append(bolt.apply_translation(at))
    return trimesh.util.concatenate(parts)


def wrong_answers():
    """For each engine, how many rays of the cases from trackers have a wrong number of crossings; and of how many."""
    cases = list(missing_hits.cases())
    engines = missing_hits.engines()
    names = {"canted": "canted.trimesh"}
    found = {names.get(name, name): sum(missing_hits.wrong(case, count(case)) for case in cases) for name, count in engines.items()}
    return found, sum(len(case.origins) for case in cases)


def times(mesh, n, n_rounds):
    """For each query and engine, the median over rounds of wall and processor time in seconds."""
    found = {}
    for query, calls in speed.tasks(mesh, n).items():
        measured = {name: [] for name in calls}
        for i in range(n_rounds + 1):
            for name, call in calls.items():
                start = time.perf_counter(), time.process_time()
                call()
                # The first round builds what is built on first use.
                if i > 0:
                    measured[name].append((time.perf_counter() - start[0], time.process_time() - start[1]))
        found[query] = {name: np.median(pairs, axis=0) for name, pairs in measured.items()}
    return found


class Rust:
    """The Rust library in a process of its own: the example `bindings` of the crate canted, whose path is in CANTED_RATE."""

    def __init__(self, program, folder, mesh, rays):
        counts = np.array([len(mesh.vertices), len(mesh.faces), len(rays[0]), 0], "<u4")
        interval = np.broadcast_to(np.array([0, np.inf], "<f4"), (len(rays[0]), 2))
        table = np.concatenate([*rays, interval], axis=1)
        parts = [counts, np.asarray(mesh.vertices, "<f4"), np.asarray(mesh.faces, "<u4"), table.astype("<f4")]
        path = os.path.join(folder, "rays")
        with open(path, "wb") as file:
            file.writelines(np.ascontiguousarray(part).tobytes() for part in parts)
        self.process = subprocess.Popen([program, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __call__(self):
        """Seconds of one cast of all rays, and the number of rays that hit."""
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        seconds, n_hits = self.process.stdout.readline().split()
        return float(seconds), int(n_hits)

    def close(self):
        """Ends the process."""
        self.process.stdin.close()
        self.process.wait()


def overhead(program, mesh, n, n_rounds):
    """Wall seconds of `closest_hit` here and of the same call of the Rust library, medians of rounds by turns."""
    origins, directions = (array.astype(np.float32) for array in speed.rays(mesh, n))
    bvh = canted.Bvh(mesh.vertices, mesh.faces)
    times = []
    with tempfile.TemporaryDirectory() as folder:
        rust = Rust(program, folder, mesh, [origins, directions])
        for i in range(n_rounds + 1):
            start = time.perf_counter()
            hits = bvh.closest_hit(origins, directions)
            own = time.perf_counter() - start
            seconds, n_hits = rust()
            assert n_hits == hits.hit.sum(), f"{n_hits} rays hit in Rust, {hits.hit.sum()} in Python"
            if i > 0:
                times.append((own, seconds))
        rust.close()
    return np.median(times, axis=0)


def main(model=None, n=20_000, n_rounds=3):
    """Prints the record."""
    warnings.simplefilter("ignore")
    known = model is not None and os.path.isfile(model)
    scan = trimesh.load(model, force="mesh") if known else trimesh.creation.icosphere(subdivisions=6)
    meshes = {"bunny" if known else "sphere": scan, "CAD part": flange()}
    counts, n_cases = wrong_answers()
    measured = {name: times(mesh, n, n_rounds) for name, mesh in meshes.items()}
    engines = [name for name in ENGINES if any(name in of for of in measured["CAD part"].values())]
    print("# Python: this package and its peers\n")
    sizes = ", ".join(f"{name} {len(mesh.faces):,} triangles" for name, mesh in meshes.items())
    print(f"`cargo xtask python`, {time.strftime('%Y-%m-%d')}, {platform.machine()}, {os.cpu_count()} processors, Python {platform.python_version()}. "
          f"{sizes}; {n:,} random rays from around the mesh to points of its box; medians of {n_rounds} interleaved rounds.\n")
    print("## Python queries\n")
    print("Wrong: rays at edges and vertices, and through thin walls, whose crossings are not counted right; cases of issue trackers. Speed: million rays per\n"
          "second of processor time, which other work on the machine disturbs least, with all processors; `first hit` is `closest_hit`, `all hits` is\n"
          "`multiple_hits=True` or `list_intersections`.\n")
    print("| query | " + " | ".join(engines) + " |\n|" + " --- |" * (1 + len(engines)))
    of_bvh = {**counts, "canted.Bvh": counts["canted.trimesh"]}
    print(f"| wrong of {n_cases} rays | " + " | ".join(str(of_bvh.get(name, "")) for name in engines) + " |")
    for mesh, queries in measured.items():
        for query, of in queries.items():
            cells = [f"{n / of[name][1] / 1e6:.2f}" if name in of else "" for name in engines]
            print(f"| {mesh}, {query} | " + " | ".join(cells) + " |")
    print("\n## Python wall time\n\nSeconds, with all processors.\n")
    print("| query | " + " | ".join(engines) + " |\n|" + " --- |" * (1 + len(engines)))
    for mesh, queries in measured.items():
        for query, of in queries.items():
            print(f"| {mesh}, {query} | " + " | ".join(f"{of[name][0]:.3f}" if name in of else "" for name in engines) + " |")
    if program := os.environ.get("CANTED_RATE"):
        print("\n## Python overhead\n\nSeconds of wall time of `closest_hit` and of `par_closest_hits` in Rust, by turns; medians.\n")
        print("| mesh | Python | Rust | overhead |\n| --- | --- | --- | --- |")
        for name, mesh in meshes.items():
            own, rust = overhead(program, mesh, n, max(n_rounds, 9))
            print(f"| {name} | {own:.4f} | {rust:.4f} | {100 * (own / rust - 1):+.1f} % |")
    print(f"\n`import canted`: {1e3 * import_time():.0f} ms, the least of five.")
    print(f"\nVersions: canted {canted.__version__}, trimesh {trimesh.__version__}{version('embreex')}{version('open3d')}.")


def import_time():
    """Seconds of `import canted` in a new process, the least of five."""
    program = "import time; start = time.perf_counter(); import canted; print(time.perf_counter() - start)"
    command = [sys.executable, "-c", program]
    return min(float(subprocess.run(command, capture_output=True, check=True).stdout) for _ in range(5))


def version(name):
    """The version of an installed package, for a list."""
    from importlib import metadata

    try:
        return f", {name} {metadata.version(name)}"
    except metadata.PackageNotFoundError:
        return ""


if __name__ == "__main__":
    arguments = sys.argv[1:]
    main(*arguments[:1], *map(int, arguments[1:]))
