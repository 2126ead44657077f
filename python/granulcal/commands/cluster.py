"""The options `--ray` and `--ray-store` of commands that pour batches."""

import argparse

from granulcal.pours.cluster import Cluster
from granulcal.pours.part_store import PartStore

__all__ = ["add_cluster", "cluster_of"]


def add_cluster(parser: argparse.ArgumentParser, *, store: bool = True) -> None:
    """Adds the options; without `store` for a command that pours no batch that has parts."""
    parser.add_argument(
        "--ray",
        metavar="ADDRESS",
        help="pour on a Ray cluster: auto, local, HOST:PORT or ray://HOST:PORT; docs/cluster.md",
    )
    if not store:
        parser.set_defaults(ray_store=None)
        return
    parser.add_argument(
        "--ray-store",
        metavar="URL",
        help="folder that the cluster's workers write their parts to, for example s3://bucket/run",
    )


def cluster_of(options: argparse.Namespace) -> Cluster | None:
    """Returns the cluster that was asked for, None for this machine's threads.

    Raises:
        ValueError: a store without a cluster, or one that is no URL of a folder.
        ModuleNotFoundError: what its kind of URL needs is not installed.
    """
    if options.ray is None:
        if options.ray_store is not None:
            raise ValueError("--ray-store belongs to --ray: where is the cluster?")
        return None
    if options.ray_store is not None:
        # Before anything is started: workers would find out one by one.
        PartStore(options.ray_store)
    return Cluster(options.ray, store=options.ray_store)
