"""Clusters of several hosts, as docs/cluster.md starts them: network namespaces joined by a bridge, and a one-machine Slurm."""

import contextlib
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

import canted
from test_tiles import rays, soup

distributed = pytest.importorskip("distributed", reason="distributed is not installed")
cd = pytest.importorskip("canted.distributed")

import clusters

# Asks on the cluster at argv[1] about the store argv[2], and writes the answers to argv[3].
CLIENT = """
import sys
import numpy as np
import canted.distributed as cd
from distributed import Client

address, store, output = sys.argv[1:]
with Client(address, timeout=60) as client:
    client.wait_for_workers(2, timeout=60)
    rays = np.load(output)
    hits = cd.closest_hit(store, rays["origins"], rays["directions"], chunk=100).persist()
    found = hits.compute("t", "primitive")
    who = {worker.rsplit("/", 1)[1].rsplit(":", 1)[0] for workers in client.who_has(hits._answers).values() for worker in workers}
    try:
        import canted_render
        picture = cd.render(size=(32, 18), spp=6, parts=4, client=client)
    except ImportError:
        picture = []
    np.savez(output, **found, picture=picture, who=sorted(who))
"""


def ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


@contextlib.contextmanager
def hosts(n):
    """Namespaces with the addresses 10.77.N.1 and so on, joined by a bridge; nothing of them is left afterwards."""
    number = os.getpid() % 250
    name = f"canted{os.getpid() % 100_000}"
    names = [f"{name}h{i}" for i in range(n)]
    made = []
    try:
        # The bridge is in a namespace, too, so that the machine's own network stays as it is.
        for namespace in [name, *names]:
            ip("netns", "add", namespace)
            made.append(namespace)
            ip("-n", namespace, "link", "set", "lo", "up")
        ip("-n", name, "link", "add", "bridge", "type", "bridge")
        ip("-n", name, "link", "set", "bridge", "up")
        for i, namespace in enumerate(names):
            ip("-n", name, "link", "add", f"port{i}", "type", "veth", "peer", "name", "eth0", "netns", namespace)
            ip("-n", name, "link", "set", f"port{i}", "master", "bridge", "up")
            ip("-n", namespace, "addr", "add", f"10.77.{number}.{i + 1}/24", "dev", "eth0")
            ip("-n", namespace, "link", "set", "eth0", "up")
        yield [(("ip", "netns", "exec", namespace), f"10.77.{number}.{i + 1}") for i, namespace in enumerate(names)]
    finally:
        for namespace in made:
            subprocess.run(["ip", "netns", "del", namespace], capture_output=True)


@pytest.fixture
def three_hosts():
    if shutil.which("ip") is None:
        pytest.skip("the program ip of iproute2 is not installed")
    with contextlib.ExitStack() as stack:
        try:
            found = stack.enter_context(hosts(3))
        except subprocess.CalledProcessError as error:
            pytest.skip(f"network namespaces are not allowed here: {error.stderr.strip()}")
        yield found


def test_three_hosts(three_hosts, tmp_path):
    """A scheduler with a worker, another worker, and a client: each in a network of its own."""
    (first, one), (second, two), (third, _) = three_hosts
    vertices, triangles = soup()
    canted.Tiles.build(vertices, triangles, tmp_path / "store", tile_triangles=150)
    origins, directions = (array.reshape(-1, 3) for array in rays())
    np.savez(tmp_path / "answers.npz", origins=origins, directions=directions)
    address = f"tcp://{one}:8786"
    with clusters.scheduler(one, 8786, first), clusters.worker(one, address, first), clusters.worker(two, address, second):
        command = [*third, sys.executable, "-c", CLIENT, address, tmp_path / "store", tmp_path / "answers.npz"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
    found = np.load(tmp_path / "answers.npz")
    local = canted.Bvh(vertices, triangles).closest_hit(origins, directions)
    np.testing.assert_array_equal(found["t"], local.t)
    np.testing.assert_array_equal(found["primitive"], local.primitive)
    assert list(found["who"]) == [one, two]
    if len(found["picture"]):
        import canted_render

        np.testing.assert_array_equal(found["picture"], canted_render.render(size=(32, 18), spp=6))


PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue")


def jobs(environment):
    """States of the jobs."""
    return subprocess.run(["squeue", "--noheader", "--format=%T"], env=environment, capture_output=True, text=True).stdout.split()


@contextlib.contextmanager
def slurm(folder, environment):
    """A Slurm of this machine whose files are all in a folder, and its settings in an environment."""
    host = os.uname().nodename.split(".")[0]
    user = subprocess.run(["id", "-un"], check=True, capture_output=True, text=True).stdout.strip()
    for name in ("state", "spool", "run"):
        (folder / name).mkdir(parents=True)
    (folder / "run").chmod(0o755)
    (folder / "munge.key").write_bytes(bytes([7]) * 1024)
    (folder / "munge.key").chmod(0o400)
    port, node_port = clusters.free_port(), clusters.free_port()
    (folder / "slurm.conf").write_text(
        f"ClusterName=canted\nSlurmctldHost={host}(127.0.0.1)\nSlurmUser={user}\nSlurmdUser={user}\n"
        f"AuthType=auth/munge\nAuthInfo=socket={folder}/run/munge.socket\nSlurmctldPort={port}\nSlurmdPort={node_port}\n"
        f"StateSaveLocation={folder}/state\nSlurmdSpoolDir={folder}/spool\n"
        f"SlurmctldPidFile={folder}/run/slurmctld.pid\nSlurmdPidFile={folder}/run/slurmd.pid\n"
        "ProctrackType=proctrack/pgid\nTaskPlugin=task/none\nMpiDefault=none\nReturnToService=2\n"
        "SelectType=select/cons_tres\nSelectTypeParameters=CR_Core\nSlurmdParameters=config_overrides\n"
        f"NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=4000\nPartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP\n"
    )
    keys = [f"--key-file={folder}/munge.key", f"--socket={folder}/run/munge.socket", f"--pid-file={folder}/run/munged.pid"]
    keys += [f"--log-file={folder}/munged.log", f"--seed-file={folder}/run/munge.seed"]
    daemons = []

    def start(*words):
        with open(folder / f"{words[0]}.out", "w") as log:
            daemons.append(subprocess.Popen(words, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log))

    def is_idle():
        found = subprocess.run(["sinfo", "--noheader", "--format=%T"], env=environment, capture_output=True, text=True)
        return "idle" in found.stdout

    try:
        start("munged", "--force", "--foreground", *keys)
        clusters.wait_until("munged listens", (folder / "run" / "munge.socket").exists)
        start("slurmctld", "-D", "-i")
        start("slurmd", "-D", "-N", host)
        clusters.wait_until("the machine is idle", is_idle, 120)
        yield
    finally:
        # Jobs that are running would outlive the daemons.
        subprocess.run(["scancel", "--user", user], env=environment, capture_output=True)
        with contextlib.suppress(AssertionError):
            clusters.wait_until("no job is left", lambda: not jobs(environment), 30)
        for daemon in reversed(daemons):
            daemon.kill()
            daemon.wait()


def test_slurm_by_dask_jobqueue(tmp_path, monkeypatch):
    jobqueue = pytest.importorskip("dask_jobqueue", reason="dask-jobqueue is not installed")
    search = os.pathsep.join([os.environ["PATH"], "/usr/sbin"])
    for name in PROGRAMS:
        if shutil.which(name, path=search) is None:
            pytest.skip(f"{name} of Debian's slurm-wlm and munge is not installed")
    monkeypatch.setenv("PATH", search)
    monkeypatch.setenv("SLURM_CONF", str(tmp_path / "slurm" / "slurm.conf"))
    monkeypatch.chdir(tmp_path)
    vertices, triangles = soup()
    canted.Tiles.build(vertices, triangles, tmp_path / "store", tile_triangles=150)
    origins, directions = (array.reshape(-1, 3) for array in rays())
    scheduler = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    with slurm(tmp_path / "slurm", dict(os.environ)):
        options = {"cores": 1, "processes": 1, "memory": "1GB", "walltime": "00:10:00", "interface": "lo", "python": sys.executable}
        with jobqueue.SLURMCluster(**options, scheduler_options=scheduler, log_directory=str(tmp_path)) as cluster:
            cluster.scale(jobs=2)
            with distributed.Client(cluster, set_as_default=False) as client:
                client.wait_for_workers(2, timeout=90)
                found = client.compute(cd.closest_hit(tmp_path / "store", origins, directions, chunk=200).t).result(timeout=60)
                running = jobs(os.environ)
    assert running == ["RUNNING", "RUNNING"]
    np.testing.assert_array_equal(found, canted.Bvh(vertices, triangles).closest_hit(origins, directions).t)
