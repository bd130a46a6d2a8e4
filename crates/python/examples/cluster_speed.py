"""Processor time that Dask adds to queries and pictures of one machine, and what a second worker gains.

    python cluster_speed.py [RAYS] [ROUNDS] [SPP]

Default: a million rays, one round, no pictures; docs/cluster.md has numbers of longer runs. The plain call, the threads of Dask and clusters of one and
two workers of one thread answer the same chunks of a million rays, interleaved. Workers have opened the BVH, a file, before. `made` are rays that each chunk
makes where it is traced; `sent` are NumPy arrays of the client. Prints medians: seconds of processors of all processes, those of the plain call being 1,
and seconds of the clock; and what the processes of a cluster take when nothing is asked.
"""

import statistics
import sys
import tempfile
import time

import dask
import dask.array as da
import numpy as np
from distributed import Client, LocalCluster

import canted
import canted.distributed as cd

CHUNK = 1_000_000


def hills(n=700):
    """A height field of 980,000 triangles."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    vertices = np.stack([x, y, 5 * np.sin(0.05 * x) * np.cos(0.07 * y)], -1).reshape(-1, 3).astype(np.float32)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1)
    return vertices, np.concatenate([np.stack([a, a + n + 1, a + n + 2], -1), np.stack([a, a + n + 2, a + 1], -1)])


def rays(number, n=700):
    """A chunk of rays: origins above the hills and directions downwards, (2, CHUNK, 3)."""
    random = np.random.default_rng(number)
    above = random.random((CHUNK, 3), np.float32) * np.float32([n, n, 0]) + np.float32([0, 0, 50])
    return np.stack([above, random.random((CHUNK, 3), np.float32) - np.float32([0.5, 0.5, 1.5])])


def made(n_chunks):
    """Rays that are made where they are traced."""
    blocks = da.map_blocks(
        lambda block: rays(int(block[0, 0, 0])), da.arange(n_chunks, chunks=1)[None, :, None], chunks=((2,), (CHUNK,) * n_chunks, (3,)), dtype=np.float32
    )
    return blocks[0], blocks[1]


def processors(client):
    """Processor time of all processes."""
    return time.process_time() + (sum(client.run(time.process_time).values()) if client else 0)


def measured(call, client=None):
    """Processor time and time of a call."""
    clock, start = time.perf_counter(), processors(client)
    call()
    return processors(client) - start, time.perf_counter() - clock


def table(title, calls, n_rounds):
    """Prints medians of interleaved calls, the first of which is the plain one."""
    times = {name: [] for name in calls}
    for _ in range(n_rounds):
        for name, (call, client) in calls.items():
            times[name].append(measured(call, client))
    plain = statistics.median(found[0] for found in times[next(iter(calls))])
    for name, found in times.items():
        cpu, clock = (statistics.median(column) for column in zip(*found))
        print(f"{title:<16} {name:<22} {cpu:8.2f} s of processors  {cpu / plain:6.3f}  {clock:8.2f} s", flush=True)


def open_bvh(path):
    """Opens a BVH on a worker, as its first task does."""
    cd.closest_hit(path, [[0, 0, 9]], [0, 0, -1]).t.compute(scheduler="sync")


def queries(path, n_chunks, n_rounds, one, two):
    """The first hits: the least and the greatest t, so that results stay where they are."""
    bvh = canted.Bvh(*hills())
    bvh.save(path)
    given = [np.concatenate([rays(i)[k] for i in range(n_chunks)]) for k in range(2)]

    def plain(chunks):
        for origins, directions in chunks:
            t = bvh.closest_hit(origins, directions, threads=1).t
            t.min(), np.where(np.isfinite(t), t, 0).max()

    def asked(bvh, origins, directions):
        t = cd.closest_hit(bvh, origins, directions, chunk=CHUNK).t
        return t.min(), da.where(da.isfinite(t), t, 0).max()

    def on(client, arrays):
        return (lambda: dask.compute(*asked(path, *arrays()), scheduler=client)), client

    def threads(arrays):
        return (lambda: dask.compute(*asked(bvh, *arrays()), scheduler="threads", num_workers=1)), None

    def of_made():
        return made(n_chunks)

    def of_given():
        return given

    for client in (one, two):
        client.run(open_bvh, path)
    table("rays, made", {
        "plain": (lambda: plain(rays(i) for i in range(n_chunks)), None),
        "Dask's threads": threads(of_made),
        "one worker": on(one, of_made),
        "two workers": on(two, of_made),
    }, n_rounds)  # fmt: skip
    table("rays, sent", {
        "plain": (lambda: plain(zip(*(np.split(array, n_chunks) for array in given))), None),
        "Dask's threads": threads(of_given),
        "one worker": on(one, of_given),
        "two workers": on(two, of_given),
    }, n_rounds)  # fmt: skip


def pictures(spp, n_rounds, one, two):
    """The built-in scene."""
    import canted_render

    scene = {"size": (640, 360), "spp": spp}
    table("picture", {
        "plain": (lambda: canted_render.render(threads=1, **scene), None),
        "one worker": (lambda: cd.render(client=one, **scene), one),
        "two workers": (lambda: cd.render(client=two, **scene), two),
    }, n_rounds)  # fmt: skip


def main(n_rays=1_000_000, n_rounds=1, spp=0):
    """Starts the clusters and prints both tables."""
    with LocalCluster(n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0") as single:
        with LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0") as double:
            with Client(single, set_as_default=False) as one, Client(double, set_as_default=False) as two:
                for name, client in (("one worker", one), ("two workers", two)):
                    print(f"idle             {name:<22} {measured(lambda: time.sleep(2), client)[0] / 2:8.3f} s of processors a second", flush=True)
                with tempfile.TemporaryDirectory() as folder:
                    queries(folder + "/hills.bvh", n_rays // CHUNK, n_rounds, one, two)
                if spp > 0:
                    pictures(spp, n_rounds, one, two)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
