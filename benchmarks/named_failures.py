# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Public reports about pairs of boxes, replayed: the poses are in `named_failures.yaml`.

`python -m benchmarks.named_failures` asks every model and every other engine that is installed, and
writes named_failures.md. Answers of models have to be right to rounding. Those of other engines
have the bound of their report, or what float32 and a usual preference for faces cost. The exit
status is 1 if `exact` or `mlp` fails a report.
"""
from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from box_contact_ros import Contact, Contacts
from box_contact_ros.extras import require

from . import output
from .contestant import Contestant, Manifold, add_models, ours, packages_of
from .engines import installed
from .judge import PRESSED, judge, two_touches
from .pose_sets import Pairs
from .stability import GATED, MODELS

FILE = Path(__file__).with_suffix('.yaml')
SINGLE = 1e-6  # error that float32 costs, of the size
PREFERENCE = 0.06  # share of the depth by which engines may prefer a face to an edge, 5 % usually


@dataclass(frozen=True, kw_only=True)
class NamedFailure:
    """A pair of boxes of a public report; units are the report's."""

    id: str
    repo: str
    number: int
    kind: str  # 'issues' or 'pull'
    report: str
    source: str  # where the numbers stand
    pose_a: list[float]
    size_a: list[float]
    pose_b: list[float]
    size_b: list[float]
    separation: float  # in 60 digits, rounded once
    normal: list[float] | None = None  # None: apart
    bound: float = 0.0
    """Error of another engine's depth that passes, if larger than what it may have anyway."""

    @property
    def link(self) -> str:
        """Return the thread's address."""
        return f'https://github.com/{self.repo}/{self.kind}/{self.number}'

    @property
    def pairs(self) -> Pairs:
        """Return the pair as a set of one."""
        return Pairs(*(np.array([part], dtype=np.float64) for part in (
            self.pose_a, self.pose_b, self.size_a, self.size_b)))

    @property
    def lenience(self) -> float:
        """Return the error that another engine's depth may have."""
        return max(self.bound, SINGLE * float(self.pairs.size[0]),
                   PREFERENCE * abs(self.separation))


def load() -> dict[str, NamedFailure]:
    """Return the reports by id."""
    with FILE.open(encoding='utf-8') as file:
        return {one['id']: NamedFailure(**one) for one in yaml.safe_load(file)}


def fault(one: NamedFailure, found: Manifold, bound: float) -> str:
    """Return what is wrong with an answer, '' if nothing; bound: error of lengths that passes."""
    pairs, size = one.pairs, float(one.pairs.size[0])
    unsure = abs(one.separation) <= max(two_touches(*pairs)[0], min(bound, SINGLE * size))
    if not len(found.points):
        return '' if one.separation > 0.0 or unsure else 'missed'
    if one.separation > 0.0 and not unsure:
        return 'invented'
    deepest = int(np.argmax(found.depths))
    depth = float(found.depths[deepest])  # NaN: none is given
    if abs(depth + one.separation) > bound:
        return f'depth {depth:.3g} for {-one.separation:.3g}'
    contact = Contact(True, one.separation, found.normals[deepest], found.points[deepest],
                      np.nan, np.full((3, 3), np.nan))
    along = judge(*pairs, Contacts.of([contact])).along[0]
    if along < one.separation - bound:  # NaN: no normal is given
        return f'normal {-along:.3g}'
    # Models press boxes that just touch in.
    reach = bound + max(0.0, -one.separation, depth) + PRESSED * size
    beyond = pairs.beyond(found.points).max()
    return '' if beyond <= reach else f'point {beyond:.3g} outside'


def replay(engine: Contestant, failures: Mapping[str, NamedFailure], bounds: Mapping[str, float],
           ) -> dict[str, str]:
    """Return by id what is wrong with an engine's answer, '' if nothing."""
    return {name: fault(one, engine.read(engine.prepare(one.pairs)[0]()), bounds[name])
            for name, one in failures.items()}


def table(failures: Mapping[str, NamedFailure], found: Mapping[str, Mapping[str, str]]) -> str:
    """Return a row for each report: the thread, what happened, and what is wrong by whom."""
    return output.markdown_table(
        ['Report', 'What happened', 'Wrong with'],
        [[f'[{one.repo.partition("/")[2]} {one.number}]({one.link})'
          f'{"*" if one.source.startswith("nearest") else ""}', one.report,
          '; '.join(f'{engine}: {faults[name]}' for engine, faults in found.items()
                    if faults[name])] for name, one in failures.items()], words=3)


def main(args: Sequence[str] | None = None) -> int:
    """Replay all for models and every other engine, print, write; 1 if a gated model fails one."""
    from tqdm import tqdm

    parser = output.report_parser(
        'named_failures', __doc__, quick='the models alone', out='named_failures.md')
    add_models(parser)
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options, part=bool(options.model))
    failures = load()
    require('report', 'soup')
    rivals, missing = ([], []) if options.quick else installed()
    engines = [*map(ours, MODELS), *map(ours, options.model), *rivals]
    bounds = {name: one.lenience for name, one in failures.items()}
    found = {engine.name: replay(engine, failures, bounds)
             for engine in tqdm(engines, desc='named failures', unit='contestant')}
    passed = '; '.join(f'{name} {sum(not fault for fault in faults.values())}'
                       for name, faults in found.items())
    print(output.write_page(
        folder, 'named_failures', args, count=len(failures), passed=passed,
        machine=output.machine(packages_of(engines)), table=table(failures, found),
        skipped=''.join(f'\n\nLeft out: {line}.' for line in missing)))
    return int(any(found[model][report] for model in GATED for report in failures))


if __name__ == '__main__':
    sys.exit(main())
