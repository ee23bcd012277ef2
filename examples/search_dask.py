"""A search on a cluster
=====================

Search for the best sequence of collisions on a dask.distributed cluster.  The kernels are built
once here and travel to workers that do not find them.

Run:  ``python examples/search_dask.py [SCHEDULER]``

Without the address of a scheduler, one is started on this machine with two worker processes.
"""

import sys

from distributed import Client, LocalCluster

import dmoc
from dmoc.models.registry import find


def main(address: str | None) -> int:
    """Search with the cluster and print the tree's counts and the best sequence."""
    reference = find("puck_table")
    problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    cluster = (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
        if address is None
        else address
    )
    with Client(cluster) as client:
        workers = len(client.scheduler_info()["workers"])
        result = dmoc.search(problem, max_collisions=2, executor=client.get_executor())
    if address is None:
        cluster.close()
    print(
        f"{workers} workers, {len(result.nodes)} sequences in {result.seconds:.1f} s: "
        f"{result.counts}"
    )
    if result.best is None:
        print("no confirmed motion")
        return 1
    print(f"best: {result.best.name}, cost {result.best.cost:.6g}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else None))
