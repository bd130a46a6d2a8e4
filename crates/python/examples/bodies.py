"""Meshes against meshes and signed distances, beside python-fcl, coal and Open3D, on the same meshes and poses.

    python bodies.py [ROUNDS [THREADS [SIDE]]]

Prints Markdown. Each round runs all engines in turn; times are medians of processor time of the process. Engines that are not installed have no column.
Default: 5 rounds, and signed distances of a grid of 96 points a side on 2 threads; all else is one thread. docs/bodies.md has the numbers of one run.
"""

import sys
import time

import numpy as np

import canted


def ring(n):
    """A closed ring of 2 n^2 triangles with bumps."""

    def place(u, v):
        r = 0.45 + 0.08 * np.sin(7 * u) * np.sin(3 * v)
        return np.array([(1 + r * np.cos(v)) * np.cos(u), (1 + r * np.cos(v)) * np.sin(u), r * np.sin(v)])

    return surface(n, n, place)


def cable(n):
    """A closed cable of 16 n triangles, along a trefoil knot."""

    def center(u):
        return np.array([(2 + np.cos(3 * u)) * np.cos(2 * u), (2 + np.cos(3 * u)) * np.sin(2 * u), np.sin(3 * u)]) / 3

    def place(u, v):
        along = center(u + 1e-4) - center(u - 1e-4)
        side = np.cross(along, [0.0, 0.0, 1.0], axisa=0, axisc=0)
        up = np.cross(side, along, axis=0)
        side, up = (x / np.linalg.norm(x, axis=0) for x in (side, up))
        return center(u) + 0.02 * (np.cos(v) * side + np.sin(v) * up)

    return surface(n, 8, place)


def surface(n, m, place):
    """A grid of n by m cells that closes in both directions, put into space."""
    u, v = np.meshgrid(2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(m) / m, indexing="ij")
    vertices = np.moveaxis(place(u, v), 0, -1).reshape(-1, 3).astype(np.float32)
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    at = [((i + x) % n * m + (j + y) % m).reshape(-1) for x, y in ((0, 0), (1, 0), (0, 1), (1, 1))]
    triangles = np.concatenate([np.stack([at[0], at[1], at[2]], 1), np.stack([at[2], at[1], at[3]], 1)])
    return vertices, triangles.astype(np.int32)


def poses(n, size):
    """Matrices that rotate and move by about `size`."""
    random = np.random.default_rng(1)
    found = []
    for _ in range(n):
        rotation, _ = np.linalg.qr(random.normal(size=(3, 3)))
        rotation[:, 0] *= np.linalg.det(rotation)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, size * random.uniform(-1, 1, 3)
        found.append(pose)
    return found


def ours(mesh):
    """Calls for all pairs, whether bodies touch, and their distance."""
    bvh = canted.Bvh(*mesh)
    return {
        "pairs": lambda pose: len(bvh.pairs(bvh, pose)),
        "overlaps": lambda pose: bvh.overlaps(bvh, pose),
        "distance": lambda pose: bvh.distance_to(bvh, pose).distance,
    }


# More than all.
MOST = 1 << 24


def by_fcl(mesh):
    import fcl

    model = fcl.BVHModel()
    model.beginModel(len(mesh[0]), len(mesh[1]))
    model.addSubModel(mesh[0].astype(np.float64), mesh[1])
    model.endModel()
    fixed = fcl.CollisionObject(model, fcl.Transform())

    def moved(pose):
        return fcl.CollisionObject(model, fcl.Transform(pose[:3, :3], pose[:3, 3]))

    def collide(pose, most):
        result = fcl.CollisionResult()
        fcl.collide(fixed, moved(pose), fcl.CollisionRequest(num_max_contacts=most, enable_contact=most > 1), result)
        return result

    def pairs(pose):
        return len({(contact.b1, contact.b2) for contact in collide(pose, MOST).contacts})

    def distance(pose):
        return fcl.distance(fixed, moved(pose), fcl.DistanceRequest(), fcl.DistanceResult())

    return {"pairs": pairs, "overlaps": lambda pose: collide(pose, 1).is_collision, "distance": distance}


def by_coal(mesh):
    import coal

    model = coal.BVHModelOBBRSS()
    model.beginModel(len(mesh[1]), len(mesh[0]))
    vertices = coal.StdVec_Vec3s() if hasattr(coal, "StdVec_Vec3s") else coal.StdVec_Vec3f()
    vertices.extend(list(mesh[0].astype(np.float64)))
    triangles = coal.StdVec_Triangle() if hasattr(coal, "StdVec_Triangle") else coal.StdVec_Triangle32()
    make = coal.Triangle if hasattr(coal, "Triangle") else coal.Triangle32
    triangles.extend([make(*(int(i) for i in triangle)) for triangle in mesh[1]])
    model.addSubModel(vertices, triangles)
    model.endModel()
    fixed = coal.Transform3s()

    def moved(pose):
        return coal.Transform3s(pose[:3, :3].copy(), pose[:3, 3].copy())

    def collide(pose, most):
        request, result = coal.CollisionRequest(), coal.CollisionResult()
        request.num_max_contacts = most
        coal.collide(model, fixed, model, moved(pose), request, result)
        return result

    def pairs(pose):
        result = collide(pose, MOST)
        contacts = [result.getContact(i) for i in range(result.numContacts())]
        return len({(contact.b1, contact.b2) for contact in contacts})

    def distance(pose):
        return coal.distance(model, fixed, model, moved(pose), coal.DistanceRequest(), coal.DistanceResult())

    return {"pairs": pairs, "overlaps": lambda pose: collide(pose, 1).isCollision(), "distance": distance}


def grid(vertices, n):
    """n^3 points of the bounds, larger by a tenth."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    by = 0.1 * (high - low)
    axes = [np.linspace(low[k] - by[k], high[k] + by[k], n, dtype=np.float32) for k in range(3)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def signed(mesh, n_threads, side):
    """Calls for signed distances of a grid."""
    points, bvh = grid(mesh[0], side), canted.Bvh(*mesh)
    calls = {f"canted, {mode}": lambda mode=mode: bvh.signed_distance(points, mode=mode, threads=n_threads) for mode in ("winding", "parity")}
    try:
        import open3d
    except ImportError:
        return calls
    scene = open3d.t.geometry.RaycastingScene(nthreads=n_threads)
    scene.add_triangles(open3d.core.Tensor(mesh[0]), open3d.core.Tensor(mesh[1].astype(np.uint32)))
    table = open3d.core.Tensor(points)
    # Inside is decided there by the crossings of so many rays; 1 is the default.
    for n_rays in (1, 3):
        name = f"Open3D, {n_rays} ray" + "s" * (n_rays > 1)
        calls[name] = lambda n_rays=n_rays: scene.compute_signed_distance(table, nthreads=n_threads, nsamples=n_rays).numpy()
    return calls


def medians(calls, n_rounds):
    """Of each engine the milliseconds of wall and processor time, in turn, and its last answer; the first round warms up."""
    took, last = {name: [] for name in calls}, {}
    for i in range(n_rounds + 1):
        for name, call in calls.items():
            start = time.perf_counter(), time.process_time()
            last[name] = call()
            if i > 0:
                took[name].append((time.perf_counter() - start[0], time.process_time() - start[1]))
    return {name: 1e3 * np.median(times, axis=0) for name, times in took.items()}, last


def main(n_rounds=1, n_threads=2, side=12):
    models = {"ring": (ring(72), 0.8), "cable": (cable(640), 0.6)}
    engines = {"canted": ours}
    for name, make in (("python-fcl", by_fcl), ("coal", by_coal)):
        try:
            make(models["ring"][0])
            engines[name] = make
        except ImportError:
            pass
    print("Milliseconds of processor time a call, 20 poses, one thread; in brackets the sum of the answers.\n")
    print("| query | mesh | " + " | ".join(engines) + " |\n| --- | --- |" + " --- |" * len(engines))
    for mesh_name, (mesh, size) in models.items():
        bodies = {name: make(mesh) for name, make in engines.items()}
        for query, reach in (("pairs", size), ("overlaps", size), ("distance", 4 * size)):
            placed = poses(20, reach)
            calls = {name: lambda body=body: sum(body[query](pose) for pose in placed) for name, body in bodies.items()}
            times, answers = medians(calls, n_rounds)
            cells = [f"{times[name][1] / len(placed):.2f} ({answers[name]:.6g})" for name in engines]
            print(f"| {query} | {mesh_name}, {len(mesh[1]):,} triangles | " + " | ".join(cells) + " |", flush=True)
    print(f"\nSigned distances of {side}^3 points, {n_threads} threads: milliseconds of wall time / processor time; in brackets how many are inside.\n")
    n_columns = 3
    for row, (mesh_name, (mesh, _)) in enumerate(models.items()):
        times, answers = medians(signed(mesh, n_threads, side), n_rounds)
        if row == 0:
            n_columns = len(times)
            print("| mesh | " + " | ".join(times) + " |\n| --- |" + " --- |" * n_columns)
        cells = [f"{times[name][0]:.0f} / {times[name][1]:.0f} ({int((np.asarray(answers[name]) < 0).sum())})" for name in times]
        print(f"| {mesh_name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    given = [int(number) for number in sys.argv[1:]]
    main(*given, *[5, 2, 96][len(given) :])
