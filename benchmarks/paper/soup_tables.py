# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables 3 and 4 and Figure 10 of the source paper: what a polygon soup costs, and its errors.

Times are CPU times of one thread on one pinned core, after a warm-up, with garbage collection off.
Like the paper's gprof, they leave out what other programs take meanwhile. table_3.md says what is
timed: the step, FCL alone, the answer.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import fcl
import numpy as np
from tqdm import tqdm

from box_contact_ros.solver.contact import Contacts
from box_contact_ros.soup import soup

from .. import output
from ..contestant import Contestant, ours
from ..errors import degrees_between, distances
from ..pose_sets import CUBE, Pairs, at_depth, coplanar, drawn, on_cube, stacks
from ..timing import cpu_milliseconds, no_garbage_collection, pinned, usable_cores
from .dataset import as_poses
from .models import continuous

PAPER = {8: (1.10, 11233, 11.52), 10: (1.47, 14323, 15.47), 12: (1.85, 17911, 19.2),
         14: (1.94, 21789, 23.13), 16: (2.13, 24667, 24.63), 18: (2.31, 26517, 28.0),
         20: (2.72, 30475, 32.44), 22: (2.90, 35411, 36.77)}
"""The paper's figures by N: Table 3's mean time [ms]; Table 4's largest number of tests, and its
time [ms]."""
PAPER_NETWORK = 0.5  # the paper's time of its network [ms]
ALSO = (1, 2, 4, 32, 64)  # divisions at which only the accuracy is measured, on touching boxes

OVERLAP = 1e-3
"""Depth [m] of touching and near-parallel cubes of edge 2 where the accuracy is measured. At exact
touch the soup finds nothing in a part of the patterns."""
SEED = 20
WARM_UP = 30      # patterns before any that counts
REPEATS = 5       # timings of the pattern with the most pairs; their median counts


@dataclass(frozen=True)
class Counts:
    """How many patterns of a regime are looked at."""

    timed: int
    thin: int  # every so many of them are timed for FCL alone and for the answer
    judged: int  # of how many the accuracy is measured


FULL = {'touching': Counts(75_000, 25, 1000), 'near-parallel': Counts(1000, 1, 1000),
        'coplanar': Counts(1000, 10, 100)}
QUICK = {'touching': Counts(100, 10, 20), 'near-parallel': Counts(20, 1, 20),
         'coplanar': Counts(10, 2, 10)}
REGIMES = tuple(FULL)

Row = dict[str, Any]
"""A row of paper_soup.csv by column; of an N or a model that is not timed, it has no times."""


class SoupErrors(NamedTuple):
    """A soup, judged on a regime; a row per pattern that the soup answered."""

    point: np.ndarray  # [m]
    normal: np.ndarray  # [deg]
    depth: np.ndarray  # deepest contact minus the true depth [m]


@dataclass(frozen=True, kw_only=True)
class SoupResult:
    """All that is measured."""

    soups: Mapping[tuple[str, int], Row]  # by regime and N
    networks: Mapping[str, Row]  # on the touching patterns that the soup's accuracy is measured on
    exact: float  # mean time of a call of model `exact` [ms]
    counts: Mapping[str, Counts]

    @property
    def rows(self) -> list[Row]:
        """Return the rows of paper_soup.csv."""
        return [*self.soups.values(), *self.networks.values()]

    def ends(self, regime: str) -> tuple[Row, Row]:
        """Return the rows of the least N of Table 3, and of the largest."""
        return self.soups[regime, min(PAPER)], self.soups[regime, max(PAPER)]


def search(first: fcl.CollisionObject, second: fcl.CollisionObject) -> None:
    """Search for all pairs; FCL returns one of them, and goes on because costs are asked for."""
    fcl.collide(first, second, fcl.CollisionRequest(num_max_contacts=1, enable_contact=True,
                                                    enable_cost=True), fcl.CollisionResult())


def pair_count(contacts: Sequence[fcl.Contact]) -> int:
    """Return how many pairs of triangles meet; FCL gives one contact or two for each."""
    return len({(contact.b1, contact.b2) for contact in contacts})


def time_soup(divisions: int, patterns: Pairs, thin: int, bar: tqdm) -> Row:
    """Return the columns of times of the soup of N divisions, and of its pairs of triangles."""
    boxes, answer = soup.Soup(divisions), ours(f'soup-{divisions}').prepare(patterns)
    poses = list(zip(patterns.pose_a, patterns.pose_b))
    for row, (a, b) in enumerate(poses[:WARM_UP]):
        pair = boxes.place(a, b, CUBE, CUBE)
        soup.collide(*pair), search(*pair), answer[row]()
    step, pairs, alone, answers = np.empty(len(poses)), np.empty(len(poses), np.int64), [], []
    for row, (a, b) in enumerate(poses):
        pair = boxes.place(a, b, CUBE, CUBE)
        step[row], contacts = cpu_milliseconds(soup.collide, *pair)
        pairs[row] = pair_count(contacts)
        if row % thin == 0:
            alone.append(cpu_milliseconds(search, *pair)[0])
            answers.append(cpu_milliseconds(answer[row])[0])
        bar.update()
    most = boxes.place(*poses[int(np.argmax(pairs))], CUBE, CUBE)
    most_step, most_alone = (
        float(np.median([cpu_milliseconds(work, *most)[0] for _ in range(REPEATS)]))
        for work in (soup.collide, search))
    touching = patterns.contacts().colliding
    p50, p99, longest = output.percentiles(step, 50, 99, 100)
    return {
        'patterns': len(poses),
        'touching': int(touching.sum()),  # by SAT
        'misses': int((touching & (pairs == 0)).sum()),
        'step_mean_ms': float(step.mean()), 'step_p50_ms': p50, 'step_p99_ms': p99,
        'step_max_ms': longest,
        'alone_patterns': len(alone), 'alone_mean_ms': float(np.mean(alone)),
        'alone_by_step': float(np.mean(alone) / step[::thin].mean()),  # of the same patterns
        'answer_mean_ms': float(np.mean(answers)),
        'most_pairs': int(pairs.max()), 'most_pairs_step_ms': most_step,
        'most_pairs_alone_ms': most_alone}


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
    """Return the mean time of a call [ms]; calls are too short for a clock each."""
    calls = model.prepare(patterns)

    def all_calls() -> None:
        for call in calls:
            call()

    all_calls()
    return cpu_milliseconds(all_calls)[0] / len(calls)


def judge_network(model: Contestant, patterns: Pairs, exact: Contacts) -> Row:
    """Return a network's row on touching patterns."""
    found, _ = model.solve(patterns)
    return {'model': model.name, 'regime': 'touching',
            'answer_mean_ms': time_calls(model, patterns),
            'point_error_mean_m': float(distances(found.point, exact.point).mean()),
            'normal_error_mean_deg': float(degrees_between(found.normal, exact.normal).mean())}


def crossing(errors: Mapping[int, float], level: float) -> float:
    """Return the N at which the error falls to `level`.

    The line between those measured is straight on log-log paper. The N is 0 if the error is below
    from the first on, infinite if it never is.
    """
    divisions = sorted(errors)
    if errors[divisions[0]] <= level:
        return 0.0
    for low, high in zip(divisions, divisions[1:]):
        if errors[high] <= level:
            share = math.log(errors[low] / level) / math.log(errors[low] / errors[high])
            return low * (high / low)**share
    return math.inf


def measure(inputs: np.ndarray, *, quick: bool = False) -> SoupResult:
    """Time and judge every N on every regime; inputs: the paper's external set (n, 6)."""
    counts = QUICK if quick else FULL
    rng = np.random.default_rng(SEED)
    patterns = {'touching': on_cube(as_poses(inputs[:counts['touching'].timed])[1]),
                'near-parallel': drawn(stacks, rng, counts['near-parallel'].timed),
                'coplanar': coplanar(rng, counts['coplanar'].timed)}
    judged = {name: pairs.rows(slice(counts[name].judged)) for name, pairs in patterns.items()}
    # At exact touch a few are apart by rounding, and left out.
    some = patterns['touching'].rows(slice(2 * counts['touching'].judged))
    judged['touching'] = at_depth(some, np.full(len(some.size), OVERLAP)).rows(
        slice(counts['touching'].judged))
    truth = {name: pairs.contacts() for name, pairs in judged.items()}
    soups: dict[tuple[str, int], Row] = {}
    work = len(PAPER) * sum(c.timed + c.judged for c in counts.values())
    work += len(ALSO) * counts['touching'].judged
    with (pinned({usable_cores()[-1]}), no_garbage_collection(),
          tqdm(total=work, unit='pattern', disable=None) as bar):
        for divisions in (*PAPER, *ALSO):
            for regime in REGIMES if divisions in PAPER else ['touching']:
                bar.set_description(f'soup, N = {divisions}, {regime}')
                row: Row = {'model': 'soup', 'divisions': divisions,
                            'triangles': 12 * divisions**2, 'regime': regime}
                if divisions in PAPER:
                    row |= time_soup(divisions, patterns[regime], counts[regime].thin, bar)
                errors = judge_soup(divisions, judged[regime], truth[regime])
                soups[regime, divisions] = row | {
                    'judged': len(errors.point), 'point_error_mean_m': float(errors.point.mean()),
                    'point_error_max_m': float(errors.point.max()),
                    'normal_error_mean_deg': float(errors.normal.mean()),
                    'depth_error_mean_m': float(errors.depth.mean())}
                bar.update(len(judged[regime].size))
        networks = {model.name: judge_network(model, judged['touching'], truth['touching'])
                    for model in (ours('paper'), ours(continuous(), name='paper-continuous'))}
        exact = time_calls(ours('exact'), judged['touching'])
    return SoupResult(soups=soups, networks=networks, exact=exact, counts=counts)


def _cell(value: float) -> str:
    """Return a number of pairs, or a time [ms]."""
    if isinstance(value, int):
        return f'{value:,}'
    return f'{value:.3f}' if value < 0.1 else f'{value:.2f}'


def _by_regime(paper: Mapping[str, Callable[[int], str]], ours: Mapping[str, str],
               result: SoupResult) -> str:
    """Return a table with a row per N.

    paper: the paper's figures by title, as functions of N; ours: columns of our rows by title.
    """
    first = next(iter(ours))
    titles = [f'{regime}: {title}' if title == first else title
              for regime in REGIMES for title in ours]
    return output.markdown_table(['N', *paper, *titles], [
        [n, *(figure(n) for figure in paper.values()),
         *(_cell(result.soups[regime, n][column]) for regime in REGIMES
           for column in ours.values())] for n in PAPER], words=0)


def table_of_errors(result: SoupResult) -> str:
    """Return errors by N and regime, then the networks'."""
    def cell(row: Row, column: str, unit: float, digits: int = 0) -> str:
        return f'{unit * row[column]:.{digits}f}' if column in row else ''

    head = ['N', 'misses at exact touch']
    for regime in REGIMES:
        head += [f'{regime}: point, mean', 'max', 'normal, mean']
    found = {str(n): [result.soups.get((regime, n), {}) for regime in REGIMES]
             for n in sorted({n for _, n in result.soups})}
    found |= {f'`{name}`': [row, {}, {}] for name, row in result.networks.items()}
    lines = []
    for label, (touching, parallel, flat) in found.items():
        line = [label, f'{100 * touching["misses"] / touching["touching"]:.0f} %'
                if 'misses' in touching else '']
        for row in (touching, parallel, flat):
            line += [cell(row, 'point_error_mean_m', 1e3, 1), cell(row, 'point_error_max_m', 1e3),
                     cell(row, 'normal_error_mean_deg', 1.0, 1)]
        lines.append(line + [cell(row, 'depth_error_mean_m', 1e3) for row in (touching, parallel)])
    return output.markdown_table([*head, 'depth, touching', 'depth, near-parallel'], lines, words=0)


def _touching_errors(result: SoupResult) -> dict[int, float]:
    """Return the mean point error on touching cubes [m], by N."""
    return {n: row['point_error_mean_m'] for (regime, n), row in sorted(result.soups.items())
            if regime == 'touching'}


def equal_at(result: SoupResult) -> dict[str, float]:
    """Return, by network, the N at which the soup's mean point error equals its."""
    errors = _touching_errors(result)
    return {name: crossing(errors, row['point_error_mean_m'])
            for name, row in result.networks.items()}


def in_words(divisions: float) -> str:
    """Return a `crossing` in words."""
    if divisions == 0.0:
        return f'below N = {min(ALSO)}'
    return f'N ≈ {divisions:.0f}' if math.isfinite(divisions) else f'beyond N = {max(ALSO)}'


def section_3(result: SoupResult) -> str:
    """Return Table 3, mean times by N and regime, with its notes."""
    table = _by_regime(
        {'triangles a cube': lambda n: f'{12 * n**2:,}',
         'paper: touching': lambda n: f'{PAPER[n][0]:.2f}'},
        {'step': 'step_mean_ms', 'FCL alone': 'alone_mean_ms', 'answer': 'answer_mean_ms'}, result)
    _, last = result.ends('coplanar')
    network = result.networks['paper']['answer_mean_ms']
    touching, coplanar = ([row['step_mean_ms'] / network for row in result.ends(regime)]
                          for regime in ('touching', 'coplanar'))
    return output.page(
        'benchmarks/paper/pages/table_3', counts=result.counts, table=table,
        share=100 * (1 - last['alone_by_step']), low=min(PAPER), high=max(PAPER),
        thin=', '.join(f'{result.ends(regime)[0]["alone_patterns"]:,} {regime}'
                       for regime in REGIMES),
        network=1e3 * network, exact=1e3 * result.exact, touching=touching, coplanar=coplanar)


def section_4(result: SoupResult) -> str:
    """Return Table 4, the patterns with the most pairs and their times, with its notes."""
    table = _by_regime(
        {'paper: tests': lambda n: f'{PAPER[n][1]:,}', 'paper: ms': lambda n: f'{PAPER[n][2]:.2f}'},
        {'pairs': 'most_pairs', 'step, ms': 'most_pairs_step_ms',
         'FCL alone, ms': 'most_pairs_alone_ms'}, result)
    ends = {regime: result.ends(regime) for regime in REGIMES}
    low, high = min(PAPER), max(PAPER)
    return output.page(
        'benchmarks/paper/pages/table_4', table=table, repeats=REPEATS, low=low, high=high,
        growth_paper=PAPER[high][2] / PAPER[low][2],
        growth={regime: last['most_pairs_step_ms'] / first['most_pairs_step_ms']
                for regime, (first, last) in ends.items()},
        most={regime: f'{first["most_pairs"]:,} to {last["most_pairs"]:,}'
              for regime, (first, last) in ends.items()},
        few=max(result.soups['touching', n]['most_pairs'] for n in PAPER))


def section_errors(result: SoupResult) -> str:
    """Return the soup's errors, and what differs from the paper."""
    along = 1e3 * result.ends('near-parallel')[1]['point_error_mean_m']
    return output.page('benchmarks/paper/pages/soup_errors',
                       counts=result.counts, along=along,
                       table=table_of_errors(result))


def section_figure_10(result: SoupResult) -> str:
    """Return Figure 10's caption."""
    return output.page('benchmarks/paper/pages/figure_10', equal='; '.join(
        f"`{name}`'s ({1e3 * result.networks[name]['point_error_mean_m']:.0f} mm) at {in_words(n)}"
        for name, n in equal_at(result).items()))


SECTIONS = {3: section_3, 4: section_4, 10: section_figure_10}
"""Sections of the page by the number of the table or figure."""


def draw_figure_10(result: SoupResult, path: Path) -> None:
    """Draw the mean times and the errors against N."""
    figure, ((upper,), (lower,)) = output.subplots(2, 1, (7.0, 7.0))
    divisions = list(PAPER)
    colours = dict(zip(REGIMES, ('tab:blue', 'tab:green', 'tab:red')))
    for regime, colour in colours.items():
        _line(upper, divisions, [result.soups[regime, n]['step_mean_ms'] for n in divisions],
              f'soup, {regime}', color=colour, marker='o')
    _line(upper, divisions, [PAPER[n][0] for n in divisions], "the paper's soup", color='0.5')
    for name, time in (('model paper', result.networks['paper']['answer_mean_ms']),
                       ("the paper's network", PAPER_NETWORK)):
        _line(upper, divisions, [time] * len(divisions), name, linestyle='--',
              color='black' if name == 'model paper' else '0.5')
    upper.set(yscale='log', ylabel='mean time [ms]', xticks=divisions)
    errors = _touching_errors(result)
    _line(lower, list(errors), [1e3 * error for error in errors.values()], 'soup, touching',
          color=colours['touching'], marker='o')
    for name, n in equal_at(result).items():
        error = 1e3 * result.networks[name]['point_error_mean_m']
        _line(lower, list(errors), [error] * len(errors), name, color='black', linestyle='--')
        if 0.0 < n < math.inf:
            lower.plot(n, error, 'k*', markersize=11)
    lower.set(xscale='log', yscale='log', ylabel='mean point error [mm]')
    ticks = [2**power for power in range(7)]
    lower.set_xticks(ticks, [str(tick) for tick in ticks])
    lower.set_xticks([], minor=True)
    for axes in (upper, lower):
        axes.set_xlabel('divisions N of an edge')
        axes.grid(color='0.9', linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[['top', 'right']].set_visible(False)
    figure.savefig(path)


def _line(axes: Any, divisions: Sequence[int], values: Sequence[float], label: str, *, color: str,
          marker: str = '', linestyle: str = '-') -> None:
    """Draw values against N, with their name at the right end."""
    axes.plot(divisions, values, linestyle, color=color, marker=marker, markersize=3.5)
    axes.annotate(label, (divisions[-1], values[-1]), (8, 0), textcoords='offset points',
                  va='center', color=color, annotation_clip=False)
