# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `native`: libbox_contact and other engines, C against C.

`python -m benchmarks.native` compiles native_calls/, which calls all in turn, and writes native.md
and native.csv. It runs copies of the program, each with its own copy of the library, as times
depend on where code lies in memory. MuJoCo's wheel has its headers and its library. Coal and Bullet
are compiled in where pkg-config finds them; the exit status is 1 where one is left out.
"""
from __future__ import annotations

import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np

from box_contact_ros.core import FORCE, instruction_sets
from box_contact_ros.extras import require
from box_contact_ros.models.networks import SHIPPED_PAPERS, PaperWeights, mlp_numbers
from box_contact_ros.models.weights_file import load_weights
from box_contact_ros.resources import resource_path

from . import native_picture, output, settled
from .contestant import MLP_SIZES
from .engines import add_leave_out, may_miss
from .output import markdown_table, percentiles
from .pose_sets import FLUSH, LOADS, SETS, Pairs, drawn
from .timing import by_round, pinned, usable_cores

COPIES, PAIRS, ROUNDS, CALLS = 7, 20_000, 11, 2_000
QUICK_COPIES, QUICK_PAIRS, QUICK_ROUNDS, QUICK_CALLS = 2, 1_000, 1, 200
CONTACTS, PASSES = 100_000, 30
"""Contacts of all sets, each timed alone in every pass; its time is the least of the passes."""
QUICK_CONTACTS, QUICK_PASSES = 2_000, 3
EACH = ('exact', 'mlp')
PERCENTS = {'p50': 50, 'p99.9': 99.9, 'slowest': 100}
GOALS = {'slowest': 1.5, 'p99.9': 1.3}
"""Of all contacts by `mlp`: at most so many times the median one."""
MIXED = 'containers, 20 % touching'
UNIT = 'mjc_BoxBox, single'
OURS = tuple(f'exact {finds}, {way}' for way in ('single', 'batch')
             for finds in ('volume', 'covariance'))
ROOT = Path(__file__).parents[1]
CALLS_FOLDER = Path(__file__).with_name('native_calls')
LIBRARY = Path(sys.prefix, 'lib', 'libbox_contact.so')  # its headers are in include/
OPTIONAL = {'coal': 'pip install coal cmeel-eigen', 'bullet': 'apt install libbullet-dev'}
"""By file of native_calls/ and by name for pkg-config: what brings headers and library."""
RIVALS = ('mj', *(name.capitalize() for name in OPTIONAL))
"""How the names of engines' contestants begin; they are the last columns."""
CLEAR = 1e-6
"""Least gap or depth, of the size, at which verdicts are compared; Bullet's are single floats."""
MOST_WRONG, MOST_OFF = 0.2, 0.1
"""Share of wrong verdicts, and median depth error [%], above which the call itself must be wrong.
Bullet's query in single precision misses up to a tenth of the shallow contacts of overhang."""


class Times(NamedTuple):
    """One contestant on one set."""

    nanoseconds: np.ndarray  # (copies, rounds), of a pair
    missed: int
    invented: int
    judged: int  # pairs farther than `CLEAR` from touch
    depth_errors: tuple[float, float, float]  # median, p99, worst against `exact`, of the size [%]


OnSet = Mapping[str, Times]  # by contestant


def package_config(name: str, *options: str) -> str | None:
    """Return what pkg-config answers about a library; None where either is not installed."""
    tool = shutil.which('pkg-config')
    if tool is None:
        return None
    folders = os.environ.get('PKG_CONFIG_PATH', '').split(os.pathsep)
    spec = importlib.util.find_spec(name)
    for above in Path(spec.origin).parents if spec and spec.origin else ():
        if above.name == 'cmeel.prefix':  # what wheels of cmeel install into
            folders += [str(above / 'lib/pkgconfig'), str(above / 'share/pkgconfig')]
    done = subprocess.run([tool, *options, name], capture_output=True, text=True, env={
        **os.environ, 'PKG_CONFIG_PATH': os.pathsep.join(folders)})
    return None if done.returncode else done.stdout.strip()


def package_flags(name: str) -> list[str] | None:
    """Return a library's flags for the compiler and the linker; None where it is not installed.

    The standard is ours: FCL's flags name C++11, which MuJoCo's headers refuse.
    """
    answer = package_config(name, '--cflags', '--libs')
    if answer is None:
        return None
    flags = [flag for flag in shlex.split(answer) if not flag.startswith('-std=')]
    return flags + [f'-Wl,-rpath,{flag[2:]}' for flag in flags if flag.startswith('-L')]


def library_flags(instruction_set: str) -> list[str]:
    """Return the flags by which CMakeLists.txt compiles a kernel."""
    text = (ROOT / 'CMakeLists.txt').read_text('utf-8')
    own, shared = (re.search(pattern, text, re.DOTALL) for pattern in (
        rf'set\(FLAGS_{instruction_set} ([^)]*)\)', r'\n    (-ffp-contract=off[^$]*)\$<'))
    assert own and shared
    return [*own[1].split(), *shared[1].split(), '-falign-loops=32', '-falign-jumps=16']


def compiled(folder: Path, sets: Sequence[str]) -> tuple[Path, list[str]]:
    """Compile native_calls/ into a folder; return the program, and the rivals that are left out.

    The library lies beside the program. sets: the instruction sets that it is for.

    Raises `RuntimeError` with what the compiler reports.
    """
    spec = importlib.util.find_spec('mujoco')
    if spec is None or spec.origin is None:
        raise RuntimeError("MuJoCo is not installed: pip install -e '.[sim]'")
    mujoco = Path(spec.origin).parent
    options = {name: package_flags(name) for name in OPTIONAL}
    rivals = {name: flags for name, flags in options.items() if flags is not None}
    flags = [flag for name, more in rivals.items() for flag in (f'-DWITH_{name.upper()}', *more)]
    compiler = [os.environ.get('CXX', 'g++'), '-std=c++17', '-Wall', '-Wextra',
                f'-I{Path(sys.prefix, "include")}']
    networks = {name: str(folder / f'{name}.o') for name in sets}
    for name, made in networks.items():
        run_compiler([*compiler, *library_flags(name), '-Wno-psabi', '-c',
                      f'-DADD_NETWORKS=add_networks_{name}', str(CALLS_FOLDER / 'networks.cpp'),
                      '-o', made])
        flags += [f'-DWITH_{name.upper()}', made]
    # Old tags: LD_LIBRARY_PATH must not replace the library beside the program by another.
    run_compiler(
        [*compiler, '-O2', f'-I{mujoco / "include"}', '-Wl,--disable-new-dtags',
         *[str(CALLS_FOLDER / f'{name}.cpp') for name in (
             'main', 'contestants', 'mujoco', 'ours', *rivals)],
         '-o', str(folder / 'native'), shutil.copy(LIBRARY, folder),
         str(next(mujoco.glob('libmujoco.so*'))), '-Wl,-rpath,$ORIGIN',
         f'-Wl,-rpath,{mujoco}', *flags])
    return folder / 'native', [name for name in OPTIONAL if name not in rivals]


def copied(program: Path, folder: Path) -> Path:
    """Return a copy of the program in a new folder, with libraries of its own beside it."""
    folder.mkdir()
    for library in program.parent.glob('lib*.so'):
        shutil.copy(library, folder)
    return Path(shutil.copy(program, folder))


def run_compiler(command: Sequence[str]) -> None:
    """Run a compiler; raises `RuntimeError` with what it reports."""
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f'native_calls does not compile:\n{done.stderr}')


def networks_for(pairs: Pairs) -> bytes:
    """Return the networks that answer for these pairs, as native_calls/ reads them.

    They are the other sizes of `mlp`, and the paper's where both boxes have a size that it knows.
    """
    networks = {name: mlp_numbers(path) for name, path in MLP_SIZES.items()}
    for name in SHIPPED_PAPERS:
        paper = PaperWeights(load_weights(resource_path('weights', f'{name}.safetensors')))
        if paper.fits(pairs.size_a, pairs.size_b).all():
            networks['paper'] = paper.numbers
    return b''.join(np.array([len(name), len(numbers)]).tobytes() + name.encode()
                    + numbers.tobytes() for name, numbers in networks.items())


def calls_shown(missing: Sequence[str], folder: Path = CALLS_FOLDER) -> str:
    """Return the code of each call, as it was compiled."""
    blocks = []
    for file in sorted(folder.glob('*.cpp')):
        _, *parts = file.read_text(encoding='utf-8').split('// call: ')
        for name, _, rest in (part.partition('\n') for part in parts if file.stem not in missing):
            code = textwrap.dedent(rest[:rest.index('// end of call')].rstrip())
            blocks.append(f'{name}:\n\n```c++\n{code}\n```')
    return '\n\n'.join(blocks)


def sets(count: int) -> dict[str, Pairs]:
    """Return recorded pairs of goods at rest, and `count` pairs of each drawn set.

    Last, containers, a fifth of them in contact.
    """
    recorded = {name: pairs.rows(slice(count))
                for name, pairs in settled.by_engine(settled.read()).items()}
    by_name = {name: drawn(make, np.random.default_rng([3, place]), count)
               for place, (name, make) in enumerate((SETS | LOADS | FLUSH).items())}
    mixed = by_name['containers']
    apart = np.random.default_rng(3).random(len(mixed.pose_b)) < 0.8
    pose_b = mixed.pose_b.copy()
    pose_b[apart, :3] *= 1.5
    return {**recorded, **by_name, MIXED: mixed._replace(pose_b=pose_b)}


def run(program: Path, pairs: Pairs, instruction_set: str, *arguments: object) -> list[str]:
    """Return the lines that the program prints for some pairs, with one instruction set."""
    poses = program.parent / 'poses'
    poses.write_bytes(np.int64(len(pairs.pose_a)).tobytes()
                      + b''.join(np.ascontiguousarray(part).tobytes() for part in pairs))
    done = subprocess.run([program, poses, *map(str, arguments)], capture_output=True, text=True,
                          env={**os.environ, FORCE: instruction_set})
    if done.returncode:
        raise RuntimeError(f'the program ended with status {done.returncode}: {done.stderr}')
    return done.stdout.splitlines()


def each_contact(program: Path, by_set: Mapping[str, Pairs], instruction_set: str, count: int,
                 passes: int) -> dict[str, np.ndarray]:
    """Return the times (2, n) of `exact` and `mlp` for n contacts of each set, one by one [ns].

    There are at most `count` contacts in all. A time is the least of all passes, so what disturbs
    one pass does not count, and an empty reading of the clock is subtracted.
    """
    share = count // len(by_set)
    touching = {name: pairs.rows(rows[:share]) for name, pairs in by_set.items()
                if len(rows := np.flatnonzero(pairs.contacts().colliding))}
    asked = Pairs(*(np.concatenate(columns) for columns in zip(*touching.values())))
    lines = run(program, asked, instruction_set, passes)
    times = np.array([line.split('\t') for line in lines], dtype=float).T
    ends = np.cumsum([len(pairs.size) for pairs in touching.values()])[:-1]
    return dict(zip(touching, np.split(times, ends, axis=1)))


def timed(program: Path, pairs: Pairs, instruction_set: str, *, rounds: int, calls: int) -> OnSet:
    """Return times and errors of all contestants on one set, in one process.

    The times are those of one copy, (1, rounds).
    """
    answers, networks = program.parent / 'answers', program.parent / 'networks'
    networks.write_bytes(networks_for(pairs))
    first, names, *lines = run(program, pairs, instruction_set, rounds, calls, answers, networks)
    if first != instruction_set:
        raise RuntimeError(f'{instruction_set} was asked for, and the library answered {first!r}')
    times: dict[str, list[float]] = {name: [] for name in names.split('\t')}
    for line in lines:
        name, nanoseconds = line.split('\t')
        times[name].append(float(nanoseconds))
    separations = np.fromfile(answers).reshape(len(times), -1)
    return {name: judged(name, np.array([times[name]]), separation, pairs)
            for name, separation in zip(times, separations)}


def of_copies(runs: Sequence[OnSet]) -> OnSet:
    """Return the runs of all copies as one, whose times have a row for each copy."""
    return {name: one._replace(nanoseconds=np.concatenate([run[name].nanoseconds for run in runs]))
            for name, one in runs[0].items()}


def judged(name: str, nanoseconds: np.ndarray, separation: np.ndarray, pairs: Pairs) -> Times:
    """Compare signed separations (n,) of the first n pairs with those of `exact`.

    Raises `RuntimeError` where so many verdicts are wrong that the call must be.
    """
    first = pairs.rows(slice(len(separation)))
    truth, size = first.contacts().separation, first.size
    clear = np.abs(truth) > CLEAR * size
    missed, invented = ((separation > 0.0) & (truth < 0.0) & clear,
                        (separation <= 0.0) & (truth > 0.0) & clear)
    both = (separation <= 0.0) & (truth < 0.0)
    errors = 100.0 * np.abs(separation - truth)[both] / size[both]
    p50, p99, worst = percentiles(errors, 50, 99, 100)
    if (missed | invented).sum() > MOST_WRONG * len(truth) or p50 > MOST_OFF:
        raise RuntimeError(f'{name} misses {missed.sum()} and invents {invented.sum()} contacts of '
                           f'{len(truth)} pairs; its median depth error is {p50:.3g} % of the size')
    return Times(nanoseconds, int(missed.sum()), int(invented.sum()), int(clear.sum()),
                 (p50, p99, worst))


class Ratio(NamedTuple):
    """What one contestant's time is relative to another's: the median of the copies, and its range.

    A copy's ratio is the median of its rounds' own. The range of seven copies holds the median of
    all copies with a probability of 1 - 2 / 2**7, 98 %, whatever their distribution.
    """

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, times: OnSet, name: str, unit: str = UNIT) -> Ratio:
        """Return the ratio of two contestants."""
        by_copy = by_round(times[name].nanoseconds.T, times[unit].nanoseconds.T)
        return cls(*percentiles(by_copy, 50, 0, 100))

    def __str__(self) -> str:
        return f'{self.median:.2f} [{self.low:.2f}, {self.high:.2f}]'

    def columns(self, name: str) -> dict[str, float]:
        """Return the columns of the CSV file, whose names begin alike."""
        return {name: self.median, f'{name}_low': self.low, f'{name}_high': self.high}


def sets_table(by_set: Mapping[str, OnSet], way: str) -> str:
    """Return a row per set: the time of `UNIT`, and the ratios of contestants to it.

    way: of those contestants, single or batch. Engines have the last columns.
    """
    every = sorted(dict.fromkeys(name for times in by_set.values() for name in times
                                 if name != UNIT and name.endswith(f', {way}')),
                   key=lambda name: name.startswith(RIVALS))
    return markdown_table(
        ['', '`mjc_BoxBox` [ns]', *(name.removesuffix(f', {way}') for name in every)],
        [[of_set, f'{np.median(times[UNIT].nanoseconds):.0f}',
          *(str(Ratio.of(times, name)) if name in times else '–' for name in every)]
         for of_set, times in by_set.items()])


def models_table(by_set: Mapping[str, OnSet]) -> str:
    """Return a row per set: the ratios of `mlp` to `exact`."""
    return markdown_table(['', *(name.replace('exact ', '') for name in OURS)], [
        [of_set, *(str(Ratio.of(times, name.replace('exact', 'mlp'), name)) for name in OURS)]
        for of_set, times in by_set.items()])


def scenes_table(by_scene: Mapping[str, Pairs], times: Mapping[str, OnSet]) -> str:
    """Return a row per recorded scene: the ratios to `UNIT` of calls and batches of `exact`."""
    return markdown_table(['scene', 'contacts', *OURS], [
        [name, f'{len(by_scene[name].size)}', *(str(Ratio.of(here, one)) for one in OURS)]
        for name, here in times.items()])


def slowest_table(times: Mapping[str, np.ndarray]) -> str:
    """Return a row per set: the times of single contacts, and the slowest by the median of all."""
    of_all = np.concatenate(list(times.values()), axis=1)
    lines = []
    for name, both in {**times, 'all': of_all}.items():
        line = [name, f'{both.shape[1]:,}']
        for mine, others in zip(both, of_all):
            values = percentiles(mine, *PERCENTS.values())
            line += [*(f'{value:.0f}' for value in values),
                     f'{values[-1] / np.median(others):.2f}']
        lines.append(line)
    return markdown_table(['', 'contacts', *(f'`{model}`: {name}' for model in EACH for name in (
        *PERCENTS, 'slowest / p50 of all'))], lines)


def goals(times: Mapping[str, np.ndarray]) -> str:
    """Return what `GOALS` names of the times of single contacts, and which goals are missed."""
    of_all = np.concatenate([both[EACH.index('mlp')] for both in times.values()])
    found = {name: float(np.percentile(of_all, PERCENTS[name]) / np.median(of_all))
             for name in GOALS}
    return ', '.join(f'{name} {found[name]:.2f} (at most {most:g}: '
                     f'{"met" if found[name] <= most else "goal missed"})'
                     for name, most in GOALS.items())


def contact_rows(found: Mapping[str, Mapping[str, np.ndarray]]) -> Iterator[dict[str, object]]:
    """Yield a row per instruction set, set and model: the times of single contacts."""
    for instruction_set, by_set in found.items():
        for name, both in by_set.items():
            for model, times in zip(EACH, both):
                yield {'instruction_set': instruction_set, 'set': name,
                       'contestant': f'{model} covariance, each contact', 'judged': len(times),
                       **{f'{column}_ns': value for column, value in zip(
                           PERCENTS, percentiles(times, *PERCENTS.values()))}}


def csv_rows(found: Mapping[str, Mapping[str, OnSet]]) -> Iterator[dict[str, object]]:
    """Yield a row per instruction set, set and contestant."""
    for instruction_set, by_set in found.items():
        for name, times in by_set.items():
            for contestant, one in times.items():
                yield {'instruction_set': instruction_set, 'set': name, 'contestant': contestant,
                       'min_ns': one.nanoseconds.min(), 'p50_ns': float(np.median(one.nanoseconds)),
                       **Ratio.of(times, contestant).columns('by_unit'),
                       'judged': one.judged, 'missed': one.missed, 'invented': one.invented,
                       **dict(zip(('depth_p50', 'depth_p99', 'depth_worst'), one.depth_errors)),
                       **(Ratio.of(times, contestant, contestant.replace('mlp', 'exact'))
                          .columns('by_exact') if contestant.startswith('mlp ') else {})}


def main(args: Sequence[str] | None = None) -> int:
    """Compile, measure, print, write; 2 where the program cannot be made."""
    from tqdm import tqdm

    parser = output.report_parser(
        'native', __doc__, quick='few pairs and rounds, to try it out',
        out='native.md, native.csv, native.png')
    add_leave_out(parser)
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    require('report', 'sim')
    count, pairs, rounds, calls = (
        (QUICK_COPIES, QUICK_PAIRS, QUICK_ROUNDS, QUICK_CALLS) if options.quick
        else (COPIES, PAIRS, ROUNDS, CALLS))
    most, passes = (QUICK_CONTACTS, QUICK_PASSES) if options.quick else (CONTACTS, PASSES)
    names = [name for name in instruction_sets() if name != 'baseline']
    best = names[-1]
    found: dict[str, dict[str, OnSet]] = {name: {} for name in names}
    with tempfile.TemporaryDirectory() as made:
        try:
            program, missing = compiled(Path(made), names)
            if not (options.quick or may_miss('native', missing, options.leave_out)):
                return 2
        except RuntimeError as error:
            print(f'native: {error}', file=sys.stderr)
            return 2
        copies = [copied(program, Path(made, f'copy {number}')) for number in range(count)]
        with pinned({usable_cores()[-1]}):
            by_set = sets(pairs)
            for of_set, chosen in tqdm(by_set.items(), desc='native', unit='set'):
                # Copies outside, so that instruction sets take turns.
                runs = [{name: timed(copy, chosen, name, rounds=rounds, calls=calls)
                         for name in names} for copy in copies]
                for name in names:
                    found[name][of_set] = of_copies([run[name] for run in runs])
            by_scene = settled.by_scene(settled.read())
            scenes = {of_scene: of_copies([timed(copy, chosen, best, rounds=rounds, calls=calls)
                                           for copy in copies])
                      for of_scene, chosen in tqdm(by_scene.items(), desc='scenes', unit='scene')}
            del by_set[MIXED]  # its contacts are those of containers
            contacts = {name: each_contact(program, by_set, name, most, passes) for name in names}
    tables = {way: sets_table(found[best], way) for way in ('single', 'batch')}
    versions = [f'MuJoCo {metadata.version("mujoco")}', *(
        f'{name.capitalize()} {package_config(name, "--modversion")}' for name in OPTIONAL
        if name not in missing)]
    output.write_page(
        folder, 'native', args, machine=output.machine(), copies=count, rounds=rounds, calls=calls,
        pairs=pairs, best=best, **tables, models=models_table(found[best]),
        scenes=scenes_table(by_scene, scenes), slowest=slowest_table(contacts[best]),
        goals=goals(contacts[best]),
        passes=passes, code=calls_shown(missing), engines=', '.join(versions), missing=''.join(
            f'\n\nLeft out: {name.capitalize()} is not installed with its headers '
            f'(`{OPTIONAL[name]}`).' for name in missing))
    found[best].update(scenes)
    output.write_csv(folder / 'native.csv', [*csv_rows(found), *contact_rows(contacts)],
                     about=output.machine())
    drawn_sets = [*settled.by_engine(settled.read()), *SETS, *LOADS, *FLUSH]
    native_picture.draw(folder / 'native.png', folder / 'native.csv', best, drawn_sets)
    print(tables['single'], tables['batch'], sep='\n\n')
    for name in missing:
        print(f'native: {name.capitalize()} is left out: {OPTIONAL[name]}', file=sys.stderr)
    return 0


if __name__ == '__main__':
    sys.exit(main())
