"""Runs a planned benchmark in shards with HyperQueue on this machine.

Usage: hyperqueue_bench.py TAGALONG BENCHMARK_DIRECTORY CORES SHARDS
"""

import os
import sys

from hyperqueue import Job, LocalCluster
from hyperqueue.cluster import WorkerConfig


def main(tagalong, folder, cores, shards):
    with LocalCluster() as cluster:
        cluster.start_worker(WorkerConfig(cores=int(cores)))
        client = cluster.client()
        job = Job(default_workdir=os.getcwd())
        for part in range(1, int(shards) + 1):
            command = [tagalong, "bench", "run", "-o", folder, "--shard", f"{part}/{shards}"]
            job.program(command, cwd=os.getcwd(), stdout=None, stderr=None)
        client.wait_for_jobs([client.submit(job)])


if len(sys.argv) != 5:
    sys.exit(__doc__)
main(*sys.argv[1:])
