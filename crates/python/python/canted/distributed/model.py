"""What queries take: a formula, and a simulation of what the formula leaves out."""

import heapq
import random

from .queries import CHUNK


def cost(rays, triangles, workers, *, ray_seconds=1e-6, triangle_bytes=60, memory=8 << 30, read=1 << 30, network=1 << 30, chunk=CHUNK, task_seconds=1e-3, coherent=True):
    """What a query takes, by a simple model: a dict of seconds, moved bytes and bytes of memory.

    Work is divided evenly, with a last round that is not full; the scheduler starts a task after the other. A BVH that fits into the memory of a worker is read
    once by each; of a larger one, coherent rays read each tile that they reach once for every batch of a million rays of a worker, and incoherent ones read
    all tiles.

    Parameters
    ----------
    rays, triangles, workers : int
        What is asked, of how large a mesh, of how many workers of one thread.
    ray_seconds : float
        Of one ray on one thread with the BVH in memory.
    triangle_bytes : float
        Of a tile, for each triangle.
    memory : float
        Bytes of tiles that a worker holds.
    read, network : float
        Bytes a second that a worker reads, and that the network of the client or of all rays carries.
    chunk : int
        Rays of a task.
    task_seconds : float
        Of the scheduler for a task.
    coherent : bool
        Whether the rays of a chunk are close to each other: they then need about the square root of the part of tiles that a chunk is of all rays, at least one.
    """
    tasks = max(1, -(-rays // chunk))
    rounds = -(-tasks // workers)
    size = triangles * triangle_bytes
    if size <= memory:
        reads = size
    else:
        batches = rounds * max(1, chunk // (1 << 20))
        part = min(1.0, (chunk / max(rays, 1)) ** 0.5) if coherent else 1.0
        reads = batches * size * part
    traced = rounds * min(chunk, rays) * ray_seconds
    scheduled = tasks * 2 * task_seconds
    moved = rays * (28 + 17)
    seconds = max(traced + reads / read, scheduled, moved / network)
    parts = {"trace": traced, "read": reads / read, "schedule": scheduled, "move": moved / network}
    return {
        "seconds": seconds,
        "limit": max(parts, key=parts.get),
        "moved_bytes": moved,
        "read_bytes": reads * min(workers, tasks),
        "memory_bytes": min(size, memory) + chunk * 200,
        "tasks": tasks,
        "is_held": size <= memory,
        **{f"{name}_seconds": value for name, value in parts.items()},
    }


def simulate(rays, triangles, workers, *, slow_workers=0, slowness=2.0, skew=0.0, storage=None, seed=0, **rates):
    """What a query takes, task by task: with slow workers, chunks that differ, and storage that all workers share.

    A free worker gets the next chunk when the scheduler has started it and the network has carried its rays; it waits for storage that others read from.

    Parameters
    ----------
    rays, triangles, workers, **rates
        As for cost.
    slow_workers : int
        Workers that take longer.
    slowness : float
        How many times as long.
    skew : float
        Standard deviation of the logarithm of the time of a chunk and of the tiles that it reads, whose means stay.
    storage : float, optional
        Bytes a second that all workers together read. Default: no limit.
    seed : int
        Of the random numbers.

    Returns
    -------
    dict
        seconds; ideal_seconds, if the work were divided evenly; last_seconds, in which some worker had nothing left to do.
    """
    whole = cost(rays, triangles, workers, **rates)
    n, n_readers = whole["tasks"], min(workers, whole["tasks"])
    rounds = -(-n // workers)
    # Of a task, or of the first one of a worker that holds the whole BVH afterwards.
    n_reads = 1 if whole["is_held"] else rounds
    trace, read, read_bytes = whole["trace_seconds"] / rounds, whole["read_seconds"] / n_reads, whole["read_bytes"] / n_readers / n_reads
    numbers = random.Random(seed)
    free = [(0.0, i) for i in range(workers)]
    ends, busy, carried, shared = [0.0] * workers, 0.0, 0.0, 0.0
    for _ in range(n):
        ready, i = heapq.heappop(free)
        carried += max(whole["schedule_seconds"], whole["move_seconds"]) / n
        factor = numbers.lognormvariate(-skew * skew / 2, skew)
        start = max(ready, carried)
        reading = 0.0 if whole["is_held"] and ends[i] else factor * read
        if storage and reading:
            shared = max(shared, start) + factor * read_bytes / storage
            start = max(start, shared - reading)
        work = (reading + factor * trace) * (slowness if i < slow_workers else 1.0)
        busy += work
        ends[i] = start + work
        heapq.heappush(free, (ends[i], i))
    return {"seconds": max(ends), "ideal_seconds": busy / workers, "last_seconds": max(ends) - min(ends)}
