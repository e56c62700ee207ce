# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments that several reports have in common, on top of those of all programs."""
from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from box_contact_ros.solver.arguments import program_parser, within


def report_parser(program: str, doc: str | None, *, quick: str = '', seed: int | None = None,
                  out: str = '', **options: Any) -> argparse.ArgumentParser:
    """Return the parser of a report, whose help begins with `doc`.

    quick: help of `--quick`; seed: default of `--seed`; out: the files that go to the folder of
    `--out`. The report has those of them that are given.
    """
    parser = program_parser(program, doc, **options)
    if quick:
        parser.add_argument('--quick', action='store_true', help=quick)
    if seed is not None:
        parser.add_argument('--seed', type=within(0), default=seed,
                            help='seed of the random numbers (default: %(default)s)')
    if out:
        parser.add_argument('--out', type=Path, metavar='DIR', help=f'folder for {out} (default: '
                            'docs/results, or quick-results with --quick)')
    return parser
