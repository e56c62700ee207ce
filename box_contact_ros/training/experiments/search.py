"""Program `search`: which size and settings a network should have, by training thousands at once.

- `search mlp`: hidden units and learning rate of the MLP. What is kept is
  the frontier of speed against error, and the size in use is shown on it.
- `search paper`: the paper's own search for its two networks, over what it names: learning rate,
  momentum, hidden units, range of the initial weights; and where the settings in use rank.

Both by successive halving (`halving`): the paper trained over 2,000 networks to the end, here most
of them end early. Results are a page of Markdown, a table of all candidates as CSV, and a plot.
"""
from __future__ import annotations

import argparse
import csv
import dataclasses
import math
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import torch

from ...core import FEATURES, OUTPUTS, SITES, native
from ...output import processor
from ...resources import resource_path
from ...solver.arguments import make_folder, seed_number
from ...solver.mlp import UNITS_MAX, core_numbers
from ...solver.weights_file import Network, WeightsError, load_weights, unpacked
from .. import mlp_recipe, train
from ..mlp_fit import (
    Fit,
    Layers,
    Settings,
    batched,
    device_of,
    drawn,
    normalisation,
    unbatched,
    unfolded,
)
from ..paper_recipe import dataset
from ..paper_recipe.fit import Settings as PaperSettings
from ..paper_recipe.fit import fit, outputs_of, wrapped
from ..samples import MlpSamples, draw_samples, mixture
from .successive_halving import (
    Candidate,
    CheckpointError,
    Progress,
    Rung,
    Scores,
    Search,
    ranking,
    run,
)

UNITS = np.arange(4, UNITS_MAX + 1, 4)
"""Hidden units that are tried."""
TIMED_PAIRS = 4_000
"""Pairs of the training mixture on which a batch is timed."""

# Streams of random numbers beside those of `halving`, whose seeds are (seed, rung, group).
_CANDIDATES, _START, _TRAINING, _CHECKING = 1001, 1002, 1003, 1004


def multiply_adds(widths: Sequence[int]) -> int:
    """Multiplications of a network with these widths for one input."""
    return sum(a * b for a, b in zip(widths, widths[1:]))


def site_multiply_adds(units: int) -> int:
    """Return the multiplications of an MLP for one pair, at all sites.

    Two in three of a site's features are those of its faces or its axis, summed once for these.
    """
    own, shared = FEATURES // 3, FEATURES - FEATURES // 3
    return units * (3 * shared + SITES * (own + OUTPUTS))


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


# --- the MLP --------------------------------------------------------------------------------


class MlpSearch:
    """Hidden units and learning rate of the MLP."""

    name = 'mlp'
    bins = 4
    """Classes of cost, equally wide in its logarithm. In each the best go on: a small network is
    never as good as a large one, and the small ones are what is looked for."""

    def __init__(self, *, seed: int, count: int, quick: bool, device: str) -> None:
        self.seed, self.quick, self.device = seed, quick, device
        plan = ([(count, 10, 128), (max(count // 4, 8), 20, 128)] if quick else
                [(count, 100, 64), (max(count // 4, 64), 400, 64),
                 (max(count // 16, 48), 1500, 64), (max(count // 64, 32), 3000, 256)])
        # On a CPU groups small enough for its caches (twice as many took twice as long for each); a
        # GPU wants as much as it can get.
        inputs = 4096 if device == 'cpu' else 131_072
        self.rungs = [Rung(*entry, group=inputs // entry[2]) for entry in plan]
        self._data: tuple[MlpSamples, MlpSamples] | None = None

    def widths(self, candidate: Candidate) -> tuple[int, ...]:
        """Units per layer, inputs first."""
        return (FEATURES, *candidate.hidden, OUTPUTS)

    def cost(self, candidate: Candidate) -> int:
        """Multiply-adds of its network."""
        return site_multiply_adds(candidate.hidden[0])

    def candidates(self) -> list[Candidate]:
        """Units uniform in their logarithm, so that half of the candidates are small."""
        found = [Candidate(0, mlp_recipe.HIDDEN, mlp_recipe.RATE, shipped=True)]
        for number in range(1, self.rungs[0].candidates):
            rng = np.random.default_rng([self.seed, _CANDIDATES, number])
            units = log_uniform(rng, UNITS[0], UNITS[-1])
            nearest = int(UNITS[np.argmin(np.abs(np.log(UNITS / units)))])
            found.append(Candidate(number, (nearest,), log_uniform(rng, 1e-3, 1e-1)))
        return found

    def start(self, candidate: Candidate) -> Layers:
        """Random weights."""
        return drawn(np.random.default_rng([self.seed, _START, candidate.number]),
                     self.widths(candidate))

    @property
    def data(self) -> tuple[MlpSamples, MlpSamples]:
        """What is trained on, and what errors are measured on."""
        if self._data is None:
            train_pairs, check_pairs = (20_000, 4_000) if self.quick else (1_000_000, 40_000)
            self._data = (draw_samples(mixture, [self.seed, _TRAINING], train_pairs),
                          draw_samples(mixture, [self.seed, _CHECKING], check_pairs))
        return self._data

    def train(self, number: int, group: Sequence[Candidate], start: Sequence[Layers],
              seed: Sequence[int]) -> tuple[list[Layers], list[Scores]]:
        """Adam; the error is the 99th percentile of the point error, % of the smaller box."""
        training, checking = self.data
        rung = self.rungs[number]
        fit = Fit(training, Settings(
            hidden=[one.hidden for one in group], steps=rung.effort, batch=rung.batch,
            rate=[one.rate for one in group], seed=_single(seed), device=self.device), start=start)
        fit.run(rung.effort)
        scores = []
        for errors in 100.0 * fit.point_errors(checking):
            scores.append({'error': float(np.quantile(errors, 0.99)), 'mean': float(errors.mean()),
                           'worst': float(errors.max())})
        return fit.networks(), scores

    def keep(self, ranked: Sequence[Candidate], count: int) -> list[Candidate]:
        """The best of every class of cost in turn."""
        costs = np.log([site_multiply_adds(units) for units in (UNITS[0], UNITS[-1])])
        edges = np.linspace(*costs, self.bins + 1)[1:-1]
        places: dict[int, int] = {}
        turns = []
        for order, one in enumerate(ranked):
            cost_class = int(np.searchsorted(edges, math.log(self.cost(one))))
            places[cost_class] = places.get(cost_class, 0) + 1
            turns.append((places[cost_class], order))
        return [ranked[order] for _, order in sorted(turns)[:count]]


def _single(seed: Sequence[int]) -> int:
    return int(np.random.SeedSequence(list(seed)).generate_state(1)[0])


def _shipped_error(search: MlpSearch) -> float | None:
    """The 99th percentile of the shipped weights' error on what candidates are measured on."""
    try:
        weights = load_weights(resource_path('weights', 'mlp.safetensors'))
    except (FileNotFoundError, WeightsError):
        return None  # there may be none yet
    training, checking = search.data
    network = weights.networks['point']
    fit = Fit(training, Settings(hidden=[network.widths[1:-1]], steps=0, device=search.device),
              start=[unfolded(unpacked(network), *normalisation(training.features))])
    return 100.0 * float(np.quantile(fit.point_errors(checking), 0.99))


def frontier(costs: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Which have no other that is as cheap and as good, cheapest first."""
    kept: list[int] = []
    for k in sorted(range(len(costs)), key=lambda k: (costs[k], errors[k])):
        if not kept or errors[k] < errors[kept[-1]]:
            kept.append(k)
    return kept


def batch_times(sizes: Sequence[tuple[int, ...]], rounds: int = 30) -> list[float]:
    """Return the least time of a pair in a batch of `mlp` with these hidden units each [ns].

    The time is that of all stages of a pair. The sizes take turns, so a disturbance hits all.
    """
    rng = np.random.default_rng(0)
    pairs = [np.ascontiguousarray(part) for part in mixture(rng, TIMED_PAIRS)]
    solvers = []
    for hidden in sizes:
        widths = (FEATURES, *hidden, OUTPUTS)
        packed = np.concatenate([0.1 * rng.normal(size=a * b + b)
                                 for a, b in zip(widths, widths[1:])])
        numbers = core_numbers(Network('point', widths, packed.astype(np.float32)))
        solvers.append(native.PairSolver('mlp', (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), numbers))
    best = [math.inf] * len(solvers)
    for _ in range(rounds):
        for k, solver in enumerate(solvers):
            began = time.perf_counter()
            solver.solve(*pairs, 1)
            best[k] = min(best[k], time.perf_counter() - began)
    return [1e9 * seconds / len(pairs[0]) for seconds in best]


# --- the paper's networks -------------------------------------------------------------------------


class PaperSearch:
    """The paper's search, for one of its networks."""

    def __init__(self, name: str, job: train.Job, sets: dict[str, dataset.Patterns], *, seed: int,
                 count: int, quick: bool, device: str) -> None:
        self.name, self.sets, self.device = name, sets, device
        self.seed = _single([seed, *name.encode()])  # other candidates for every network
        self.job = job
        batch = job.settings.batch
        plan = ([(count, 1), (max(count // 4, 4), 2)] if quick else
                [(count, 8), (max(count // 4, 16), 32), (max(count // 16, 8), 120)])
        self.rungs = [Rung(*entry, batch, group=64 if device == 'cpu' else 1024) for entry in plan]

    def widths(self, candidate: Candidate) -> tuple[int, ...]:
        """Units per layer, inputs first."""
        return (self.job.settings.widths[0], *candidate.hidden, self.job.settings.widths[-1])

    def cost(self, candidate: Candidate) -> int:
        """Multiply-adds of its network."""
        return multiply_adds(self.widths(candidate))

    def candidates(self) -> list[Candidate]:
        """Settings over the ranges in which trainings of this kind are made."""
        s = self.job.settings
        found = [Candidate(0, s.widths[1:3], s.rate, s.momentum, s.initial, shipped=True)]
        for number in range(1, self.rungs[0].candidates):
            rng = np.random.default_rng([self.seed, _CANDIDATES, number])
            hidden = (int(rng.integers(6, 25)), int(rng.integers(6, 25)))
            found.append(Candidate(
                number, hidden, log_uniform(rng, 3e-3, 1.0),
                1.0 - log_uniform(rng, 0.03, 1.0), log_uniform(rng, 0.1, 3.0)))
        return found

    def start(self, candidate: Candidate) -> Layers:
        """Random weights in the candidate's range."""
        return drawn(np.random.default_rng([self.seed, _START, candidate.number]),
                     self.widths(candidate), candidate.initial)

    def train(self, number: int, group: Sequence[Candidate], start: Sequence[Layers],
              seed: Sequence[int]) -> tuple[list[Layers], list[Scores]]:
        """Backpropagation with momentum; the error is the cross-validation RMSE [rad]."""
        rung = self.rungs[number]
        widths = [self.widths(one) for one in group]
        settings = PaperSettings(
            tuple(max(layer) for layer in zip(*widths)), networks=len(group), epochs=rung.effort,
            batch=rung.batch, rate=[one.rate for one in group],
            momentum=[one.momentum for one in group], seed=_single(seed), device=self.device)
        fitted = fit(self.sets['training'], self.sets['cross-validation'], settings,
                     start=batched(start))
        external = self.sets['external']
        x = torch.tensor((external.inputs - fitted.mean) / fitted.deviation, dtype=torch.float32,
                         device=self.device)
        right = torch.tensor(external.outputs, dtype=torch.float32, device=self.device)
        error = wrapped(outputs_of(fitted.weights, fitted.biases, x)[-1].sub_(right))
        outside = error.square().mean(dim=(1, 2)).sqrt().cpu().numpy()
        scores = [{'error': float(inside), 'external': float(beyond)}
                  for inside, beyond in zip(fitted.error, outside)]
        return unbatched([*fitted.weights, *fitted.biases], widths), scores

    def keep(self, ranked: Sequence[Candidate], count: int) -> list[Candidate]:
        """The best."""
        return list(ranked[:count])


def paper_searches(*, seed: int, count: int, quick: bool, device: str) -> list[PaperSearch]:
    """One for the network with discontinuities, one for each subset of that without.

    Half of the candidates are the first's. External sets are cut to what ranks a few finalists.
    """
    counts, subset_counts = (((400, 200, 200),) * 2 if quick else
                             ((8000, 5000, 5000), (10000, 6000, 5000)))
    common = {'seed': seed, 'quick': quick, 'device': device}
    found = [PaperSearch('paper', train.JOBS['paper'], dataset.paper(seed, counts=counts),
                         count=count - 2 * (count // 4), **common)]
    for subset, sets in dataset.continuous(seed, counts=subset_counts).items():
        found.append(PaperSearch(f'paper-continuous, {subset}', train.JOBS['paper-continuous'],
                                 sets, count=count // 4, **common))
    return found


# --- pages, tables, plots -------------------------------------------------------------------------


def last_scores(done: Progress) -> dict[int, tuple[int, Scores]]:
    """Rungs that each candidate was in, and what it reached in the last of them."""
    return {number: (count, scores) for count, rung in enumerate(done.scores, start=1)
            for number, scores in rung.items()}


def write_csv(path: Path, searches: Iterable[tuple[Search, Progress]]) -> None:
    """All candidates of all searches, with the scores of their last rung."""
    rows = []
    for search, done in searches:
        last = last_scores(done)
        for one in search.candidates():
            entry = dataclasses.asdict(one)
            units = entry.pop('hidden')
            count, scores = last[one.number]
            rows.append({'search': search.name, 'number': entry.pop('number'),
                         **{f'hidden_{k}': width for k, width in enumerate(units, start=1)},
                         'multiply_adds': search.cost(one),
                         **{key: f'{value:.6g}' if isinstance(value, float) else value
                            for key, value in entry.items()},
                         'rungs': count,
                         **{key: f'{value:.6g}' for key, value in scores.items()}})
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator='\n')
        writer.writeheader()
        writer.writerows(rows)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ['---:'] * len(head), *rows]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def _rungs(search: Search, unit: str) -> str:
    return _table(['rung', 'candidates', unit, 'batch'], (
        [str(number), f'{rung.candidates:,}', f'{rung.effort:,}', f'{rung.batch:,}']
        for number, rung in enumerate(search.rungs, start=1)))


def _units(one: Candidate) -> str:
    return '-'.join(map(str, one.hidden))


def _measured(seconds: float, device: str, command: str) -> str:
    place = (f'on {torch.cuda.get_device_name()} in {seconds / 60.0:.1f} minutes'
             if device == 'cuda' else
             f'in {seconds / 60.0:.1f} minutes of one core of {processor()}')
    return f'Made by `{command}` {place}.'


def mlp_page(search: MlpSearch, done: Progress, header: str) -> str:
    """The frontier of speed against error as a page of Markdown."""
    last = done.scores[-1]
    finalists = [one for one in search.candidates() if one.number in last]
    times = batch_times([one.hidden for one in finalists])
    # Sizes are compared by their multiply-adds: measured times of neighbours cross by their noise.
    front = frontier([search.cost(one) for one in finalists],
                     [last[one.number]['error'] for one in finalists])
    shipped = next(k for k, one in enumerate(finalists) if one.shipped)
    rows = []
    for k in sorted({*front, shipped}, key=lambda k: search.cost(finalists[k])):
        one, scores = finalists[k], last[finalists[k].number]
        name = f'**{_units(one)}, in use**' if one.shipped else _units(one)
        rows.append([name, f'{search.cost(one):,}', f'{times[k]:.0f}', f'{one.rate:.2g}',
                     f'{scores["mean"]:.3f}', f'{scores["error"]:.2f}', f'{scores["worst"]:.1f}'])
    error = last[0]['error']
    smallest, largest = front[0], front[-1]  # the frontier runs from cheap to good
    shipped_p99 = _shipped_error(search)
    trained = ('' if shipped_p99 is None else
               f'\nThe weights in use, trained to the end, have {shipped_p99:.2f} % on the same '
               f'contacts.')
    return f"""# How large the MLP should be

{header}

{len(done.scores[0]):,} networks with {UNITS[0]} to {UNITS[-1]} hidden units, in
steps of {UNITS[1] - UNITS[0]}, and learning rates of 0.001 to 0.1 were trained by successive
halving: all of them a little, then the best of every class of cost longer. Error: point error
against `exact` on {len(search.data[1]):,} contacts of the training mixture, in % of the
smaller box's longest edge, after the last rung. These trainings are short (`train` takes
{mlp_recipe.STEPS:,} steps of {mlp_recipe.BATCH:,} contacts): what counts is how sizes compare.

{_rungs(search, 'steps')}

The frontier: no other finalist is both cheaper and better. Time: a pair in a batch of `mlp`, from
its poses to its contact, on one core ({native.instruction_set}); the least of some rounds.

{_table(['hidden units', 'multiply-adds', 'ns a pair', 'learning rate', 'mean', 'p99', 'worst'],
        rows)}

![The frontier](search.png)

**Why {_units(finalists[shipped])}.** A pair takes {times[shipped]:.0f} ns, and the p99 is
{error:.2f} %. The smallest finalist, {_units(finalists[smallest])}, takes
{times[smallest]:.0f} ns and has {last[finalists[smallest].number]['error']:.2f} %. The best of any
size, {_units(finalists[largest])}, takes {times[largest]:.0f} ns and has
{last[finalists[largest].number]['error']:.2f} %.{trained}

All candidates: [search.csv](search.csv). The search for the paper's networks:
[search_paper.md](search_paper.md).
"""


def mlp_plot(path: Path, search: MlpSearch, done: Progress) -> None:
    """Error against cost of all candidates, with the frontier of the finalists."""
    pyplot = _pyplot()
    figure, axes = pyplot.subplots(figsize=(8.0, 4.0), layout='constrained')
    all_of_them = search.candidates()
    last = last_scores(done)
    colours = pyplot.get_cmap('viridis_r')(np.linspace(0.15, 1.0, len(done.scores)))
    for count, colour in enumerate(colours, start=1):
        some = [one for one in all_of_them if last[one.number][0] == count]
        axes.scatter([search.cost(one) for one in some],
                     [last[one.number][1]['error'] for one in some], s=6 + 4 * count,
                     color=colour, linewidths=0, label=f'left after rung {count}'
                     if count < len(done.scores) else 'finalists')
    finalists = [one for one in all_of_them if last[one.number][0] == len(done.scores)]
    costs = [search.cost(one) for one in finalists]
    errors = [last[one.number][1]['error'] for one in finalists]
    front = frontier(costs, errors)
    axes.plot([costs[k] for k in front], [errors[k] for k in front], color='#222222', linewidth=1,
              label='frontier')
    axes.plot(search.cost(all_of_them[0]), last[0][1]['error'], '*', color='#ee6677', markersize=14,
              label=f'in use: {_units(all_of_them[0])}')
    axes.set(xscale='log', yscale='log', xlabel='multiply-adds of the network',
             ylabel='p99 of the point error, % of the edge')
    for axis, ticks in ((axes.xaxis, (350, 700, 1400, 2800, 5600)),
                        (axes.yaxis, (1, 2, 5, 10, 20))):
        axis.set_ticks(ticks, [f'{tick:,}' for tick in ticks])
        axis.set_ticks([], minor=True)
    figure.legend(frameon=False, fontsize=8, loc='outside right upper')
    axes.spines[['top', 'right']].set_visible(False)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def paper_page(searches: Sequence[tuple[PaperSearch, Progress]], header: str) -> str:
    """Best settings and the rank of those in use, as a page of Markdown."""
    total = sum(len(done.scores[0]) for _, done in searches)
    parts = [f"""# The paper's search, done again

{header}

The paper trained over 2,000 networks to set learning rate, momentum, hidden units and the range of
the initial weights. Here {total:,} were, over the same four, by successive halving: all a few
epochs, the better quarter longer, and so on; each rung is a full training, in which the learning
rate falls to zero and which is stopped by cross-validation. Ranges: 6 to 24 units in either layer,
learning rate 0.003 to 1, momentum 0 to 0.97, initial weights to ± 0.1 to 3 / √(inputs of the
layer). RMSE over the four angles, in rad. The settings in use, from `train`, took part to the end;
they are meant for longer trainings than those here.

![Settings and errors](search_paper.png)
"""]
    for search, done in searches:
        finalists = [one for one in search.candidates() if one.number in done.scores[-1]]
        ranked = ranking(finalists, done.scores[-1])
        rank = next(place for place, one in enumerate(ranked, start=1) if one.shipped)
        early = ranking(search.candidates(), done.scores[0])
        first = next(place for place, one in enumerate(early, start=1) if one.shipped)
        best, in_use = done.scores[-1][ranked[0].number], done.scores[-1][0]
        rows = []
        for place, one in enumerate(ranked, start=1):
            if place > 8 and not one.shipped:
                continue
            scores = done.scores[-1][one.number]
            rows.append([str(place), f'**{_units(one)}, in use**' if one.shipped else _units(one),
                         f'{one.rate:.3f}', f'{one.momentum:.2f}', f'{one.initial:.2f}',
                         f'{scores["error"]:.4f}', f'{scores["external"]:.4f}'])
        parts.append(f"""## {search.name}

{_rungs(search, 'epochs')}

{_table(['place', 'hidden units', 'learning rate', 'momentum', 'initial range',
         'cross-validation', 'external'], rows)}

The settings in use are {rank} of {len(ranked)} finalists (after the first rung {first} of
{len(early):,}); the best has an RMSE of {best['error'] / in_use['error']:.2f} times theirs.
""")
    parts.append("""All candidates: [search_paper.csv](search_paper.csv). The search for the \
MLP:
[search.md](search.md).
""")
    return '\n'.join(parts)


def paper_plot(path: Path, searches: Sequence[tuple[PaperSearch, Progress]]) -> None:
    """Error after the first rung against each of the four settings."""
    pyplot = _pyplot()
    figure, rows = pyplot.subplots(len(searches), 4, figsize=(10.0, 2.4 * len(searches)),
                                   sharey='row', squeeze=False, layout='constrained')
    for axes, (search, done) in zip(rows, searches):
        some = search.candidates()
        error = [done.scores[0][one.number]['error'] for one in some]
        columns = {'learning rate': [one.rate for one in some],
                   'momentum': [one.momentum for one in some],
                   'multiply-adds': [search.cost(one) for one in some],
                   'initial range': [one.initial for one in some]}
        for panel, (title, values) in zip(axes, columns.items()):
            panel.scatter(values, error, s=4, color='#4477aa', linewidths=0)
            panel.plot(values[0], error[0], '*', color='#ee6677', markersize=11)
            panel.set_xlabel(title, fontsize=8)
            panel.tick_params(labelsize=7)
            panel.spines[['top', 'right']].set_visible(False)
            if title in ('learning rate', 'initial range'):
                panel.set_xscale('log')
        axes[0].set_ylabel(f'{search.name}\nRMSE, rung 1 [rad]', fontsize=8)
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def _pyplot():
    import matplotlib

    matplotlib.use('Agg')  # before pyplot: no display is needed
    from matplotlib import pyplot

    return pyplot


# --- the program ----------------------------------------------------------------------------------


def _options(args: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Train thousands of networks at once, keep the best, train those longer.\n\n'
        'Measured on one core, without a GPU:\n'
        '  mlp        size and learning rate of the MLP                    5 minutes\n'
        "  paper      the paper's search for its two networks              3 minutes\n\n"
        'Stopped, it goes on from its checkpoint file when it is started again with the same\n'
        'options, and ends with the same result.')
    parser.add_argument('what', choices=('mlp', 'paper'), help='what is searched for')
    parser.add_argument('--candidates', type=int, default=2048, metavar='N',
                        help='networks to begin with (default 2048); the time grows with them')
    parser.add_argument('--seed', type=seed_number, default=1,
                        help='of everything random (default 1)')
    parser.add_argument('--out', type=Path, default=Path(), help='folder for the page, the table, '
                        'the plot and, until the end, the checkpoint (default: the current one)')
    parser.add_argument('--device', choices=('auto', 'cpu', 'cuda'), type=device_of,
                        default='auto', help='auto: a GPU where there is one (default)')
    parser.add_argument('--threads', type=int, default=1, help='of PyTorch (default 1; matrices '
                        'this small gain little from more)')
    parser.add_argument('--quick', action='store_true',
                        help='little data and two short rungs, to try it out in seconds')
    options = parser.parse_args(args)
    for name, least in (('candidates', 16), ('threads', 1)):
        if getattr(options, name) < least:
            parser.error(f'--{name} {getattr(options, name)} is too small: {least} or more')
    make_folder(parser, options.out)
    return options


def main(args: Sequence[str] | None = None) -> int:
    """Search, and write what was found."""
    options = _options(args)
    _pyplot()  # if it is missing, that is said now
    torch.set_num_threads(options.threads)
    common = {'seed': options.seed, 'count': options.candidates, 'quick': options.quick,
              'device': options.device}
    # On a CPU its own time counts, whatever else the machine does.
    clock = time.process_time if options.device == 'cpu' else time.monotonic
    began = clock()
    searches: list[Search] = ([MlpSearch(**common)] if options.what == 'mlp' else
                              [*paper_searches(**common)])
    name = 'search' if options.what == 'mlp' else 'search_paper'
    results, checkpoints = [], []
    for number, search in enumerate(searches):
        path = options.out / f'{name}_{number}.checkpoint'
        if path.exists():
            print(f'going on from {path}')
        try:
            results.append((search, run(search, path)))
        except CheckpointError as error:
            print(f'search: {error}', file=sys.stderr)
            return 1
        checkpoints.append(path)
    command = f'python -m box_contact_ros search {options.what} --out docs/' + ''.join(
        f' --{key} {getattr(options, key)}' for key, usual in (('candidates', 2048), ('seed', 1))
        if getattr(options, key) != usual) + (' --quick' if options.quick else '')
    header = _measured(clock() - began, options.device, command)
    if options.what == 'mlp':
        mlp_plot(options.out / f'{name}.png', *results[0])
        text = mlp_page(*results[0], header)
    else:
        paper_plot(options.out / f'{name}.png', results)
        text = paper_page(results, header)
    (options.out / f'{name}.md').write_text(text, 'utf-8')
    write_csv(options.out / f'{name}.csv', results)
    for path in checkpoints:
        path.unlink()
    print(text)
    return 0


if __name__ == '__main__':
    sys.exit(main())
