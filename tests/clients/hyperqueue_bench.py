"""Runs all tasks of a benchmark's plan with HyperQueue on this machine.

Usage: hyperqueue_bench.py TAGALONG BENCHMARK_DIRECTORY CORES
"""

import os
import sys

from hyperqueue import Job, LocalCluster
from hyperqueue.cluster import WorkerConfig


def main(tagalong, folder, cores):
    with open(os.path.join(folder, "plan.jsonl"), encoding="utf-8") as plan:
        count = sum(1 for _ in plan)
    with LocalCluster() as cluster:
        cluster.start_worker(WorkerConfig(cores=int(cores)))
        client = cluster.client()
        job = Job(default_workdir=os.getcwd())
        for task in range(1, count + 1):
            job.program([tagalong, "bench", "run", "-o", folder, "--task", str(task)],
                        cwd=os.getcwd(), stdout=None, stderr=None)
        client.wait_for_jobs([client.submit(job)])


main(*sys.argv[1:])
