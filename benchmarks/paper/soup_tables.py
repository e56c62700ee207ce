# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables 3 and 4 and Figure 10 of the source paper: what a polygon soup costs, and its errors.

The patterns are placed as the paper writes: cubes may interpenetrate. Touching and near-parallel
cubes stand beside them. Times are CPU times of one thread on one pinned core, after a warm-up, with
garbage collection off. Like the paper's gprof, they leave out what other programs take meanwhile.
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import fcl
import numpy as np
from tqdm import tqdm

from box_contact_ros.models import soup
from box_contact_ros.solver.contact import Contacts

from .. import output
from ..contestant import Contestant, ours
from ..errors import degrees_between, distances
from ..pose_sets import CUBE, Pairs, at_depth, drawn, on_cube, stacks
from ..timing import cpu_milliseconds, no_garbage_collection, pinned, usable_cores
from .dataset import as_poses
from .tree import count_tests, tree

PAPER = {8: (1.10, 11233, 11.52), 10: (1.47, 14323, 15.47), 12: (1.85, 17911, 19.2),
         14: (1.94, 21789, 23.13), 16: (2.13, 24667, 24.63), 18: (2.31, 26517, 28.0),
         20: (2.72, 30475, 32.44), 22: (2.90, 35411, 36.77)}
"""The paper's figures by N: Table 3's mean time [ms]; Table 4's largest number of tests, and its
time [ms]."""
COARSE = (1, 2, 4)
"""Divisions N that the paper does not have: its Figure 10 ends where soup and network are equally
accurate."""
PAPER_NETWORK = 0.5  # the paper's time of its network [ms]
OVERLAP = 1e-3
"""Depth [m] of touching and near-parallel cubes of edge 2 where the accuracy is measured. At exact
touch the soup finds nothing in a part of the patterns."""
SEED = 20
WARM_UP = 30      # patterns before any that counts
REPEATS = 5       # timings of the pattern with the most tests; their median counts
SIEVE = 4
"""Divisions at which the tests of all patterns are counted. At each N of the tables, those of the
patterns with the most tests there are counted: of 4,000, the first had the most at N = 22, too."""
SIEVED = 200
COUNTED = 1000  # patterns of which the mean number of tests is taken


@dataclass(frozen=True)
class Counts:
    """How many patterns of a regime are looked at."""

    timed: int
    judged: int  # of how many the accuracy is measured
    sieved: int = 0  # among how many the one with the most tests is looked for


FULL = {'as written': Counts(3000, 0, 75_000), 'touching': Counts(3000, 1000),
        'near-parallel': Counts(1000, 1000)}
QUICK = {'as written': Counts(60, 0, 300), 'touching': Counts(60, 20),
         'near-parallel': Counts(20, 20)}
REGIMES = tuple(FULL)

Row = dict[str, Any]
"""A row of paper_soup.csv by column; that of the network has other columns."""


class SoupErrors(NamedTuple):
    """A soup, judged on a regime; a row per pattern that the soup answered."""

    point: np.ndarray  # [m]
    normal: np.ndarray  # [deg]
    depth: np.ndarray  # deepest contact minus the true depth [m]


@dataclass(frozen=True, kw_only=True)
class SoupResult:
    """All that is measured."""

    soups: Mapping[tuple[str, int], Row]  # by regime and N
    network: Row  # of `paper`, on the touching patterns that the soup's accuracy is measured on
    exact: float  # time of a call of model `exact` [ms]
    counts: Mapping[str, Counts]

    @property
    def rows(self) -> list[Row]:
        """Return the rows of paper_soup.csv."""
        return [*self.soups.values(), self.network]


def search(first: fcl.CollisionObject, second: fcl.CollisionObject) -> None:
    """Search for all pairs; FCL returns one of them, and goes on because costs are asked for."""
    fcl.collide(first, second, fcl.CollisionRequest(num_max_contacts=1, enable_contact=True,
                                                    enable_cost=True), fcl.CollisionResult())


def pair_count(contacts: Sequence[fcl.Contact]) -> int:
    """Return how many pairs of triangles meet; FCL gives one contact or two for each."""
    return len({(contact.b1, contact.b2) for contact in contacts})


def time_soup(divisions: int, patterns: Pairs, bar: tqdm) -> Row:
    """Return the columns of times of the soup of N divisions, and of its pairs of triangles."""
    boxes = soup.Soup(divisions)
    poses = list(zip(patterns.pose_a, patterns.pose_b))
    for a, b in poses[:WARM_UP]:
        pair = boxes.place(a, b, CUBE, CUBE)
        soup.collide(*pair), search(*pair)
    step, alone, pairs = np.empty((3, len(poses)))
    for row, (a, b) in enumerate(poses):
        pair = boxes.place(a, b, CUBE, CUBE)
        step[row], contacts = cpu_milliseconds(soup.collide, *pair)
        alone[row], _ = cpu_milliseconds(search, *pair)
        pairs[row] = pair_count(contacts)
        bar.update()
    touching = patterns.contacts().colliding
    p50, p99, longest = output.percentiles(alone, 50, 99, 100)
    return {
        'patterns': len(poses),
        'touching': int(touching.sum()),  # by SAT
        'misses': int((touching & (pairs == 0)).sum()),
        'step_mean_ms': float(step.mean()), 'alone_mean_ms': float(alone.mean()),
        'alone_p50_ms': p50, 'alone_p99_ms': p99, 'alone_max_ms': longest}


def most_tests(divisions: int, patterns: Pairs) -> Row:
    """Return the columns of the pattern with the most box tests."""
    tests = count_tests(tree(divisions), patterns)
    row = int(tests.argmax())
    most = soup.Soup(divisions).place(patterns.pose_a[row], patterns.pose_b[row], CUBE, CUBE)
    step, alone = (float(np.median([cpu_milliseconds(work, *most)[0] for _ in range(REPEATS)]))
                   for work in (soup.collide, search))
    return {'most_tests': int(tests[row]), 'most_tests_pairs': pair_count(soup.collide(*most)),
            'most_tests_step_ms': step, 'most_tests_alone_ms': alone}


def judge_soup(divisions: int, patterns: Pairs, exact: Contacts) -> SoupErrors:
    """Compare with `exact`; patterns without an answer of the soup are left out."""
    boxes, areas = soup.Soup(divisions), soup.mesh(CUBE, divisions).areas
    rows, points, normals, depths = [], [], [], []
    for row, (a, b) in enumerate(zip(patterns.pose_a, patterns.pose_b)):
        contacts = soup.collide(*boxes.place(a, b, CUBE, CUBE))
        answer = soup.point_and_normal(contacts, areas, areas)
        if answer is not None:
            rows.append(row)
            points.append(a[:3] + answer[0])
            normals.append(answer[1])
            depths.append(max(contact.penetration_depth for contact in contacts))
    return SoupErrors(
        point=distances(np.reshape(points, (-1, 3)), exact.point[rows]),
        normal=degrees_between(np.reshape(normals, (-1, 3)), exact.normal[rows]),
        depth=np.array(depths) + exact.separation[rows])


def time_calls(model: Contestant, patterns: Pairs) -> float:
    """Return the mean time of a call [ms], pair by pair as the soup is asked."""
    calls = model.prepare(patterns)

    def call_all() -> None:
        for call in calls:
            call()

    call_all()
    return cpu_milliseconds(call_all)[0] / len(calls)


def judge_network(model: Contestant, patterns: Pairs, exact: Contacts) -> Row:
    """Return a network's row on touching patterns."""
    found = model.solve(patterns)
    return {'model': model.name, 'regime': 'touching',
            'call_mean_ms': time_calls(model, patterns),
            'point_error_mean_m': float(distances(found.point, exact.point).mean()),
            'normal_error_mean_deg': float(degrees_between(found.normal, exact.normal).mean())}


def measure(written: np.ndarray, touching: np.ndarray, *, quick: bool = False) -> SoupResult:
    """Time and judge every N on every regime; external sets (n, 6), as written and touching."""
    counts = QUICK if quick else FULL
    timed = {name: count.timed for name, count in counts.items()}
    whole = on_cube(as_poses(written[:counts['as written'].sieved])[1])
    touch = on_cube(as_poses(touching)[1])
    patterns = {'as written': whole.rows(slice(timed['as written'])),
                'touching': touch.rows(slice(timed['touching'])),
                'near-parallel': drawn(stacks, np.random.default_rng(SEED), timed['near-parallel'])}
    sieved = whole.rows(np.argsort(-count_tests(tree(SIEVE), whole))[:SIEVED])
    # At exact touch a few are apart by rounding, and left out.
    pressed = touch.rows(slice(2 * counts['touching'].judged))
    judged = {'touching': at_depth(pressed, np.full(len(pressed.size), OVERLAP)),
              'near-parallel': patterns['near-parallel']}
    judged = {name: pairs.rows(slice(counts[name].judged)) for name, pairs in judged.items()}
    truth = {name: pairs.contacts() for name, pairs in judged.items()}
    soups: dict[tuple[str, int], Row] = {}
    work = len([*COARSE, *PAPER]) * sum(c.timed + c.judged for c in counts.values())
    with (pinned({usable_cores()[-1]}), no_garbage_collection(),
          tqdm(total=work, unit='pattern', mininterval=1.0) as bar):
        for divisions in (*COARSE, *PAPER):
            for regime in REGIMES:
                bar.set_description(f'soup, N = {divisions}, {regime}')
                row: Row = {'model': 'soup', 'divisions': divisions,
                            'triangles': 12 * divisions**2, 'regime': regime,
                            **time_soup(divisions, patterns[regime], bar),
                            'mean_tests': float(count_tests(tree(divisions), patterns[
                                regime].rows(slice(COUNTED))).mean())}
                if counts[regime].sieved:
                    row |= most_tests(divisions, sieved)
                if regime in judged:
                    errors = judge_soup(divisions, judged[regime], truth[regime])
                    row |= {
                        'judged': len(errors.point),
                        'point_error_mean_m': float(errors.point.mean()),
                        'point_error_max_m': float(errors.point.max()),
                        'normal_error_mean_deg': float(errors.normal.mean()),
                        'depth_error_mean_m': float(errors.depth.mean())}
                    bar.update(len(judged[regime].size))
                soups[regime, divisions] = row
        network = judge_network(ours('paper'), judged['touching'], truth['touching'])
        exact = time_calls(ours('exact'), judged['touching'])
    return SoupResult(soups=soups, network=network, exact=exact, counts=counts)


def _cell(value: float) -> str:
    """Return a number of tests or pairs, or a time [ms]."""
    if isinstance(value, int):
        return f'{value:,}'
    return f'{value:.3f}' if value < 0.1 else f'{value:.2f}'


def _with_growth(head: Sequence[str], rows: Sequence[Sequence[float]]) -> str:
    """Return a table with a row per N, and how many times the last N's figures are the first's."""
    growth = [f'× {last / first:.2f}' for first, last in zip(rows[0][1:], rows[-1][1:])]
    return output.markdown_table(head, [*([_cell(value) for value in row] for row in rows),
                                        ['growth', *growth]], words=0)


def share_as_written(result: SoupResult, divisions: int) -> float:
    """Return the share of placements as written that the paper's times at an N suggest.

    The paper's mean time divided by its longest is the mean number of box tests divided by the
    largest, where the rest of the patterns only touch.
    """
    written, touching = (result.soups[regime, divisions] for regime in ('as written', 'touching'))
    mean, _, longest = PAPER[divisions]
    wanted = mean / longest * written['most_tests']
    return (wanted - touching['mean_tests']) / (written['mean_tests'] - touching['mean_tests'])


def table_of_errors(result: SoupResult) -> str:
    """Return errors by N and regime, of coarse soups and the paper's ends, then the network's."""
    def cell(row: Row, column: str, unit: float, digits: int = 0) -> str:
        return f'{unit * row[column]:.{digits}f}' if column in row else ''

    head, regimes = ['N', 'misses at exact touch'], REGIMES[1:]
    for regime in regimes:
        head += [f'{regime}: point, mean', 'max', 'normal, mean', 'depth, mean']
    found = {str(n): [result.soups[regime, n] for regime in regimes]
             for n in (*COARSE, min(PAPER), max(PAPER))}
    found['`paper`'] = [result.network, {}]
    lines = []
    for label, (touching, parallel) in found.items():
        line = [label, f'{100 * touching["misses"] / touching["touching"]:.0f} %'
                if 'misses' in touching else '']
        for row in (touching, parallel):
            line += [cell(row, 'point_error_mean_m', 1e3, 1), cell(row, 'point_error_max_m', 1e3),
                     cell(row, 'normal_error_mean_deg', 1.0, 1),
                     cell(row, 'depth_error_mean_m', 1e3)]
        lines.append(line)
    return output.markdown_table(head, lines, words=0)


def section_3(result: SoupResult) -> str:
    """Return Table 3, mean times by N and regime, with its notes."""
    columns = ('alone_mean_ms', 'step_mean_ms')
    head = ['N', 'triangles per cube', 'paper', *(
        f'{regime}: {title}' for regime in REGIMES for title in ('FCL alone', 'step'))]
    table = _with_growth(head, [
        [n, 12 * n**2, PAPER[n][0], *(result.soups[regime, n][column] for regime in REGIMES
                                      for column in columns)] for n in PAPER])
    network = result.network['call_mean_ms']
    ends = min(PAPER), max(PAPER)
    return output.page(
        'benchmarks/paper/pages/table_3', counts=result.counts, table=table, low=ends[0],
        high=ends[1], network=1e3 * network, exact=1e3 * result.exact,
        written=[result.soups['as written', n]['alone_mean_ms'] / network for n in ends],
        share=[100 * share_as_written(result, n) for n in ends],
        part=[100 * PAPER[n][0] / PAPER[n][2] for n in ends])


def section_4(result: SoupResult) -> str:
    """Return Table 4, the pattern with the most box tests by N, with its notes."""
    rows = [result.soups['as written', n] for n in PAPER]
    table = _with_growth(
        ['N', 'paper: tests', 'box tests', 'paper: ms', 'FCL alone, ms', 'step, ms',
         'triangles that meet'],
        [[n, tests, row['most_tests'], took, row['most_tests_alone_ms'], row['most_tests_step_ms'],
          row['most_tests_pairs']] for (n, (_, tests, took)), row in zip(PAPER.items(), rows)])
    by_paper = [row['most_tests'] / PAPER[row['divisions']][1] for row in rows]
    return output.page('benchmarks/paper/pages/table_4', table=table, repeats=REPEATS, sieve=SIEVE,
                       sieved=SIEVED, count=result.counts['as written'].sieved,
                       least=min(by_paper), most=max(by_paper))


def section_errors(result: SoupResult) -> str:
    """Return the soup's errors, and what differs from the paper."""
    along = 1e3 * result.soups['near-parallel', max(PAPER)]['point_error_mean_m']
    return output.page('benchmarks/paper/pages/soup_errors', counts=result.counts, along=along,
                       table=table_of_errors(result))


def section_figure_10(result: SoupResult) -> str:
    """Return Figure 10's caption, which tells from which N on the soup is more accurate."""
    error = result.network['point_error_mean_m']
    soups = {n: result.soups['touching', n]['point_error_mean_m'] for n in (*COARSE, *PAPER)}
    better = next((n for n, soup in soups.items() if soup < error), None)
    words = ('No soup here is as accurate as the network' if better is None else
             'No N is as inaccurate as the network' if better == min(soups) else
             f'The soup is more accurate from N = {better} on')
    return output.page('benchmarks/paper/pages/figure_10', low=min(soups), words=words,
                       triangles=12 * min(soups)**2, error=1e3 * error,
                       soup=1e3 * soups[min(soups)])


SECTIONS = {3: section_3, 4: section_4, 10: section_figure_10}
"""Sections of the page by the number of the table or figure."""


def draw_figure_10(result: SoupResult, path: Path) -> None:
    """Draw times of the soup and of the network against N, and below their errors."""
    figure, ((times,), (errors,)) = output.subplots(2, 1, (7.0, 6.8))
    every = [*COARSE, *PAPER]
    rows = [result.soups['as written', n] for n in every]
    for who, colour, divisions, lines in (
            ('paper', '0.55', list(PAPER), ([tests[2] for tests in PAPER.values()],
                                            [tests[0] for tests in PAPER.values()],
                                            PAPER_NETWORK)),
            ('here', 'tab:blue', every, ([row['most_tests_alone_ms'] for row in rows],
                                         [row['alone_mean_ms'] for row in rows],
                                         result.network['call_mean_ms']))):
        for what, style, values in zip(('soup, most tests', 'soup, mean', 'network'),
                                       ('-^', '-o', '--'), lines):
            times.plot(divisions, np.broadcast_to(values, len(divisions)), style, color=colour,
                       markersize=4, label=f'{who}: {what}')
    for style, error in (
            ('-o', [result.soups['touching', n]['point_error_mean_m'] for n in every]),
            ('--', result.network['point_error_mean_m'])):
        errors.plot(every, 1e3 * np.broadcast_to(error, len(every)), style, color='tab:blue',
                    markersize=4)
    times.set(yscale='log', xticks=every, ylabel='time of a pair [ms]')
    errors.set(yscale='log', xticks=every, xlabel='divisions N of an edge',
               ylabel='mean point error [mm]')
    for axes in (times, errors):
        axes.yaxis.set_major_formatter('{x:g}')
        axes.grid(color='0.9', linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[['top', 'right']].set_visible(False)
    coarsest = result.soups['touching', min(COARSE)]
    shorter = rows[0]['alone_mean_ms'] / result.network['call_mean_ms']
    worse = result.network['point_error_mean_m'] / coarsest['point_error_mean_m']
    figure.suptitle(f'The coarsest soup takes {shorter:.0f} times as long as the network,\n'
                    f'whose point error is {worse:.1f} times as large', fontsize=12)
    figure.legend(loc='outside lower center', ncols=2, frameon=False)
    figure.savefig(path)
