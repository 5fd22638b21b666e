"""`mudskipper experiment campaign`: many simulated walks, which the same command continues."""

import argparse

from command_line import exit_codes
from command_line.experiments.conduct import conduct_bench
from command_line.experiments.workers import workers_of
from command_line.screen import complain
from experiments.campaign.campaign import run_campaign
from experiments.campaign.campaign_file import load_campaign
from firmware_host.configuration.file_problems import ConfigurationError


def campaign(options: argparse.Namespace) -> int:
    try:
        loaded = load_campaign(options.file)
    except ConfigurationError as problem:  # before a folder is made
        complain(*problem.problems)
        return exit_codes.CONFIGURATION
    return conduct_bench(
        options,
        "walks",
        lambda session: run_campaign(loaded, session, workers_of(options)),
        run_campaign.__module__,
        folder_name=loaded.name,
        needs="pyarrow",
    )
