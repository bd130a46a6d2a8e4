"""Arrays of every layout and type, and what is wrong with bad ones."""

import canted
import meshes
import numpy as np
import pytest

VERTICES, TRIANGLES = meshes.soup(100)
ORIGINS, DIRECTIONS = meshes.rays(300)
EXPECTED = canted.Bvh(VERTICES, TRIANGLES).closest_hit(ORIGINS, DIRECTIONS)


def unaligned(array):
    raw = np.zeros(array.nbytes + 1, np.uint8)
    copy = raw[1:].view(array.dtype).reshape(array.shape)
    copy[...] = array
    assert not copy.flags.aligned
    return copy


def read_only(array):
    array = array.copy()
    array.flags.writeable = False
    return array


LAYOUTS = {
    "C": np.ascontiguousarray,
    "Fortran": np.asfortranarray,
    "every other row": lambda array: np.repeat(array, 2, axis=0)[::2],
    "some columns": lambda array: np.concatenate([array, array], axis=1)[:, 3:],
    "backward": lambda array: array[::-1].copy()[::-1],
    "backward columns": lambda array: array[:, ::-1].copy()[:, ::-1],
    "read-only": read_only,
    "unaligned": unaligned,
    "big-endian": lambda array: array.astype(array.dtype.newbyteorder(">")),
    "float64": lambda array: array.astype(np.float64) if array.dtype.kind == "f" else array,
    "strided float64": lambda array: np.asfortranarray(array.astype(np.float64)) if array.dtype.kind == "f" else array,
    "big-endian float64": lambda array: array.astype(">f8") if array.dtype.kind == "f" else array,
    "lists": lambda array: array.tolist(),
    "subclass": lambda array: np.matrix(array),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_has_the_same_answers(layout):
    change = LAYOUTS[layout]
    hits = canted.Bvh(change(VERTICES), change(TRIANGLES)).closest_hit(change(ORIGINS), change(DIRECTIONS))
    for name in ("t", "primitive", "u", "v"):
        assert (getattr(hits, name) == getattr(EXPECTED, name)).all(), name


@pytest.mark.parametrize("dtype", ["i2", "i4", "i8", "u2", "u4", "u8", ">i4", ">u8"])
def test_every_integer_type_of_indices(dtype):
    hits = canted.Bvh(VERTICES, TRIANGLES.astype(dtype)).closest_hit(ORIGINS, DIRECTIONS)
    assert (hits.t == EXPECTED.t).all() and (hits.primitive == EXPECTED.primitive).all()
    small = canted.Bvh(meshes.box()[0], meshes.box()[1].astype("i1"))
    assert len(small) == 12


def test_integers_and_half_precision_are_coordinates():
    vertices, triangles = meshes.box((-1, -1, -1), (1, 1, 1))
    for dtype in ("i4", "u8", "f2", "g"):
        bvh = canted.Bvh((vertices + 1).astype(dtype), triangles)
        assert bvh.bounds.tolist() == [[0, 0, 0], [2, 2, 2]]


def test_float64_is_rounded_once_after_the_origin_is_subtracted():
    shift = np.array([1e9 + 1 / 3, -2e9, 7e8])
    local = np.random.default_rng(5).uniform(-1, 1, (30, 3))
    vertices, triangles = local + shift, np.arange(30).reshape(-1, 3)
    bvh = canted.Bvh(vertices, triangles, origin=shift)
    expected = canted.Bvh((vertices - shift).astype(np.float32), triangles)
    origins = np.random.default_rng(6).uniform(-2, 2, (200, 3)) + shift
    directions = local[np.arange(200) % 30] - (origins - shift)
    hits, local_hits = bvh.closest_hit(origins, directions), expected.closest_hit((origins - shift).astype(np.float32), directions)
    assert (hits.t == local_hits.t).all() and (hits.primitive == local_hits.primitive).all() and hits.hit.sum() > 100
    hit = hits.hit
    assert np.array_equal(hits.position[hit], local_hits.position[hit] + shift)
    # Without an origin, the vertices are equal in float32.
    assert len(np.unique(canted.Bvh(vertices, triangles, origin=None).closest_hit(origins, directions).primitive)) < 10
    # The origin of a query replaces that of the BVH.
    assert (expected.closest_hit(origins, directions, origin=shift).t == hits.t).all()
    assert (bvh.closest_hit(origins - shift, directions, origin=(0, 0, 0)).t[0] == hits.t[0]).all()
    assert bvh.origin == tuple(shift) and canted.Bvh(vertices, triangles, origin=None).origin == (0, 0, 0)
    assert (bvh.contains(origins) == expected.contains(origins - shift)).all()
    near, local_near = bvh.nearest(origins), expected.nearest(origins - shift)
    assert (near.distance == local_near.distance).all() and np.array_equal(near.position, local_near.position + shift)
    assert (bvh.signed_distance(origins) == expected.signed_distance(origins - shift)).all()
    report = bvh.refit(vertices + 0.25)
    assert report["drift"] > 0 and abs(bvh.bounds[0] - (vertices + 0.25).min(axis=0)).max() < 1e-6


def test_empty_arrays():
    for vertices in (np.zeros((0, 3)), []):
        for triangles in (np.zeros((0, 3), int), np.zeros((0, 3)), []):
            bvh = canted.Bvh(vertices, triangles)
            assert len(bvh) == 0 and not bvh.closest_hit(ORIGINS, DIRECTIONS).hit.any()
            assert not bvh.contains([[0, 0, 0]])[0] and bvh.nearest([[0, 0, 0]]).primitive[0] == -1
            assert np.isinf(bvh.signed_distance([[0, 0, 0]]))[0] and bvh.bounds is None
            assert bvh.winding_number([[0, 0, 0]]).tolist() == [0] and bvh.k_nearest([0, 0, 0], 2).primitive.tolist() == [[-1, -1]]
    bvh = canted.Bvh(VERTICES, TRIANGLES)
    for empty in (np.zeros((0, 3), np.float32), []):
        for hits in (bvh.closest_hit(empty, empty), bvh.all_hits(empty, empty), bvh.crossings(empty, empty)):
            assert len(hits) == 0 and hits.position.shape == (0, 3) and hits.ray.dtype == "int64"
        assert bvh.occluded(empty, empty).shape == bvh.contains(empty).shape == (0,)
        assert bvh.nearest(empty).position.shape == (0, 3)


def test_one_ray_and_one_origin_for_all():
    bvh = canted.Bvh(VERTICES, TRIANGLES)
    hits = bvh.closest_hit(ORIGINS[5], DIRECTIONS[5])
    assert hits.t.shape == (1,) and hits.t[0] == EXPECTED.t[5] and hits.position.shape == (1, 3)
    shared = bvh.closest_hit(ORIGINS[5], DIRECTIONS)
    assert (shared.t == bvh.closest_hit(np.tile(ORIGINS[5], (300, 1)), DIRECTIONS).t).all()
    shared = bvh.closest_hit(ORIGINS, DIRECTIONS[5])
    assert (shared.t == bvh.closest_hit(ORIGINS, np.tile(DIRECTIONS[5], (300, 1))).t).all()
    assert bvh.contains([0, 0, 0]).shape == (1,)


def test_rays_that_cannot_hit():
    vertices, triangles = meshes.box((-1, -1, -1), (1, 1, 1))
    bvh = canted.Bvh(vertices, triangles)
    for origin in ([np.nan, 0, 5], [np.inf, 0, 5], [0, 0, 1e300]):
        assert not bvh.closest_hit([origin], [[0, 0, -1]]).hit[0]
    for direction in ([0, 0, 0], [np.nan, 0, -1], [0, 0, -np.inf]):
        assert not bvh.occluded([[0, 0, 5]], [direction])[0]
    for interval in ((-1.0, 9.0), (2.0, 1.0), (np.nan, 9.0), (0.0, np.nan)):
        assert len(bvh.all_hits([[0, 0, 5]], [[0, 0, -1]], *interval)) == 0
    assert not bvh.contains([[np.nan, 0, 0]])[0]
    assert bvh.nearest([[np.inf, 0, 0]]).primitive[0] == -1
    for short in (1e-39, 1e-44):
        hits = bvh.all_hits([[0.25, 0.5, 5]] * 2, [[0, 0, -short], [0, 0, -1]])
        assert hits.ray.tolist() == [1, 1] and np.isfinite(hits.t).all(), "no hit at t = inf"


@pytest.mark.parametrize("mode", ["parity", "winding", None])
def test_points_that_are_not_numbers_have_no_distance(mode):
    bvh = canted.Bvh(*meshes.box((-1, -1, -1), (1, 1, 1)))
    tlas = canted.Tlas([bvh])
    points = [[np.nan, 0, 0], [0, np.nan, np.inf], [0, 0, 0], [np.inf, 0, 0]]
    for answers in (bvh, tlas):
        near = answers.nearest(points)
        assert np.isnan(near.distance[:2]).all() and near.distance[2:].tolist() == [1, np.inf]
        assert np.isnan(near.position[:2]).all() and (near.primitive[:2] == -1).all()
        assert np.isnan(answers.k_nearest(points, 3).distance[:2]).all()
        signed = answers.signed_distance(points, mode)
        assert np.isnan(signed[:2]).all() and signed[2:].tolist() == [-1, np.inf]
        assert answers.contains(points, mode).tolist() == [False, False, True, False]
    winding = bvh.winding_number(points)
    assert np.isnan(winding[[0, 1, 3]]).all() and abs(winding[2] - 1) < 1e-14


BOX, BOX_TRIANGLES = meshes.box()
NAN = np.where(np.arange(24).reshape(8, 3) == 10, np.nan, BOX)
RAY = np.zeros((2, 3))

BAD_BUILDS = [
    ((BOX[:, :2], BOX_TRIANGLES), {}, r"vertices has shape (8, 2), not (n, 3)"),
    ((BOX[0], BOX_TRIANGLES), {}, r"vertices has shape (3,), not (n, 3)"),
    ((BOX, BOX_TRIANGLES[:, :2]), {}, r"triangles has shape (12, 2), not (m, 3)"),
    ((BOX, BOX_TRIANGLES[0]), {}, r"triangles has shape (3,), not (m, 3)"),
    ((BOX, BOX_TRIANGLES.astype(float)), {}, "triangles has dtype float64; use an integer dtype"),
    ((BOX, BOX_TRIANGLES > 0), {}, "triangles has dtype bool; use an integer dtype"),
    ((BOX.astype(complex), BOX_TRIANGLES), {}, "vertices has dtype complex128; use float32 or float64"),
    ((BOX.astype(str), BOX_TRIANGLES), {}, "vertices has dtype <U32; use float32 or float64"),
    (([[1, 2], [3]], BOX_TRIANGLES), {}, "vertices cannot be converted to an array"),
    ((None, BOX_TRIANGLES), {}, "vertices has shape (), not (n, 3)"),
    ((NAN, BOX_TRIANGLES), {}, "has a vertex that is not finite"),
    ((BOX.astype(float) * 1e39, BOX_TRIANGLES), {}, "has a vertex that is not finite"),
    ((BOX, [[0, 1, 2], [0, 1, 8]]), {}, "triangle 1 has vertex index 8, but there are 8 vertices"),
    ((BOX, [[0, 1, 2], [3, -1, 0]]), {}, "triangle 1 has vertex index -1, indices start at 0"),
    ((BOX, np.array([[0, 1, 2**40]])), {}, "triangle 0 has vertex index 1099511627776, but there are 8 vertices"),
    ((BOX, np.array([[0, 1, 2**64 - 1]], np.uint64)), {}, "vertex index 18446744073709551615, but there are 8 vertices"),
    ((BOX, BOX_TRIANGLES, "best"), {}, "preset is 'best'; use dynamic, fast, balanced or quality"),
    ((BOX, BOX_TRIANGLES), {"triangle_test": "x"}, "triangle_test is 'x'; use watertight, moller-trumbore or baldwin-weber"),
    ((BOX, BOX_TRIANGLES), {"origin": (0, 0)}, "origin has shape (2,), not (3,)"),
    ((BOX, BOX_TRIANGLES), {"origin": (0, np.nan, 0)}, "origin [0.0, NaN, 0.0] is not finite"),
    ((BOX, BOX_TRIANGLES), {"origin": "far"}, "origin is 'far'; use 'auto', 'near', three numbers or None"),
    ((BOX, BOX_TRIANGLES), {"progress": "x"}, "progress is a <class 'str'>; use a function of the finished fraction"),
    ((BOX[:4],), {}, "an array of shape (4, 3) and dtype float32 without triangles is no mesh"),
    ((object(),), {}, "a object without triangles is no mesh"),
    ((BOX, BOX_TRIANGLES), {"threads": 0}, "0 is not a number of threads from 1 to 1024"),
    ((BOX, BOX_TRIANGLES), {"threads": 1025}, "1025 is not a number of threads from 1 to 1024"),
]


@pytest.mark.parametrize(("arguments", "keywords", "sentence"), BAD_BUILDS, ids=lambda value: None)
def test_bad_builds_are_value_errors_with_a_sentence(arguments, keywords, sentence):
    with pytest.raises(ValueError) as error:
        canted.Bvh(*arguments, **keywords)
    assert sentence in str(error.value)


BAD_RAYS = [
    ((RAY, RAY[:, :2]), {}, "directions has shape (2, 2), not (n, 3) or (3,) or (..., 3)"),
    ((np.zeros((3, 3)), RAY), {}, "there are 3 origins, but 2 directions"),
    ((np.zeros((1, 3)), RAY), {}, "there are 1 origins, but 2 directions"),
    ((RAY, RAY), {"t_min": [0, 0, 0]}, "t_min has shape (3,); it must be one number or (2,)"),
    ((np.zeros((2, 4, 3)), np.zeros((4, 2, 3))), {}, "there are origins of shape (2, 4), but directions of shape (4, 2)"),
    ((np.zeros((2, 4, 3)), RAY[0]), {"t_max": [1, 2]}, "t_max has shape (2,); it must be one number or (2, 4)"),
    ((RAY, RAY), {"progress": 3}, "progress is a <class 'int'>; use a function of the finished fraction"),
    ((RAY, RAY), {"t_max": "far"}, "t_max has dtype <U3; use float32 or float64"),
    ((RAY, RAY), {"threads": -1}, "-1 is not a number of threads from 1 to 1024"),
    ((RAY, RAY), {"origin": [[0, 0, 0]]}, "origin has shape (1, 3), not (3,)"),
    ((RAY.astype(object), RAY), {}, "origins has dtype object; use float32 or float64"),
]


@pytest.mark.parametrize(("arguments", "keywords", "sentence"), BAD_RAYS, ids=lambda value: None)
@pytest.mark.parametrize("method", ["closest_hit", "occluded", "all_hits", "crossings"])
def test_bad_rays_are_value_errors_with_a_sentence(method, arguments, keywords, sentence):
    bvh = canted.Bvh(BOX, BOX_TRIANGLES)
    with pytest.raises(ValueError) as error:
        getattr(bvh, method)(*arguments, **keywords)
    assert sentence in str(error.value)


def test_indices_that_do_not_exist_in_changed_hits_are_value_errors():
    bvh = canted.Bvh(BOX, BOX_TRIANGLES)
    hits = bvh.closest_hit([[0.25, 0.5, 5]], [[0, 0, -1]])
    hits.primitive[0] = 12
    with pytest.raises(ValueError, match="hit 0 is on triangle 12, which does not exist"):
        hits.position  # noqa: B018


def test_no_copy_of_packed_float32_rays():
    """A million rays need room for their results only, not for a copy."""
    import tracemalloc

    n = 1_000_000
    origins, directions = np.zeros((n, 3), np.float32), np.ones((n, 3), np.float32)
    bvh = canted.Bvh(BOX, BOX_TRIANGLES)
    tracemalloc.start()
    hits = bvh.closest_hit(origins, directions)
    # NumPy reports its allocations; a conversion would show 12 MB or more.
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()
    assert len(hits) == n
    # An array of any size that has no memory of its own.
    assert len(bvh.occluded(np.broadcast_to(np.float32(0.5), (n, 3)), directions)) == n


def test_results_that_do_not_fit_into_memory_are_a_memory_error():
    huge = np.broadcast_to(np.float32(0), (1 << 58, 3))
    with pytest.raises(MemoryError):
        canted.Bvh(BOX, BOX_TRIANGLES).closest_hit(huge, huge)
