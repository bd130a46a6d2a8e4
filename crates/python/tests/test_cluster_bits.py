"""Queries on Dask over tiles: the bits of one BVH, for any number of tiles and workers and for any chunks."""

import pickle
import subprocess

import numpy as np
import pytest

import canted
import meshes
from conftest import program
from test_tiles import rays, soup

dask = pytest.importorskip("dask", reason="dask is not installed")
distributed = pytest.importorskip("distributed", reason="distributed is not installed")
cd = pytest.importorskip("canted.distributed")

import clusters
from canted.distributed.worker import Answer

# Divided into 1, 2, 7 and 64 tiles.
N_TRIANGLES = 64 * 30
HITS = ("ray", "t", "primitive", "u", "v", "entering", "position")
NEAR = ("distance", "primitive", "position")


@pytest.fixture(scope="module")
def client():
    with clusters.local(3) as client:
        yield client


def grid():
    """A closed box of 8 x 14 cells, drawn four times, and rays at its corners and edges: hits of equal t are in several tiles."""
    x, y = np.meshgrid(np.arange(9.0), np.arange(15.0), indexing="ij")
    sheets = [np.stack([x, y, np.full_like(x, z)], -1).reshape(-1, 3) for z in (0.0, 2.0)]
    a = (np.arange(8)[:, None] * 15 + np.arange(14)).reshape(-1)
    sheet = np.concatenate([np.stack([a, a + 15, a + 16], -1), np.stack([a, a + 16, a + 1], -1)])
    vertices = np.concatenate(sheets * 4).astype(np.float32)
    triangles = np.concatenate([sheet[:, ::step] + 135 * i for i, step in enumerate([-1, 1] * 4)])
    random = np.random.default_rng(5)
    origins = np.stack([random.integers(0, 17, 2000) / 2, random.integers(0, 29, 2000) / 2, random.choice([-3.0, 1.0, 5.0], 2000)], -1)
    directions = np.zeros((2000, 3))
    directions[:, 2] = np.where(origins[:, 2] > 0, -1, 1)
    return vertices, triangles, origins, directions


def ties():
    vertices, triangles = soup(N_TRIANGLES)
    return (vertices, triangles, *(array.reshape(-1, 3) for array in rays()))


def ugly():
    """Needles, flats, duplicates, and coordinates of 100,000."""
    return (*meshes.soup(N_TRIANGLES, scale=3.0, offset=1e5), *meshes.rays(2000, scale=3.0, offset=1e5))


def far():
    """float64 coordinates that float32 does not hold: with an origin."""
    vertices, triangles, origins, directions = ties()
    shift = np.array([4e6 + 0.3, 5e5, 100.0])
    return vertices.astype(np.float64) + shift, triangles, origins + shift, directions


def answer(module, bvh, query, origins, directions, **options):
    if query in ("contains", "signed_distance"):
        return getattr(module, query)(bvh, origins, "parity", **options)
    if query == "nearest":
        return module.nearest(bvh, origins, 2.5, **options)
    return getattr(module, query)(bvh, origins, directions, 0.0, 9.0, **options)


QUERIES = {
    "closest_hit": HITS,
    "occluded": None,
    "all_hits": HITS,
    "crossings": HITS,
    "contains": None,
    "nearest": NEAR,
    "signed_distance": None,
}


@pytest.mark.parametrize("make", [ties, ugly, far, grid])
def test_answers_do_not_depend_on_tiles_workers_and_chunks(client, tmp_path, make):
    vertices, triangles, origins, directions = make()
    bvh = canted.Bvh(vertices, triangles)
    expected = {query: answer(canted.Bvh, bvh, query, origins, directions) for query in QUERIES}
    assert expected["occluded"].sum() > 50, "rays hit"
    workers = list(clusters.pids(client))
    chunks = iter([2000, 701, 433, 331, 1999, 419, 1013, 391, 641, 507, 1500, 373])
    for n_tiles in (1, 2, 7, 64):
        store = tmp_path / str(n_tiles)
        tiles = canted.Tiles.build(vertices, triangles, store, tile_triangles=-(-len(triangles) // n_tiles))
        assert tiles.stats()["tiles"] == n_tiles
        for n_workers in (1, 2, 3):
            options = {"chunk": next(chunks)}
            found = {query: answer(cd, store, query, origins, directions, **options) for query in QUERIES}
            # All fields once for each store: they are tasks, too.
            fields = {query: names and names[: None if n_workers == 2 else 3] for query, names in QUERIES.items()}
            lazy = {(query, name): getattr(found[query], name) if name else found[query] for query, names in fields.items() for name in names or [None]}
            values = client.gather(client.compute(list(lazy.values()), workers=workers[:n_workers]))
            for (query, name), value in zip(lazy, values):
                local = getattr(expected[query], name) if name else expected[query]
                np.testing.assert_array_equal(value, local, err_msg=f"{query}.{name}, {n_tiles} tiles, {n_workers} workers, {options}")
                assert value.dtype == local.dtype


def test_the_lowest_number_wins_across_tiles(tmp_path):
    """By an oracle: of triangles at equal t, the lowest number is hit, wherever the tiles part them."""
    vertices, triangles, origins, directions = grid()
    store = tmp_path / "store"
    canted.Tiles.build(vertices, triangles, store, tile_triangles=14)
    first = cd.closest_hit(store, origins, directions, chunk=199).compute("t", "primitive")
    every = cd.all_hits(store, origins, directions, chunk=301).compute("ray", "t", "primitive")
    hit = first["primitive"] >= 0
    same_t = every["t"] == first["t"][every["ray"]]
    lowest = np.full(len(origins), 1 << 30)
    np.minimum.at(lowest, every["ray"][same_t], every["primitive"][same_t])
    np.testing.assert_array_equal(first["primitive"][hit], lowest[hit])
    n_ties = np.bincount(every["ray"][same_t], minlength=len(origins))
    assert hit.sum() > 1000 and (n_ties[hit] > 1).mean() > 0.9


SCENE = """
[[assets]]
name = "soup"
file = "soup.obj"

[[instances]]
asset = "soup"

[[instances]]
asset = "soup"
translation = [4, 0, 0]

[[instances]]
asset = "soup"
translation = [0.5, 0, -2]
"""


def test_instances_on_tiles_are_those_of_a_tlas(client, tmp_path):
    vertices, triangles = soup(300)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()] + [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
    (tmp_path / "soup.obj").write_text("\n".join(lines))
    (tmp_path / "scene.toml").write_text(SCENE)
    matrices = np.tile(np.eye(4), (3, 1, 1))
    matrices[1][0, 3], matrices[2][:3, 3] = 4, (0.5, 0, -2)
    tlas = canted.Tlas([canted.Bvh(vertices, triangles)], [(0, matrix) for matrix in matrices])
    origins, directions = (array.reshape(-1, 3) for array in rays())
    expected = {query: answer(canted.Tlas, tlas, query, origins, directions) for query in QUERIES}
    assert set(np.unique(expected["closest_hit"].instance)) == {-1, 0, 1, 2}
    for tile_triangles in (300, 40):
        store = tmp_path / f"store{tile_triangles}"
        subprocess.run([program(), "tiles", tmp_path / "scene.toml", "-o", store, "--tile-triangles", str(tile_triangles)], check=True, capture_output=True)
        for query, names in QUERIES.items():
            found, local = answer(cd, store, query, origins, directions, chunk=333), expected[query]
            if names is None:
                np.testing.assert_array_equal(found.compute(), local, err_msg=query)
                continue
            # Positions of hits need a store of one mesh.
            names = [name for name in names if name != "position" or query == "nearest"]
            for name, value in found.compute(*names, "instance").items():
                np.testing.assert_array_equal(value, getattr(local, name), err_msg=f"{query}.{name}")
                assert value.dtype == getattr(local, name).dtype == getattr(found, name).dtype
    # An answer that moves to another worker has all fields that it had.
    of_tiles = Answer(canted.Tiles(store).closest_hit(origins, directions))
    moved = pickle.loads(pickle.dumps(of_tiles))
    np.testing.assert_array_equal(moved.field("instance"), of_tiles.field("instance"))
    for one in (of_tiles, moved, pickle.loads(pickle.dumps(moved))):
        with pytest.raises(ValueError, match="this one has 3 placements"):
            one.field("position")


@pytest.mark.parametrize("make", [ties, ugly, grid])
def test_rays_may_travel_to_parts_of_tiles(client, tmp_path, make):
    """With room for three tiles on each worker: every worker reads the tiles of its part, once, and no others."""
    vertices, triangles, origins, directions = make()
    bvh = canted.Bvh(vertices, triangles)
    store = tmp_path / "store"
    canted.Tiles.build(vertices, triangles, store, tile_triangles=-(-len(triangles) // 7))
    largest = max(path.stat().st_size for path in store.iterdir())
    memory = int(3.5 * largest)
    for chunk, t_max in ((2000, np.inf), (333, 9.0), (333, np.linspace(0.0, 9.0, 2000))):
        expected = bvh.closest_hit(origins, directions, 0.0, t_max)
        for travel in ("rays", "tiles"):
            options = {"chunk": chunk, "memory": memory, "travel": travel}
            found = cd.closest_hit(store, origins, directions, 0.0, t_max, **options)
            for name, values in found.compute(*HITS, "normal").items():
                np.testing.assert_array_equal(values, getattr(expected, name), err_msg=f"{name} {options}")
            np.testing.assert_array_equal(cd.occluded(store, origins, directions, 0.0, t_max, **options), bvh.occluded(origins, directions, 0.0, t_max))
    # One direction for all rays, and rows of rows.
    found = cd.closest_hit(store, origins.reshape(40, 50, 3), [0.0, 0.1, 1.0], chunk=300, memory=memory, travel="rays")
    np.testing.assert_array_equal(found.t, bvh.closest_hit(origins.reshape(40, 50, 3), [0.0, 0.1, 1.0]).t)


def test_a_worker_reads_its_part_alone(tmp_path):
    # The parts are so small here that it pays for an idle worker to open one more: others take tasks only where they are told to.
    with dask.config.set({"distributed.scheduler.work-stealing": False}), clusters.local(3) as client:
        reads_of_parts(client, tmp_path)


def reads_of_parts(client, tmp_path):
    vertices, triangles, origins, directions = ties()
    store = tmp_path / "store"
    canted.Tiles.build(vertices, triangles, store, tile_triangles=-(-len(triangles) // 7))
    memory = int(3.5 * max(path.stat().st_size for path in store.iterdir()))
    reads = {}
    for travel in ("tiles", "rays"):
        client.run(clear_open)
        cd.closest_hit(store, origins, directions, chunk=100, memory=memory, travel=travel).t.compute()
        reads[travel] = sum(client.run(n_reads).values())
    # Seven where nothing was started again; each chunk of the others needs them all, of which a worker holds three.
    assert 7 <= reads["rays"] <= 14 and reads["tiles"] > 3 * reads["rays"], reads


def clear_open():
    from canted.distributed import worker

    worker._OPEN.clear()


def n_reads():
    from canted.distributed import worker

    return sum(tiles.stats()["reads"] for tiles in worker._OPEN.values() if "reads" in tiles.stats())


def test_what_travels_follows_from_sizes(client):
    from canted.distributed.travel import choose, divided

    assert divided([5, 5, 5, 20, 1, 1], 10) == [(0, 2), (2, 1), (3, 1), (4, 2)]
    sizes = [1 << 20] * 30
    assert choose("auto", sizes, "2G", 1e9, 1000) is None, "every worker holds all"
    assert choose("auto", sizes, 2 << 20, 1e6, 10) is None, "three workers do not hold all"
    assert choose("auto", sizes, 11 << 20, 1e6, 10) is None, "the rays are more bytes than the tiles for ten chunks"
    assert choose("auto", sizes, 11 << 20, 1e5, 10) == [(0, 11), (11, 11), (22, 8)]
    assert choose("auto", sizes, 11 << 20, np.nan, 10) is None
    assert choose("tiles", sizes, 11 << 20, 1e5, 10) is None and choose("rays", sizes, "1G", 1e9, 1) == [(0, 30)]
    with pytest.raises(ValueError, match="travel is 'both'; use auto, rays, tiles"):
        choose("both", sizes, None, 1, 1)
