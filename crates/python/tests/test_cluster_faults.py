"""What happens to queries on Dask when workers, schedulers, clients and files fail: the bits of the local call, or an error that says what is wrong."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from concurrent.futures import CancelledError

import numpy as np
import pytest

import canted
from test_tiles import rays, soup

distributed = pytest.importorskip("distributed", reason="distributed is not installed")
da = pytest.importorskip("dask.array", reason="dask.array is not installed")
cd = pytest.importorskip("canted.distributed")

import clusters

QUERIES = ("closest_hit", "occluded", "all_hits", "crossings", "contains", "nearest", "signed_distance")
FIELDS = ("t", "primitive", "u", "v", "distance", "position")


@pytest.fixture(scope="module")
def faulty(tmp_path_factory):
    """A client of two workers, and what makes them fail."""
    faults = clusters.Faults(tmp_path_factory.mktemp("faults"))
    with clusters.local(2) as client:
        client.register_plugin(faults)
        yield client, faults


@pytest.fixture
def fresh(tmp_path):
    """The same for one test, which may leave it with a worker less."""
    faults = clusters.Faults(tmp_path)
    with clusters.local(2) as client:
        client.register_plugin(faults)
        yield client, faults


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    """A BVH, and a store of its triangles."""
    store = tmp_path_factory.mktemp("mesh") / "store"
    vertices, triangles = soup()
    canted.Tiles.build(vertices, triangles, store, tile_triangles=150)
    return canted.Bvh(vertices, triangles), store


def ask(module, query, bvh, **options):
    """A query of this name: rays, or their origins as points."""
    origins, directions = (array.reshape(-1, 3) for array in rays())
    if query in ("contains", "signed_distance"):
        return getattr(module, query)(bvh, origins, "parity", **options)
    return getattr(module, query)(bvh, origins, *([directions] if query != "nearest" else []), **options)


class Local:
    """The queries of a BVH as functions."""

    def __getattr__(self, name):
        return lambda bvh, *arguments: getattr(bvh, name)(*arguments)


def assert_same(found, local):
    if isinstance(local, np.ndarray):
        return np.testing.assert_array_equal(found.compute(), local)
    names = [name for name in FIELDS if hasattr(local, name)]
    for name, values in found.compute(*names).items():
        np.testing.assert_array_equal(values, getattr(local, name), err_msg=name)


@pytest.mark.parametrize("query", QUERIES)
def test_a_worker_killed_in_a_query_costs_its_tasks(faulty, mesh, query):
    (client, faults), (bvh, store) = faulty, mesh
    before = set(clusters.pids(client).values())
    (faults.folder / "kill").touch()
    assert_same(ask(cd, query, store, chunk=101), ask(Local(), query, bvh))
    assert not (faults.folder / "kill").exists()
    client.wait_for_workers(2, timeout=60)
    clusters.wait_until("another worker replaces the one that was killed", lambda: len(before & set(clusters.pids(client).values())) == 1)


def test_a_worker_killed_in_a_picture_costs_its_tasks(fresh):
    canted_render = pytest.importorskip("canted_render")
    client, faults = fresh
    (faults.folder / "kill").touch()
    picture = cd.render(size=(32, 18), spp=8, parts=5, client=client)
    np.testing.assert_array_equal(picture, canted_render.render(size=(32, 18), spp=8))
    assert not (faults.folder / "kill").exists()


def test_a_task_that_kills_every_worker_ends_with_an_error(fresh, mesh):
    (client, faults), (_, store) = fresh, mesh
    before = client.run_on_scheduler(lambda dask_scheduler: dask_scheduler.allowed_failures)
    client.run_on_scheduler(set_allowed_failures, n=1)
    (faults.folder / "always").touch()
    try:
        with pytest.raises(distributed.KilledWorker, match="canted"):
            ask(cd, "occluded", store).compute()
    finally:
        (faults.folder / "always").unlink()
        client.run_on_scheduler(set_allowed_failures, n=before)


def set_allowed_failures(n, dask_scheduler):
    dask_scheduler.allowed_failures = n


def test_a_slow_worker_gets_fewer_tasks(fresh, mesh):
    (client, faults), (bvh, store) = fresh, mesh
    slow, fast = clusters.pids(client).values()
    before = [faults.count(pid) for pid in (slow, fast)]
    (faults.folder / f"slow-{slow}").touch()
    assert_same(ask(cd, "closest_hit", store, chunk=50), ask(Local(), "closest_hit", bvh))
    of_slow, of_fast = (faults.count(pid) - n for pid, n in zip((slow, fast), before))
    assert of_slow + of_fast >= 40 and of_slow < of_fast
    (faults.folder / f"slow-{slow}").unlink()


def test_a_worker_of_another_version_is_refused_by_name(fresh, mesh):
    (client, _), (_, store) = fresh, mesh
    other = list(clusters.pids(client))[:1]
    client.run(set_version, "0.0.1", workers=other)
    message = f"this worker has canted 0.0.1, the client {canted.__version__}; install one version on all"
    with pytest.raises(RuntimeError, match=message):
        ask(cd, "closest_hit", store, chunk=20).t.compute()
    client.run(set_version, canted.__version__, workers=other)
    ask(cd, "closest_hit", store).t.compute()


def set_version(version):
    from canted.distributed import worker

    worker.__version__ = version


def test_workers_with_other_instructions_give_the_same_bits(fresh, mesh, tmp_path):
    """One worker uses the instructions of every machine. Tiles have no such choice: those of a worker are what it detects."""
    (client, _), (bvh, _) = fresh, mesh
    if bvh.stats()["simd"] == "scalar":
        pytest.skip("this machine has no vector instructions")
    bvh.save(tmp_path / "mesh.bvh")
    other = list(clusters.pids(client))[:1]
    client.run(use_simd, "scalar", workers=other)
    try:
        for query in QUERIES:
            for source in (bvh, tmp_path / "mesh.bvh"):
                assert_same(ask(cd, query, source, chunk=50), ask(Local(), query, bvh))
        assert {name for names in client.run(instructions).values() for name in names} == {"scalar", bvh.stats()["simd"]}
    finally:
        client.run(use_simd, None, workers=other)


def use_simd(name):
    from canted import Bvh
    from canted._canted import with_simd
    from canted.distributed import worker

    class Other:
        """What opens BVHs that are traced with these instructions."""

        @staticmethod
        def _from_bytes(data):
            return with_simd(Bvh._from_bytes(data), name)

        @staticmethod
        def load(path):
            return with_simd(Bvh.load(path), name)

    worker._OPEN.clear()
    worker.Bvh = Bvh if name is None else Other


def instructions():
    from canted.distributed import worker

    return [bvh.stats()["simd"] for bvh in worker._OPEN.values() if "simd" in bvh.stats()]


def damages():
    yield "missing", lambda path: path.unlink()
    yield "truncated", lambda path: path.write_bytes(path.read_bytes()[:-9])
    yield "flipped", lambda path: path.write_bytes(flipped(path.read_bytes()))


def flipped(data):
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 4]) + data[middle + 1 :]


@pytest.mark.parametrize("damage", [pytest.param(damage, id=name) for name, damage in damages()])
@pytest.mark.parametrize("name", ["000003.bvh", "000002.numbers"])
def test_a_damaged_tile_is_an_error_that_names_it(faulty, mesh, tmp_path, name, damage):
    (_, _), (_, store) = faulty, mesh
    shutil.copytree(store, tmp_path / "store")
    damage(tmp_path / "store" / name)
    for query in ("closest_hit", "contains"):
        found = ask(cd, query, tmp_path / "store", chunk=500)
        with pytest.raises((ValueError, OSError), match=name):
            (found.t if query == "closest_hit" else found).compute()


CLIENT = """
import sys, time
import dask.array as da
import numpy as np
import canted.distributed as cd
from distributed import Client

def late(block):
    time.sleep(0.2)
    return block

with Client(sys.argv[1]) as client:
    origins = da.from_array(np.ones((1000, 3)), chunks=(10, 3)).map_blocks(late)
    hits = cd.closest_hit(sys.argv[2], origins, [0.0, 0.1, 1.0]).persist()
    print("started", flush=True)
    hits.t.compute()
"""


def test_a_client_that_is_killed_leaves_nothing_behind(faulty, mesh):
    (client, _), (bvh, store) = faulty, mesh
    command = [sys.executable, "-c", CLIENT, client.scheduler.address, str(store)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "started\n"
        clusters.wait_until("its tasks are known", lambda: n_tasks(client) > 50)
        other.kill()
    clusters.wait_until("its tasks are forgotten", lambda: n_tasks(client) == 0)
    assert_same(ask(cd, "closest_hit", store, chunk=500), ask(Local(), "closest_hit", bvh))


def n_tasks(client):
    return client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks))


def test_clusters_listen_on_loopback_and_end(mesh):
    psutil = pytest.importorskip("psutil")
    with clusters.local(1) as client:
        found = [os.getpid(), *clusters.pids(client).values()]
        found += [child.pid for child in psutil.Process().children(recursive=True)]
        listening = {end.laddr for pid in set(found) for end in psutil.Process(pid).net_connections("inet") if end.status == "LISTEN"}
        port = int(client.scheduler.address.rsplit(":", 1)[1])
        assert port in {end.port for end in listening} and {end.ip for end in listening} == {"127.0.0.1"}
        worker_port = int(next(iter(clusters.pids(client))).rsplit(":", 1)[1])
    for ended in (port, worker_port):
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", ended), timeout=5)


def test_a_query_can_be_started_again_when_the_scheduler_was_restarted(mesh):
    bvh, store = mesh
    origins, directions = (array.reshape(-1, 3) for array in rays())
    # Pickled by value: workers do not import tests.
    slow = da.from_array(origins, chunks=(50, 3)).map_blocks(lambda block: time.sleep(0.1) or block)
    port = clusters.free_port()
    address = f"tcp://127.0.0.1:{port}"
    with clusters.scheduler("127.0.0.1", port) as scheduler, clusters.worker("127.0.0.1", address):
        with distributed.Client(address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(1, timeout=60)
            future = client.compute(cd.closest_hit(store, slow, directions).t)
            time.sleep(0.5)
            os.killpg(scheduler.pid, signal.SIGKILL)
            with pytest.raises(CancelledError, match="lost the connection to the scheduler"):
                future.result(timeout=60)
    with clusters.scheduler("127.0.0.1", port), clusters.worker("127.0.0.1", address):
        with distributed.Client(address, timeout=60, set_as_default=False) as client:
            t = client.compute(cd.closest_hit(store, slow, directions).t).result(timeout=60)
            np.testing.assert_array_equal(t, bvh.closest_hit(origins, directions).t)
