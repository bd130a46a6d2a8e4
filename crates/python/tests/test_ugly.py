"""Random ugly arguments for every call: an answer or an ordinary exception, never a panic, which is no Exception."""

import copy
import pickle

import canted
import meshes
import numpy as np
import pytest

N_ROUNDS = 1500

# What may be raised: other types of arguments than arrays are Python's TypeError.
ORDINARY = (ValueError, TypeError, IndexError, OSError, MemoryError, OverflowError)


def ugly(random, shapes):
    """Something that may be an array of one of these shapes."""
    numbers = [0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, 1e-45, 3e38, 1e300, 2.0**62, 2.0**-149]
    kind = random.integers(0, 14)
    shape = shapes[random.integers(0, len(shapes))]
    if random.random() < 0.2:
        shape = tuple(random.integers(0, 4, random.integers(0, 4)))
    values = random.uniform(-2, 2, shape)
    if kind < 5 and values.size:
        for _ in range(random.integers(0, 3)):
            values.reshape(-1)[random.integers(0, values.size)] = numbers[random.integers(0, len(numbers))]
        return values.astype([np.float32, np.float64, ">f4", np.float16, np.longdouble][kind])
    if kind == 5:
        return random.integers(-3, 20, shape).astype(random.choice(["i1", "u2", "i4", "u4", "i8", "u8", ">i8"]))
    if kind == 6:
        return np.asfortranarray(values)[::-1][..., ::-1]
    if kind == 7:
        return values.tolist()
    if kind == 8:
        return np.ma.masked_array(values, values > 1)
    if kind == 9:
        return values.astype(complex) if random.random() < 0.5 else values.astype(object)
    if kind == 10:
        return np.broadcast_to(numbers[random.integers(0, len(numbers))], shape)
    odd = [None, "abc", b"\0", {}, [], [[]], [[1, 2], [3]], object(), True, np.datetime64("now"), float("nan"), 2**70, -1, (), np.array("x")]
    return odd[random.integers(0, len(odd))]


def triangles(random, n):
    found = ugly(random, [(4, 3), (1, 3), (0, 3)])
    return random.integers(0, max(n, 1), (5, 3)) if random.random() < 0.5 else found


def number(random, good):
    return good if random.random() < 0.8 else ugly(random, [(), (3,)])


def calls(random):
    """One random build, and the calls on what it gave."""
    vertices = ugly(random, [(6, 3), (1, 3), (0, 3)]) if random.random() < 0.5 else random.uniform(-1, 1, (6, 3))
    options = {"preset": number(random, "fast"), "triangle_test": number(random, "watertight")}
    if random.random() < 0.3:
        options["origin"] = ugly(random, [(3,)]) if random.random() < 0.7 else random.choice(["near", "auto"])
    try:
        bvh = canted.Bvh(vertices, triangles(random, 6), **options)
    except ORDINARY:
        bvh = canted.Bvh(*meshes.box())
    rays = [(4, 3), (4, 3), (3,), (1, 3), (0, 3)]
    one = lambda: ugly(random, rays)  # noqa: E731
    for name in ("closest_hit", "occluded", "all_hits", "crossings"):
        interval = [ugly(random, [(), (4,)]) for _ in range(random.integers(0, 3))]
        yield lambda name=name, interval=interval: getattr(bvh, name)(one(), one(), *interval, threads=number(random, 1))
    yield lambda: bvh.closest_hit(one(), one(), origin=one()).position
    yield lambda: bvh.contains(one(), origin=number(random, None))
    yield lambda: bvh.contains(one(), number(random, "winding"))
    yield lambda: bvh.winding_number(one(), number(random, 0.1))
    yield lambda: bvh.k_nearest(one(), number(random, 3), number(random, 1.0)).position
    yield lambda: bvh.overlapping_box(one(), one())
    yield lambda: bvh.overlapping_sphere(one(), ugly(random, [(), (4,)]))
    yield lambda: bvh.overlapping_frustum(ugly(random, [(4, 3), (2, 4, 3)]), ugly(random, [(4, 3), (2, 4, 3)]))
    yield lambda: bvh.all_hits(one(), one())[ugly(random, [(), (2,)])].normal
    yield lambda: canted.Bvh(ugly(random, [(2, 3, 3), (6, 3)])).vertices
    yield lambda: bvh.nearest(one(), number(random, 2.0)).position
    yield lambda: bvh.signed_distance(one(), threads=number(random, 2))
    yield lambda: bvh.refit(one())
    yield lambda: bvh.refit(random.uniform(-1, 1, (6, 3)) * 10.0 ** random.integers(-40, 39))
    yield lambda: canted.Tlas([bvh, bvh], [(number(random, 1), ugly(random, [(4, 4)]))]).all_hits(one(), one()).normal
    yield lambda: canted.Tlas([bvh]).signed_distance(one(), number(random, None))
    yield lambda: canted.Tlas([bvh]).overlapping_box(one(), one())
    yield lambda: pickle.loads(pickle.dumps(canted.Tlas([bvh], [(0, ugly(random, [(4, 4)]))]).closest_hit(one(), one())))
    yield lambda: canted.Tlas(number(random, [bvh]), number(random, None)).closest_hit(one(), one())
    yield lambda: (bvh.stats(), bvh.bounds, repr(bvh), copy.deepcopy(bvh), pickle.loads(pickle.dumps(bvh)))
    yield lambda: canted.Bvh._from_bytes(damaged(random, bvh.__reduce__()[1][0]))
    yield lambda: canted.Heatmap(one(), number(random, 0.0), number(random, 1.0)).png()


def damaged(random, data):
    data = bytearray(data)
    for _ in range(random.integers(0, 4)):
        data[random.integers(0, len(data))] = random.integers(0, 256)
    return bytes(data[: random.integers(0, len(data) + 1)] if random.random() < 0.3 else data)


@pytest.mark.filterwarnings("ignore")
def test_no_ugly_argument_panics():
    random = np.random.default_rng(11)
    n_answers = n_errors = 0
    for _ in range(N_ROUNDS // 10):
        for call in calls(random):
            try:
                call()
                n_answers += 1
            except ORDINARY as error:
                assert "canted has a defect" not in str(error), error
                n_errors += 1
    assert n_answers > 300 and n_errors > 300, (n_answers, n_errors)


@pytest.mark.filterwarnings("ignore")
def test_no_ugly_scene_panics():
    canted_render = pytest.importorskip("canted_render")
    random = np.random.default_rng(12)
    names = ["eye", "target", "up", "fov", "sun", "point", "env", "aperture", "spp", "bounces", "filter", "time", "seed", "noise", "aovs"]
    n_answers = n_errors = 0
    for _ in range(N_ROUNDS // 10):
        vertices, faces = meshes.box()
        mesh = {"vertices": vertices * 10.0 ** random.integers(-30, 30), "triangles": faces}
        for key, shape in (("vertices", (8, 3)), ("triangles", (12, 3)), ("normals", (8, 3)), ("uvs", (8, 2)), ("color", (3,))):
            if random.random() < 0.15:
                mesh[key] = ugly(random, [shape])
        scene = {"meshes": [mesh]}
        for key, inner in (("camera", "eye"), ("environment", "constant"), ("lights", "type"), ("settings", "spp")):
            if random.random() < 0.1:
                scene[key] = {inner: ugly(random, [(3,)])} if random.random() < 0.7 else ugly(random, [(3,)])
        options = {}
        for name in random.choice(names, random.integers(0, 2)):
            options[name] = ugly(random, [(3,), (6,), ()])
            if name in ("spp", "bounces") and isinstance(options[name], (int, np.ndarray)):
                options[name] = 1
        try:
            canted_render.render(scene, **{"size": (3, 2), "spp": 1, "threads": 1, **options})
            n_answers += 1
        except ORDINARY as error:
            assert "canted has a defect" not in str(error), error
            n_errors += 1
    assert n_answers > 20 and n_errors > 20, (n_answers, n_errors)
