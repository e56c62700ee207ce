"""Tables 3 and 4 and Figure 10 of the source paper: what a polygon soup costs, and its errors.

Times are CPU times of one thread on one pinned core, after a warm-up, with garbage collection off.
Like the paper's gprof, they leave out what other programs take meanwhile. table_3.md says what is
timed: the step, FCL alone, the answer.
"""
from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import fcl
import numpy as np
from tqdm import tqdm

from ... import output
from ...baselines import soup
from ...core import native
from ...scene.pose import degrees_between
from ...scene.pose_sets import CUBE, Pairs, at_depth, stacks
from ...solver.contact import Contacts
from ...solver.contact_solver import ContactSolver
from ...training.paper_recipe.dataset import as_poses
from ..frontier.speed import pinned, usable_cores
from .paper_tables import PAPER_NETWORK
from .paper_tables import PAPER_SOUP as PAPER

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

Poses = tuple[np.ndarray, np.ndarray]  # poses (n, 7) of A and of B, two cubes of edge 2


@dataclass(frozen=True, kw_only=True)
class SoupTimes:
    """Soup of N divisions, timed on a regime [ms]."""

    steps: np.ndarray
    alone: np.ndarray
    answers: np.ndarray
    pairs: np.ndarray  # pairs of triangles that meet, per pattern
    worst_step: float  # step of the pattern with the most pairs
    worst_alone: float
    touching: int  # patterns that touch, by SAT
    misses: int  # of these, those in which no two triangles meet


@dataclass(frozen=True, kw_only=True)
class SoupErrors:
    """Soup of N divisions, judged on a regime; a row per pattern that the soup answered."""

    point: np.ndarray  # [m]
    normal: np.ndarray  # [deg]
    depth: np.ndarray  # deepest contact minus the true depth [m]


@dataclass(frozen=True)
class Rival:
    """A network, on the touching patterns that the soup's accuracy is measured on."""

    point: float  # mean error of the point [m]
    normal: float  # mean error of the normal [deg]
    milliseconds: float  # mean time of a call


@dataclass(frozen=True, kw_only=True)
class SoupResult:
    """All that is measured; cells are by regime and N."""

    times: Mapping[tuple[str, int], SoupTimes]
    errors: Mapping[tuple[str, int], SoupErrors]
    rivals: Mapping[str, Rival]
    exact: float  # mean time of a call of model `exact` [ms]
    counts: Mapping[str, Counts]

    def ends(self, regime: str) -> tuple[SoupTimes, SoupTimes]:
        """Return the times of the least N of Table 3, and of the largest."""
        return self.times[regime, min(PAPER)], self.times[regime, max(PAPER)]


def near_parallel(rng: np.random.Generator, n: int) -> Poses:
    """Draw one cube on the other, tilted by 1e-6–1e-3 rad, 1 mm deep, any yaw, anywhere on it."""
    pairs = stacks(rng, 2 * n)  # a few are placed beside the cube and left out
    return pairs.pose_a[:n], pairs.pose_b[:n]


def coplanar(rng: np.random.Generator, n: int) -> Poses:
    """Draw one cube on the other, faces in one plane to the last bit.

    One in ten stands exactly on top; the others anywhere on it, half of them with their sides
    parallel, half under any yaw.
    """
    exactly = np.zeros((math.ceil(n / 10), 7))
    exactly[:, 2], exactly[:, 6] = CUBE[2], 1.0
    parallel = (n - len(exactly)) // 2
    parts = [exactly]
    for count, largest in ((parallel, 0.0), (n - len(exactly) - parallel, np.pi)):
        b = np.zeros((2 * count + 10, 7))  # some are placed beside the cube, and left out
        b[:, :2] = 0.98 * rng.uniform(-CUBE[0], CUBE[0], (len(b), 2))
        b[:, 2] = CUBE[2]
        yaw = largest * rng.uniform(-1.0, 1.0, len(b))
        b[:, 5], b[:, 6] = np.sin(0.5 * yaw), np.cos(0.5 * yaw)
        parts.append(b[_cubes('exact').batch(_origin(len(b)), b).colliding][:count])
    return _origin(n), rng.permutation(np.concatenate(parts))


def _origin(n: int) -> np.ndarray:
    return np.tile([0.0, 0, 0, 0, 0, 0, 1], (n, 1))


def _cubes(model: str) -> ContactSolver:
    return ContactSolver(CUBE, CUBE, model=model)


def pressed(poses: Poses, depth: float) -> Poses:
    """Return the pairs that touch, B moved along SAT's normal until they are `depth` [m] deep."""
    sizes = np.tile(CUBE, (len(poses[0]), 1))
    return at_depth(Pairs(*poses, sizes, sizes), np.full(len(sizes), depth))[:2]


def search(first: fcl.CollisionObject, second: fcl.CollisionObject) -> None:
    """Search for all pairs; FCL returns one of them, and goes on because costs are asked for."""
    fcl.collide(first, second, fcl.CollisionRequest(num_max_contacts=1, enable_contact=True,
                                                    enable_cost=True), fcl.CollisionResult())


def milliseconds(work: Callable[..., object], *arguments: object) -> float:
    """Return the CPU time of one call [ms]."""
    started = time.thread_time_ns()
    work(*arguments)
    return 1e-6 * (time.thread_time_ns() - started)


def pair_count(contacts: Sequence[fcl.Contact]) -> int:
    """Return how many pairs of triangles meet; FCL gives one contact or two for each."""
    return len({(contact.b1, contact.b2) for contact in contacts})


def time_soup(divisions: int, poses: Poses, thin: int, bar: tqdm) -> SoupTimes:
    """Time the soup of N divisions, and count its pairs of triangles."""
    a, b = poses
    boxes, solver = soup.Soup(divisions), _cubes(f'soup-{divisions}')
    steps, pairs = np.empty(len(a)), np.empty(len(a), dtype=np.int64)
    alone, answers = [], []
    for row in range(min(WARM_UP, len(a))):
        pair = boxes.place(a[row], b[row], CUBE, CUBE)
        soup.collide(*pair), search(*pair), solver(a[row], b[row])
    for row in range(len(a)):
        pair = boxes.place(a[row], b[row], CUBE, CUBE)
        started = time.thread_time_ns()
        contacts = soup.collide(*pair)
        steps[row] = 1e-6 * (time.thread_time_ns() - started)
        pairs[row] = pair_count(contacts)
        if row % thin == 0:
            alone.append(milliseconds(search, *pair))
            answers.append(milliseconds(solver, a[row], b[row]))
        if row % 100 == 0:
            bar.update(min(100, len(a) - row))
    found = _cubes('exact').batch(a, b).colliding
    most = int(np.argmax(pairs))
    pair = boxes.place(a[most], b[most], CUBE, CUBE)
    worst_step, worst_alone = (
        float(np.median([milliseconds(work, *pair) for _ in range(REPEATS)]))
        for work in (soup.collide, search))
    return SoupTimes(steps=steps, pairs=pairs, alone=np.array(alone), answers=np.array(answers),
                     worst_step=worst_step, worst_alone=worst_alone, touching=int(found.sum()),
                     misses=int((found & (pairs == 0)).sum()))


def judge_soup(divisions: int, poses: Poses, exact: Contacts) -> SoupErrors:
    """Compare with `exact`; patterns without an answer of the soup are left out."""
    boxes, areas = soup.Soup(divisions), soup.mesh(CUBE, divisions).areas
    rows, points, normals, depths = [], [], [], []
    for row, (a, b) in enumerate(zip(*poses)):
        contacts = soup.collide(*boxes.place(a, b, CUBE, CUBE))
        answer = soup.point_and_normal(contacts, areas, areas)
        if answer is not None:
            rows.append(row)
            points.append(a[:3] + answer[0])
            normals.append(answer[1])
            depths.append(max(contact.penetration_depth for contact in contacts))
    return SoupErrors(
        point=np.linalg.norm(np.reshape(points, (-1, 3)) - exact.point[rows], axis=1),
        normal=degrees_between(np.reshape(normals, (-1, 3)), exact.normal[rows]),
        depth=np.array(depths) + exact.separation[rows])


def time_calls(solver: ContactSolver, poses: Poses) -> float:
    """Return the mean time of a call [ms]; calls are too short for a clock each."""
    def calls() -> None:
        for a, b in zip(*poses):
            solver(a, b)

    calls()
    return milliseconds(calls) / len(poses[0])


def judge_rival(model: str, poses: Poses, exact: Contacts) -> Rival:
    """Return a network's errors and its time."""
    solver = _cubes(model)
    found = solver.batch(*poses)
    return Rival(float(np.linalg.norm(found.point - exact.point, axis=1).mean()),
                 float(degrees_between(found.normal, exact.normal).mean()),
                 time_calls(solver, poses))


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
    poses = {'touching': as_poses(inputs[:counts['touching'].timed]),
             'near-parallel': near_parallel(rng, counts['near-parallel'].timed),
             'coplanar': coplanar(rng, counts['coplanar'].timed)}
    judged = {name: tuple(p[:counts[name].judged] for p in given)
              for name, given in poses.items()}
    # At exact touch a few are apart by rounding, and left out.
    some = tuple(p[:2 * counts['touching'].judged] for p in poses['touching'])
    judged['touching'] = tuple(p[:counts['touching'].judged] for p in pressed(some, OVERLAP))
    truth = {name: _cubes('exact').batch(*given) for name, given in judged.items()}
    times, errors = {}, {}
    work = len(PAPER) * sum(c.timed + c.judged for c in counts.values())
    work += len(ALSO) * counts['touching'].judged
    with (pinned({usable_cores()[-1]}), output.no_garbage_collection(),
          tqdm(total=work, unit='pattern', disable=None) as bar):
        for divisions in sorted([*PAPER, *ALSO]):
            for regime in REGIMES if divisions in PAPER else ['touching']:
                bar.set_description(f'soup, N = {divisions}, {regime}')
                if divisions in PAPER:
                    times[regime, divisions] = time_soup(divisions, poses[regime],
                                                         counts[regime].thin, bar)
                errors[regime, divisions] = judge_soup(divisions, judged[regime], truth[regime])
                bar.update(len(judged[regime][0]))
        rivals = {model: judge_rival(model, judged['touching'], truth['touching'])
                  for model in ('paper', 'paper-continuous')}
        exact = time_calls(_cubes('exact'), judged['touching'])
    return SoupResult(times=times, errors=errors, rivals=rivals, exact=exact, counts=counts)


def _ms(value: float) -> str:
    return f'{value:.3f}' if value < 0.1 else f'{value:.2f}'


def _by_regime(head: Sequence[str], titles: Sequence[str], paper: Callable[[int], list[str]],
               ours: Callable[[SoupTimes], list[str]], result: SoupResult) -> str:
    """Return a table with a row per N: the paper's figures, then ours for each regime."""
    columns = [f'{regime}: {titles[0]}' if k == 0 else title
               for regime in REGIMES for k, title in enumerate(titles)]
    return output.markdown_table(['N', *head, *columns], [
        [divisions, *paper(divisions),
         *(cell for regime in REGIMES for cell in ours(result.times[regime, divisions]))]
        for divisions in PAPER], words=0)


def table_of_errors(result: SoupResult) -> str:
    """Return errors by N and regime, then the networks'."""
    head = ['N', 'misses at exact touch']
    for regime in REGIMES:
        head += [f'{regime}: point, mean', 'max', 'normal, mean']
    head += ['depth, touching', 'depth, near-parallel']
    rows = []
    for divisions in sorted({divisions for _, divisions in result.errors}):
        times = result.times.get(('touching', divisions))
        row = [str(divisions), f'{100 * times.misses / times.touching:.0f} %' if times else '']
        cells = {regime: result.errors.get((regime, divisions)) for regime in REGIMES}
        for cell in cells.values():
            row += [f'{1e3 * cell.point.mean():.1f}', f'{1e3 * cell.point.max():.0f}',
                    f'{cell.normal.mean():.1f}'] if cell else ['', '', '']
        row += [f'{1e3 * cell.depth.mean():.0f}' if (cell := cells[regime]) else ''
                for regime in ('touching', 'near-parallel')]
        rows.append(row)
    for name, rival in result.rivals.items():
        rows.append([f'`{name}`', '', f'{1e3 * rival.point:.1f}', '', f'{rival.normal:.1f}',
                     *[''] * (len(head) - 5)])
    return output.markdown_table(head, rows, words=0)


def _touching_errors(result: SoupResult) -> dict[int, float]:
    """Return the mean point error on touching cubes [m], by N."""
    return {n: float(cell.point.mean()) for (regime, n), cell in sorted(result.errors.items())
            if regime == 'touching'}


def equal_at(result: SoupResult) -> dict[str, float]:
    """Return, by network, the N at which the soup's mean point error equals its."""
    errors = _touching_errors(result)
    return {name: crossing(errors, rival.point) for name, rival in result.rivals.items()}


def in_words(divisions: float) -> str:
    """Return a `crossing` in words."""
    if divisions == 0.0:
        return f'below N = {min(ALSO)}'
    return f'N ≈ {divisions:.0f}' if math.isfinite(divisions) else f'beyond N = {max(ALSO)}'


def section_3(result: SoupResult) -> str:
    """Return Table 3, mean times by N and regime, with its notes."""
    table = _by_regime(
        ['triangles a cube', 'paper: touching'], ['step', 'FCL alone', 'answer'],
        lambda n: [f'{12 * n**2:,}', f'{PAPER[n][0]:.2f}'],
        lambda cell: [_ms(float(t.mean())) for t in (cell.steps, cell.alone, cell.answers)],
        result)
    counts = result.counts
    thin = ', '.join(f'{math.ceil(count.timed / count.thin):,} {name}'
                     for name, count in counts.items())
    _, last = result.ends('coplanar')
    share = 100 * (1 - last.alone.mean() / last.steps[::counts['coplanar'].thin].mean())
    network = result.rivals['paper'].milliseconds
    touching, coplanar = ([cell.steps.mean() / network for cell in result.ends(regime)]
                          for regime in ('touching', 'coplanar'))
    return output.page(
        'reports/paper/pages/table_3', counts=counts, table=table, share=share, thin=thin,
        low=min(PAPER), high=max(PAPER), network=1e3 * network, exact=1e3 * result.exact,
        touching=touching, coplanar=coplanar)


def section_4(result: SoupResult) -> str:
    """Return Table 4, the patterns with the most pairs and their times, with its notes."""
    table = _by_regime(
        ['paper: tests', 'paper: ms'], ['pairs', 'step, ms', 'FCL alone, ms'],
        lambda n: [f'{PAPER[n][1]:,}', f'{PAPER[n][2]:.2f}'],
        lambda cell: [f'{cell.pairs.max():,}', _ms(cell.worst_step), _ms(cell.worst_alone)],
        result)

    def growth(regime: str) -> float:
        first, last = result.ends(regime)
        return last.worst_step / first.worst_step

    def most(regime: str) -> str:
        return ' to '.join(f'{cell.pairs.max():,}' for cell in result.ends(regime))

    low, high = min(PAPER), max(PAPER)
    return output.page(
        'reports/paper/pages/table_4', table=table, repeats=REPEATS, low=low, high=high,
        growth_paper=PAPER[high][2] / PAPER[low][2], growth_coplanar=growth('coplanar'),
        growth_parallel=growth('near-parallel'), most_coplanar=most('coplanar'),
        most_parallel=most('near-parallel'),
        few=max(result.times['touching', n].pairs.max() for n in PAPER))


def section_errors(result: SoupResult) -> str:
    """Return the soup's errors, and what differs from the paper."""
    along = 1e3 * result.errors['near-parallel', max(PAPER)].point.mean()
    return output.page('reports/paper/pages/soup_errors', counts=result.counts, along=along,
                       table=table_of_errors(result))


def section_figure_10(result: SoupResult) -> str:
    """Return Figure 10's caption."""
    return output.page('reports/paper/pages/figure_10', equal='; '.join(
        f"`{name}`'s ({1e3 * result.rivals[name].point:.0f} mm) at {in_words(n)}"
        for name, n in equal_at(result).items()))


def draw_figure_10(result: SoupResult, path: Path) -> None:
    """Draw times and errors against N."""
    figure, ((upper,), (lower,)) = output.subplots(2, 1, (8.0, 8.4))
    _draw_times(upper, result)
    ticks = [1, 2, 4, 8, 16, 32, 64]
    errors = _touching_errors(result)
    lower.plot(list(errors), [1e3 * error for error in errors.values()], '-o', color='tab:blue',
               markersize=3.5, label='soup, touching')
    for (name, n), colour in zip(equal_at(result).items(), ('tab:orange', 'tab:purple')):
        lower.axhline(1e3 * result.rivals[name].point, color=colour, label=f'{name}: {in_words(n)}')
        for axes in (upper, lower) if min(PAPER) <= n <= max(PAPER) else (lower,):
            if 0.0 < n < math.inf:
                axes.axvline(n, color=colour, linestyle='--', label=f'as exact as {name}')
    lower.set(xscale='log', yscale='log', xlabel='divisions N of an edge',
              ylabel='mean point error [mm]')
    lower.set_xticks(ticks, [str(tick) for tick in ticks])
    lower.set_xticks([], minor=True)
    for axes in (upper, lower):
        axes.legend(fontsize=8.5, loc='upper left', bbox_to_anchor=(1.01, 1.0))
        axes.grid(color='0.9', which='both', linewidth=0.6)
        axes.set_axisbelow(True)
    figure.savefig(path)


def _draw_times(axes: Any, result: SoupResult) -> None:
    divisions = list(PAPER)
    for regime, colour in zip(REGIMES, ('tab:blue', 'tab:green', 'tab:red')):
        cells = [result.times[regime, n] for n in divisions]
        axes.plot(divisions, [cell.steps.mean() for cell in cells], '-o', color=colour,
                  markersize=3.5, label=f'{regime}, mean')
        axes.plot(divisions, [cell.worst_step for cell in cells], ':s', color=colour,
                  markersize=3.5, label=f'{regime}, most pairs')
    axes.axhline(result.rivals['paper'].milliseconds, color='black', label='call of model paper')
    for column, style, label in ((0, '-', 'mean'), (2, ':', 'maximum')):
        axes.plot(divisions, [PAPER[n][column] for n in divisions], style, color='0.6',
                  label=f"the paper's soup, {label}")
    axes.axhline(PAPER_NETWORK, color='0.6', linestyle='--', label="the paper's network")
    axes.set(yscale='log', xlabel='divisions N of an edge', ylabel='time [ms]', xticks=divisions)


def csv_rows(result: SoupResult) -> Iterator[dict[str, object]]:
    """Yield a row per model, N and regime."""
    here = asdict(output.machine(native, ('numpy', 'python-fcl')))

    def mean(values: np.ndarray) -> float:
        return float(values.mean())

    for (regime, divisions), errors in result.errors.items():
        row: dict[str, object] = {'model': 'soup', 'divisions': divisions,
                                  'triangles': 12 * divisions**2, 'regime': regime}
        columns = ('patterns', 'touching', 'misses', 'step_mean_ms', 'step_p50_ms', 'step_p99_ms',
                   'step_max_ms', 'alone_patterns', 'alone_mean_ms', 'answer_mean_ms',
                   'most_pairs', 'most_pairs_step_ms', 'most_pairs_alone_ms')
        times = result.times.get((regime, divisions))
        row |= dict(zip(columns, [
            len(times.steps), times.touching, times.misses, mean(times.steps),
            *output.percentiles(times.steps, 50, 99, 100), len(times.alone), mean(times.alone),
            mean(times.answers), int(times.pairs.max()), times.worst_step, times.worst_alone,
        ] if times else [None] * len(columns)))
        yield row | {'judged': len(errors.point), 'point_error_mean_m': mean(errors.point),
                     'point_error_max_m': float(errors.point.max()),
                     'normal_error_mean_deg': mean(errors.normal),
                     'depth_error_mean_m': mean(errors.depth), **here}
    for name, rival in result.rivals.items():
        yield {'model': name, 'regime': 'touching', 'answer_mean_ms': rival.milliseconds,
               'point_error_mean_m': rival.point, 'normal_error_mean_deg': rival.normal, **here}
