"""Tiles against Bvh, bit for bit."""

import pickle
import subprocess

import numpy as np
import pytest
from conftest import program

import canted

HIT_FIELDS = ("ray", "t", "primitive", "u", "v", "entering", "hit", "position", "normal")


def soup(n=2000, seed=1):
    """Triangles of which a tenth occurs twice, so that rays hit equal t."""
    rng = np.random.default_rng(seed)
    corners = (10 * rng.random((n, 1, 3)) + rng.random((n, 3, 3))).astype(np.float32)
    corners[-n // 10 :] = corners[: n // 10]
    return corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3)


def rays(seed=2, shape=(40, 50)):
    rng = np.random.default_rng(seed)
    return 12 * rng.random((*shape, 3)), rng.random((*shape, 3)) - 0.5


def assert_same(one, other, names):
    for name in names:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
        assert getattr(one, name).dtype == getattr(other, name).dtype


@pytest.mark.parametrize("tile_triangles, memory", [(2000, "2G"), (300, "2G"), (31, 10_000)])
def test_answers_are_those_of_a_bvh(tmp_path, tile_triangles, memory):
    vertices, triangles = soup()
    bvh = canted.Bvh(vertices, triangles)
    built = canted.Tiles.build(vertices, triangles, tmp_path / "store", tile_triangles=tile_triangles)
    assert len(built) == 2000 and built.stats()["tiles"] == -(-2000 // tile_triangles)
    tiles = canted.Tiles(tmp_path / "store", memory=memory)
    np.testing.assert_array_equal(tiles.bounds, bvh.bounds)
    origins, directions = rays()
    for name in ("closest_hit", "all_hits", "crossings"):
        found = getattr(tiles, name)(origins, directions, 0.0, 9.0)
        assert_same(found, getattr(bvh, name)(origins, directions, 0.0, 9.0), HIT_FIELDS)
        assert found.instance is None
    np.testing.assert_array_equal(tiles.occluded(origins, directions, 0, 2.0), bvh.occluded(origins, directions, 0, 2.0))
    np.testing.assert_array_equal(tiles.contains(origins), bvh.contains(origins, "parity"))
    np.testing.assert_array_equal(tiles.signed_distance(origins), bvh.signed_distance(origins, "parity"))
    fields = ("distance", "primitive", "position")
    assert_same(tiles.nearest(origins), bvh.nearest(origins), fields)
    assert_same(tiles.k_nearest(origins, 3, 0.5), bvh.k_nearest(origins, 3, 0.5), fields)
    assert (tiles.closest_hit(*rays(shape=(5000,))).primitive >= 1800).sum() == 0, "of copies, the lower number is hit"


def test_arrays_may_be_memory_maps(tmp_path):
    vertices, triangles = soup(500)
    np.save(tmp_path / "v.npy", vertices)
    np.save(tmp_path / "t.npy", triangles)
    maps = [np.load(tmp_path / name, mmap_mode="r") for name in ("v.npy", "t.npy")]
    one = canted.Tiles.build(*maps, tmp_path / "a", tile_triangles=60)
    other = canted.Tiles.build(vertices.reshape(-1, 3, 3), None, tmp_path / "b", tile_triangles=60)
    for name in ("000000.bvh", "000008.numbers", "manifest.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert repr(one).startswith("Tiles(500 triangles in 9 tiles") and len(other) == 500


def test_origin_and_pickle(tmp_path):
    vertices, triangles = soup(300)
    far = vertices.astype(np.float64) + [1e6, 0, 0]
    tiles = canted.Tiles.build(far, triangles, tmp_path / "store", tile_triangles=50, origin=(1e6, 0, 0))
    bvh = canted.Bvh(far, triangles, origin=(1e6, 0, 0))
    copy = pickle.loads(pickle.dumps(tiles))
    origins, directions = rays()
    assert_same(copy.closest_hit(origins + [1e6, 0, 0], directions), bvh.closest_hit(origins + [1e6, 0, 0], directions), HIT_FIELDS)
    assert tiles.origin == (1e6, 0.0, 0.0) and str(copy.path) == str(tmp_path / "store")


@pytest.mark.parametrize("origin", ["auto", "near", None])
@pytest.mark.parametrize("shift", [(0, 0, 0), (4e6 + 0.3, 5e5, 100.0)])
def test_far_meshes_have_the_origin_of_a_bvh(tmp_path, origin, shift):
    """float64 coordinates that float32 does not hold: t and distances are float64, and the bits those of a Bvh."""
    vertices, triangles = soup(400)
    # Those that no triangle has count for the origin.
    far = np.concatenate([vertices.astype(np.float64), [[900.0, 0, 0]]]) + shift
    bvh = canted.Bvh(far, triangles, origin=origin)
    is_near = origin == "near" or origin == "auto" and shift[0] > 0
    canted.Tiles.build(far, triangles, tmp_path / "store", tile_triangles=30, origin=origin)
    tiles = canted.Tiles(tmp_path / "store", memory=10_000)
    assert tiles.origin == bvh.origin and (tiles.origin != (0, 0, 0)) is (is_near and shift[0] > 0)
    origins, directions = rays()
    origins = origins.astype(np.float64) * 3 + shift
    for name in ("closest_hit", "all_hits", "crossings"):
        for interval in ((), (0.25, 5.0)):
            found = getattr(tiles, name)(origins, directions, *interval)
            assert found.t.dtype == (np.float64 if is_near else np.float32)
            assert_same(found, getattr(bvh, name)(origins, directions, *interval), HIT_FIELDS)
    np.testing.assert_array_equal(tiles.occluded(origins, directions, 0, 2.0), bvh.occluded(origins, directions, 0, 2.0))
    np.testing.assert_array_equal(tiles.contains(origins), bvh.contains(origins, "parity"))
    signed = tiles.signed_distance(origins)
    np.testing.assert_array_equal(signed, bvh.signed_distance(origins, "parity"))
    assert signed.dtype == tiles.nearest(origins).distance.dtype == bvh.nearest(origins).distance.dtype
    fields = ("distance", "primitive", "position")
    assert_same(tiles.nearest(origins, 2.5), bvh.nearest(origins, 2.5), fields)
    assert_same(tiles.k_nearest(origins, 4), bvh.k_nearest(origins, 4), fields)
    loose = canted.Tiles.build(far[triangles], None, tmp_path / "loose", tile_triangles=30, origin=origin)
    assert loose.origin == canted.Bvh(far[triangles], origin=origin).origin


def test_memory_is_a_number_or_a_text(tmp_path):
    store = tmp_path / "store"
    canted.Tiles.build(*soup(90), store, tile_triangles=30, memory=1e9)
    for memory in (2e9, 2**31, np.int64(4096), np.float32(4096), "2G", "1.5 MiB", "100000", None):
        assert len(canted.Tiles(store, memory=memory)) == 90
    for memory, shown in [(0, "0"), (-1.5, "-1.5"), (2**70, str(2**70)), (np.inf, "inf"), (np.nan, "nan"), ("2Q", "'2Q'"), ([], r"\[\]")]:
        with pytest.raises(ValueError, match=f"^memory is {shown}; use a number of bytes, or a text such as '500M' or '2G'$"):
            canted.Tiles(store, memory=memory)
        with pytest.raises(ValueError, match=f"^memory is {shown}; use"):
            canted.Tiles.build(*soup(90), tmp_path / "other", memory=memory)


def test_errors_name_what_is_wrong(tmp_path):
    vertices, triangles = soup(300)
    with pytest.raises(ValueError, match="it has no manifest.json"):
        canted.Tiles(tmp_path)
    store = tmp_path / "store"
    tiles = canted.Tiles.build(vertices, triangles, store, tile_triangles=50)
    for mode in ("winding", "other"):
        with pytest.raises(ValueError, match=f"mode is '{mode}'"):
            tiles.contains([[0, 0, 0]], mode)
    with pytest.raises(ValueError, match="triangle 1 has vertex index 900, but there are 900 vertices"):
        canted.Tiles.build(vertices, [[0, 1, 2], [0, 1, 900]], tmp_path / "other")
    with pytest.raises(ValueError, match="triangle 0 has a vertex that is not finite"):
        canted.Tiles.build(np.full((3, 3), np.nan), [[0, 1, 2]], tmp_path / "other")
    with pytest.raises(ValueError, match="tile_triangles is 0"):
        canted.Tiles.build(vertices, triangles, tmp_path / "other", tile_triangles=0)
    with pytest.raises(ValueError, match="memory is '2Q'"):
        canted.Tiles(store, "2Q")
    assert not list(tmp_path.glob("other*"))
    for name in ("000002.bvh", "000004.numbers"):
        whole = (store / name).read_bytes()
        for part in (whole[:-1], bytes([whole[0] ^ 1]) + whole[1:], None):
            (store / name).unlink() if part is None else (store / name).write_bytes(part)
            with pytest.raises(ValueError, match=name):
                canted.Tiles(store)
        (store / name).write_bytes(whole)
    tiles.check()


def test_placements_answer_as_a_tlas(tmp_path):
    """A scene with a mesh in several places, which `canted tiles` writes as placements."""
    vertices, triangles = soup(400)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()] + [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
    (tmp_path / "soup.obj").write_text("\n".join(lines))
    places = [(0.0, 0.5, 0.0), (4.0, 0.5, 0.0), (8.0, -1.0, 0.25), (0.0, 0.5, 0.0), (30.0, 0.0, 0.0)]
    scene = "[[assets]]\nname = 'a'\nfile = 'soup.obj'\n"
    scene += "".join(f"[[instances]]\nasset = 'a'\ntranslation = {list(place)}\n" for place in places)
    (tmp_path / "scene.toml").write_text(scene)
    command = [program(), "tiles", tmp_path / "scene.toml", "-o", tmp_path / "store", "--tile-triangles", "70"]
    subprocess.run(command, check=True, capture_output=True)
    matrices = np.tile(np.eye(4), (len(places), 1, 1))
    matrices[:, :3, 3] = places
    tlas = canted.Tlas([canted.Bvh(vertices, triangles)], [(0, matrix) for matrix in matrices])
    for memory in ("2G", 1):
        tiles = canted.Tiles(tmp_path / "store", memory=memory)
        origins, directions = rays()
        for name in ("closest_hit", "all_hits", "crossings"):
            fields = ("ray", "t", "primitive", "instance", "u", "v", "entering")
            assert_same(getattr(tiles, name)(origins, directions), getattr(tlas, name)(origins, directions), fields)
        for mode in (None, "parity"):
            np.testing.assert_array_equal(tiles.contains(origins, mode), tlas.contains(origins, "parity"))
        assert tiles.contains(origins).any()
        np.testing.assert_array_equal(tiles.signed_distance(origins), tlas.signed_distance(origins, "parity"))
        fields = ("distance", "primitive", "instance", "position")
        assert_same(tiles.nearest(origins, 2.0), tlas.nearest(origins, 2.0), fields)
        assert_same(tiles.k_nearest(origins, 3), tlas.k_nearest(origins, 3), fields)
