"""Chooses the workers of an experiment's trials from the command line."""

import argparse

from experiments.study.workers import LocalWorkers, Workers


def workers_of(options: argparse.Namespace) -> Workers:
    if options.cluster:
        from experiments.study.cluster_workers import ClusterWorkers  # distributed is slow to import, and an extra

        return ClusterWorkers(options.cluster)
    return LocalWorkers(options.workers)
