"""canted.distributed: the bits of the local call, for any chunks and workers."""

import pickle
import sys
import time

import numpy as np
import pytest

import canted
from test_tiles import rays, soup

dask = pytest.importorskip("dask", reason="dask is not installed")
da = pytest.importorskip("dask.array", reason="dask.array is not installed")
distributed = pytest.importorskip("distributed", reason="distributed is not installed")
cd = pytest.importorskip("canted.distributed")

from canted.distributed.worker import Answer

NEAR = ("distance", "primitive", "position")
HITS = ("ray", "t", "primitive", "u", "v", "entering", "hit", "position", "normal")


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", host="127.0.0.1") as cluster:
        with distributed.Client(cluster) as client:
            yield client


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """One mesh as a Bvh, as its file, as its URL, and as tiles."""
    folder = tmp_path_factory.mktemp("sources")
    vertices, triangles = soup()
    bvh = canted.Bvh(vertices, triangles)
    bvh.save(folder / "mesh.bvh")
    tiles = canted.Tiles.build(vertices, triangles, folder / "store", tile_triangles=150)
    urls = [(folder / name).as_uri() for name in ("mesh.bvh", "store")]
    return bvh, [bvh, folder / "mesh.bvh", str(folder / "store"), tiles, *urls]


def check(bvh, source):
    origins, directions = rays()
    for chunk in (200, 10_000):
        hits = cd.closest_hit(source, origins, directions, chunk=chunk)
        local = bvh.closest_hit(origins, directions)
        found = hits.compute(*HITS)
        for name in HITS:
            assert isinstance(getattr(hits, name), da.Array) and getattr(hits, name).shape == getattr(local, name).shape
            np.testing.assert_array_equal(found[name], getattr(local, name))
            assert found[name].dtype == getattr(local, name).dtype == getattr(hits, name).dtype
        assert hits.instance is None
    t_max = 5 * np.random.default_rng(3).random(origins.shape[:-1])
    lazy = [da.from_array(array, chunks=(13, 17, 2)) for array in (origins, directions)]
    np.testing.assert_array_equal(cd.occluded(source, *lazy, 0.0, t_max).compute(), bvh.occluded(origins, directions, 0.0, t_max))
    np.testing.assert_array_equal(
        cd.closest_hit(source, lazy[0], directions, t_max=da.from_array(t_max)).t.compute(), bvh.closest_hit(origins, directions, t_max=t_max).t
    )
    flat = origins.reshape(-1, 3), directions.reshape(-1, 3)
    for name in ("all_hits", "crossings"):
        found = getattr(cd, name)(source, *flat, chunk=333).compute(*HITS)
        for field in HITS:
            np.testing.assert_array_equal(found[field], getattr(getattr(bvh, name)(*flat), field), err_msg=f"{name} {field}")
    np.testing.assert_array_equal(cd.contains(source, origins, "parity", chunk=99).compute(), bvh.contains(origins, "parity"))
    np.testing.assert_array_equal(cd.signed_distance(source, lazy[0], "parity").compute(), bvh.signed_distance(origins, "parity"))
    near = cd.nearest(source, origins, 0.4, chunk=150)
    local = bvh.nearest(origins, 0.4)
    for name, values in near.compute("distance", "primitive", "position").items():
        np.testing.assert_array_equal(values, getattr(local, name))


def test_answers_on_a_cluster(cluster, sources):
    bvh, all_sources = sources
    for source in all_sources:
        check(bvh, source)


def test_answers_on_threads(sources):
    bvh, all_sources = sources
    with dask.config.set(scheduler="threads"):
        check(bvh, all_sources[0])
        check(bvh, all_sources[2])


def test_one_origin_serves_all_rays(sources):
    bvh, _ = sources
    _, directions = rays()
    with dask.config.set(scheduler="threads"):
        found = cd.closest_hit(bvh, [5.0, 5.0, 5.0], directions, chunk=100).t.compute()
        np.testing.assert_array_equal(found, bvh.closest_hit([5.0, 5.0, 5.0], directions).t)
        np.testing.assert_array_equal(cd.closest_hit(bvh, [5, 5, 5], [0, 0, 1]).t.compute(), bvh.closest_hit([5, 5, 5], [0, 0, 1]).t)


def test_a_bvh_with_an_origin_near_it_gives_float64(tmp_path):
    vertices, triangles = soup(200)
    bvh = canted.Bvh(vertices.astype(np.float64) + 1e7, triangles, origin="near")
    bvh.save(tmp_path / "near.bvh")
    origins, directions = rays()
    with dask.config.set(scheduler="threads"):
        for source in (bvh, tmp_path / "near.bvh"):
            found = cd.closest_hit(source, origins + 1e7, directions, chunk=300).t
            assert found.dtype == np.float64 == found.compute().dtype
            np.testing.assert_array_equal(found.compute(), bvh.closest_hit(origins + 1e7, directions).t)


def test_tiles_with_an_origin_near_them_give_float64(tmp_path):
    vertices, triangles = soup(200)
    far = vertices.astype(np.float64) + 1e7
    bvh = canted.Bvh(far, triangles)
    tiles = canted.Tiles.build(far, triangles, tmp_path / "store", tile_triangles=30)
    origins, directions = rays()
    with dask.config.set(scheduler="threads"):
        for source in (tiles, str(tmp_path / "store") + "/", (tmp_path / "store").as_uri()):
            found = cd.closest_hit(source, origins + 1e7, directions, chunk=300).t
            assert found.dtype == np.float64 == found.compute().dtype
            np.testing.assert_array_equal(found.compute(), bvh.closest_hit(origins + 1e7, directions).t)
            signed = cd.signed_distance(source, origins + 1e7, chunk=300)
            assert signed.dtype == np.float64
            np.testing.assert_array_equal(signed.compute(), bvh.signed_distance(origins + 1e7, "parity"))


def test_intervals_and_sizes(sources):
    bvh, _ = sources
    origins, directions = (array.reshape(-1, 3) for array in rays())
    some = origins[:, 0] > 0
    with dask.config.set(scheduler="threads"):
        found = cd.closest_hit(bvh, origins, directions, None, None, chunk=100)
        np.testing.assert_array_equal(found.t.compute(), bvh.closest_hit(origins, directions).t)
        for t_max in ([1.0, 2.0], np.ones((3, 5)), da.ones(7)):
            with pytest.raises(ValueError, match=r"t_max has shape \(.*\); the rays have shape"):
                cd.closest_hit(bvh, origins, directions, t_max=t_max)
        # Of rays that are chosen by a condition, Dask knows no number.
        chosen = [da.from_array(array, chunks=(100, 3))[da.from_array(some, chunks=100)] for array in (origins, directions)]
        up = [0.0, 0.1, 1.0]
        local = bvh.all_hits(origins[some], up)
        np.testing.assert_array_equal(cd.all_hits(bvh, chosen[0], up).t.compute(), local.t)
        for wrong in (
            lambda: cd.all_hits(bvh, chosen[0], up).ray,
            lambda: cd.closest_hit(bvh, chosen[0], up).ray,
            lambda: cd.closest_hit(bvh, *chosen),
            lambda: cd.closest_hit(bvh, chosen[0], up, t_max=np.ones(int(some.sum()))),
        ):
            with pytest.raises(ValueError, match="chunks of unknown sizes; call their compute_chunk_sizes"):
                wrong()
        known = [array.compute_chunk_sizes() for array in chosen]
        local = bvh.all_hits(origins[some], directions[some])
        found = cd.all_hits(bvh, *known).compute()
        assert set(found) == {"ray", "t", "primitive", "u", "v", "entering", "hit"}
        for name, values in found.items():
            np.testing.assert_array_equal(values, getattr(local, name))
        with pytest.raises(AttributeError, match="has no field 'triangle'; it has ray, t, primitive"):
            cd.all_hits(bvh, *known).triangle


def test_persisted_queries_run_once(cluster, sources):
    bvh, all_sources = sources
    origins, directions = rays()
    hits = cd.closest_hit(all_sources[2], origins, directions, chunk=300).persist()
    local = bvh.closest_hit(origins, directions)
    np.testing.assert_array_equal(hits.t.compute(), local.t)
    np.testing.assert_array_equal(hits.position.compute(), local.position)


def test_answers_that_move_keep_their_fields_and_size(sources):
    bvh, all_sources = sources
    origins, directions = rays()
    for found, names in ((bvh.closest_hit(origins, directions), HITS), (all_sources[3].all_hits(origins, directions), HITS), (bvh.nearest(origins), NEAR)):
        answer = Answer(found)
        for one in (answer, pickle.loads(pickle.dumps(answer))):
            for name in names:
                np.testing.assert_array_equal(one.field(name), getattr(found, name))
            assert sys.getsizeof(one) >= 25 * found.primitive.size


def test_errors_reach_the_client(cluster, sources, tmp_path):
    origins, directions = rays()
    with pytest.raises((OSError, ValueError), match="absent"):
        cd.closest_hit(tmp_path / "absent.bvh", origins, directions).t.compute()
    vertices, triangles = soup(300)
    canted.Tiles.build(vertices, triangles, tmp_path / "store", tile_triangles=50)
    (tmp_path / "store" / "000003.bvh").write_bytes(b"CANTWIDE")
    with pytest.raises(ValueError, match="000003.bvh"):
        cd.closest_hit(tmp_path / "store", origins, directions).t.compute()
    with pytest.raises(TypeError, match="bvh is a int"):
        cd.closest_hit(3, origins, directions)
    with pytest.raises(ValueError, match="the last axis must have 3 numbers"):
        cd.contains(sources[0], np.zeros((4, 2)))
    with pytest.raises(ValueError, match="origins of shape"):
        cd.occluded(sources[0], origins, directions[:-1])


def test_the_model_of_costs():
    small = cd.cost(10**7, 10**6, 1)
    assert small["seconds"] == pytest.approx(10, rel=0.1) and small["limit"] == "trace" and small["tasks"] == 10
    assert cd.cost(10**7, 10**6, 2)["seconds"] == pytest.approx(small["seconds"] / 2, rel=0.05)
    # With a thousand workers, ten chunks keep ten of them busy.
    assert cd.cost(10**7, 10**6, 1000)["seconds"] >= small["seconds"] / 10
    huge = cd.cost(10**12, 10**10, 1000)
    assert huge["tasks"] == 10**6 and huge["limit"] == "move"
    assert cd.cost(10**9, 10**10, 10, coherent=False)["read_bytes"] > 10 * cd.cost(10**9, 10**10, 10)["read_bytes"]
    # Chunks of a thousand rays are more tasks than a scheduler starts in time.
    assert cd.cost(10**9, 10**6, 1000, chunk=1000, network=10**12)["limit"] == "schedule"


def test_the_simulation_is_the_formula_where_all_is_even():
    for asked in ((10**7, 10**6, 1), (10**8, 10**7, 2), (10**9, 10**9, 10)):
        even = cd.simulate(*asked)
        assert even["seconds"] == pytest.approx(cd.cost(*asked)["seconds"], rel=0.05)
        assert even["ideal_seconds"] <= even["seconds"]


def test_the_simulation_shows_stragglers_skew_and_shared_storage():
    even = cd.simulate(10**8, 10**7, 10)["seconds"]
    # A slow worker costs a chunk of its own; smaller chunks, less of it.
    coarse, fine = (cd.simulate(10**8, 10**7, 10, slow_workers=1, slowness=10.0, chunk=chunk) for chunk in (10**6, 10**5))
    assert even < fine["seconds"] < coarse["seconds"] < 10 * even and fine["last_seconds"] < coarse["last_seconds"] / 10
    assert cd.simulate(10**8, 10**7, 10, slow_workers=10, slowness=3.0)["seconds"] == pytest.approx(3 * even, rel=0.1)
    skewed = cd.simulate(10**8, 10**7, 10, skew=1.0)
    assert skewed["last_seconds"] > 0.5 and skewed == cd.simulate(10**8, 10**7, 10, skew=1.0) != cd.simulate(10**8, 10**7, 10, skew=1.0, seed=1)
    # Tiles of 60 GB, of which each worker holds a part, from storage that is as fast as one worker.
    limits = {"coherent": False, "storage": 1 << 30}
    assert cd.simulate(10**8, 10**9, 10, **limits)["seconds"] > 5 * cd.simulate(10**8, 10**9, 10, coherent=False)["seconds"]


def test_the_model_predicts_measured_runs(cluster, tmp_path):
    """Within a factor: machines of tests do other work meanwhile."""
    vertices, triangles = soup(40_000)
    bvh = canted.Bvh(vertices, triangles)
    bvh.save(tmp_path / "mesh.bvh")
    store = tmp_path / "store"
    tiles = canted.Tiles.build(vertices, triangles, store, tile_triangles=1000)
    origins, directions = rays(shape=(400_000,))
    n, chunk, memory = len(origins), 40_000, 300_000

    def seconds(call):
        start = time.perf_counter()
        call()
        return time.perf_counter() - start

    ray_seconds = seconds(lambda: bvh.closest_hit(origins, directions, threads=1)) / n
    workers = list(cluster.scheduler_info()["workers"])
    rates = {"ray_seconds": ray_seconds, "chunk": chunk, "task_seconds": 5e-3}
    # Opened, as the model counts from memory.
    cluster.run(lambda: cd.closest_hit(tmp_path / "mesh.bvh", origins[:10], directions[:10]).t.compute(scheduler="sync"))
    for n_workers in (1, 2):
        query = cd.closest_hit(tmp_path / "mesh.bvh", origins, directions, chunk=chunk).t
        took = seconds(lambda: cluster.compute(query, workers=workers[:n_workers]).result())
        for model in (cd.cost, cd.simulate):
            assert 0.25 < took / model(n, len(triangles), n_workers, **rates)["seconds"] < 4
    # Incoherent rays read all tiles for each chunk, as the model says.
    small = canted.Tiles(store, memory=memory)
    took = seconds(lambda: [small.closest_hit(origins[k : k + chunk], directions[k : k + chunk], threads=1) for k in range(0, n, chunk)])
    predicted = cd.cost(n, len(triangles), 1, memory=memory, coherent=False, **rates)
    n_bytes = small.stats()["reads"] * tiles.stats()["bytes"] / tiles.stats()["tiles"]
    assert 0.25 < n_bytes / predicted["read_bytes"] < 4 and took > predicted["trace_seconds"] / 4
