# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The native core gives the same bits in every instruction set, thread, call and kind of array."""
from __future__ import annotations

import copy
import gc
import os
import pickle
import platform
import re
import shutil
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import poses
import pytest
from patience import PATIENCE
from poses import Pairs, assert_same_bits, fields
from test_extremes import random_network

import box_contact_ros
from benchmarks import probes
from benchmarks.weights import mlp_shapes
from box_contact_ros import Contact, ContactSolver, make_model
from box_contact_ros.core import FORCE, instruction_sets, native
from box_contact_ros.models.networks import core_numbers, mlp_numbers, read_mlp
from box_contact_ros.models.weights_file import Network
from box_contact_ros.resources import resource_path
from box_contact_ros.solver.contact import FIELDS, Contacts

PACKAGE = Path(box_contact_ros.__file__).parent
MLP_FILE = resource_path('weights', 'mlp.safetensors')
MODELS = ('exact', 'mlp')
SETS_HERE = instruction_sets()

every_model = pytest.mark.parametrize('model', MODELS)


def solve(solver: ContactSolver, pairs: Pairs, threads: int = 1) -> Contacts:
    return solver.batch(pairs.pose_a, pairs.pose_b, size_a=pairs.size_a, size_b=pairs.size_b,
                        threads=threads)


def a_solver(model: str) -> ContactSolver:
    return ContactSolver((1, 1, 1), (1, 1, 1), model=make_model(model))


def started(name: str, *words: str | Path) -> subprocess.Popen[str]:
    """Start Python with an instruction set."""
    return subprocess.Popen([sys.executable, *map(str, words)], env=os.environ | {FORCE: name},
                            text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


# --- instruction sets -----------------------------------------------------------------------------

ANSWERS = """
import sys
import numpy as np
from box_contact_ros import ContactSolver
from box_contact_ros.core import native
from box_contact_ros.solver.contact import FIELDS
pairs = np.load(sys.argv[1])
columns = [pairs[name] for name in ('pose_a', 'pose_b', 'size_a', 'size_b')]
found = {'instruction_set': native.instruction_set, 'lanes': native.lanes}
for model in ('exact', 'mlp'):
    solver = ContactSolver(model=model)
    many = solver.batch(*columns[:2], size_a=columns[2], size_b=columns[3])
    found |= {f'{model} {name}': getattr(many, name) for name in FIELDS}
nearest = solver.distance_batch(*columns[:2], size_a=columns[2], size_b=columns[3])
for name in ('distance', 'normal', 'point_a', 'point_b'):
    found[f'nearest {name}'] = getattr(nearest, name)
strange = native.Mlp(pairs['network'])
contacts = strange.solve(*columns, 1)[0]
found |= {f'strange {name}': getattr(contacts, name) for name in FIELDS}
for row in range(0, len(columns[0]), 40):
    a, b, size_a, size_b = (column[row] for column in columns)
    one = ContactSolver(size_a, size_b, model='exact')(a, b)
    for name in FIELDS:
        assert np.array_equal(getattr(one, name), found[f'exact {name}'][row],
                              equal_nan=True), (row, name)
np.savez(sys.argv[2], **found)
"""


def test_every_instruction_set_gives_the_same_bits(tmp_path: Path) -> None:
    """All answers of both models and of a random network, distances; 70,000 pairs, hard poses."""
    if len(SETS_HERE) == 1:
        pytest.skip('this machine has one instruction set only')
    pairs = poses.joined(poses.of_all_kinds(10_000, 1), poses.hard_pairs())
    np.savez(tmp_path / 'pairs.npz', **pairs._asdict(),
             network=random_network(np.random.default_rng(3)))
    running = {name: started(name, '-c', ANSWERS, tmp_path / 'pairs.npz', tmp_path / f'{name}.npz')
               for name in SETS_HERE}
    found = {}
    for name, process in running.items():
        output, _ = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, output
        found[name] = dict(np.load(tmp_path / f'{name}.npz'))
    assert len({str(one.pop('instruction_set')) for one in found.values()}) == len(SETS_HERE)
    assert len({int(one.pop('lanes')) for one in found.values()}) > 1
    wanted = found.pop(SETS_HERE[0])
    assert 0.3 < wanted['exact colliding'].mean() < 0.9
    for name, answers in found.items():
        for field, value in answers.items():
            assert np.array_equal(value, wanted[field], equal_nan=True), (name, field)


@pytest.mark.parametrize('name', SETS_HERE)
def test_a_forced_instruction_set_is_used(name: str) -> None:
    code = 'from box_contact_ros.core import native; print(native.kernel)'
    process = started(name, '-c', code)
    assert process.communicate(timeout=PATIENCE)[0].strip() == name


@pytest.mark.parametrize('value', ['avx', 'AVX2', 'none', 'baseline ', '../x', '_baseline'])
def test_an_unknown_instruction_set_is_refused(value: str) -> None:
    """The message names the variable, the value and the choice."""
    process = started(value, '-c', 'import box_contact_ros')
    output, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert output.strip().endswith(
        f'ImportError: {FORCE} is {value!r}, which is not one of: {", ".join(SETS_HERE)}')


FUSED = re.compile(r'\bvfn?m(?:add|sub|addsub|subadd)(?:132|213|231)(?:pd|sd)\b')
"""A fused multiply-add of doubles, as objdump names it."""


def disassembled(file: Path) -> str:
    tool = shutil.which('objdump')
    if platform.machine() not in ('x86_64', 'AMD64'):
        pytest.skip('the names of fused multiply-adds are known here for x86-64 only')
    if not tool:
        pytest.skip('objdump is not installed (Debian, Ubuntu: apt install binutils)')
    return subprocess.run([tool, '-d', '--no-show-raw-insn', file], capture_output=True, text=True,
                          check=True).stdout


@pytest.mark.parametrize('file', sorted(PACKAGE.rglob('*.so')), ids=lambda path: path.name)
def test_no_fused_multiply_add_of_doubles(file: Path) -> None:
    """A fused one rounds once instead of twice, so bits would depend on the instruction set."""
    text = disassembled(file)
    assert text.count('\n') > 1000
    found = FUSED.findall(text)
    assert not found, f'{len(found)} in {file.name}: {sorted(set(found))}'


def test_a_fused_multiply_add_would_be_found(tmp_path: Path) -> None:
    """The test above fails for what a compiler makes of a · b + c without our flags."""
    compiler = shutil.which(os.environ.get('CXX', 'g++').split()[0])
    if not compiler:
        pytest.skip('no C++ compiler is installed')
    source, file = tmp_path / 'one.cpp', tmp_path / 'one.o'
    source.write_text('double f(double a, double b, double c) { return a * b + c; }\n')
    for flags, found in (([], True), (['-ffp-contract=off'], False)):
        subprocess.run([compiler, '-O3', '-march=x86-64-v3', *flags, '-c', source, '-o', file],
                       check=True)
        assert bool(FUSED.search(disassembled(file))) is found
    assert not FUSED.search('vfmadd231ps %zmm0,%zmm1,%zmm2  vfmsub213ss  vfnmadd132ps')


# --- threads --------------------------------------------------------------------------------------

MIXED = poses.of_all_kinds(900, 3)
"""6,300 pairs of which some are clipped."""
MIXED = Pairs(*(part[np.random.default_rng(5).permutation(len(part))] for part in MIXED))


@every_model
@pytest.mark.parametrize('count', [0, 1, 511, 512, 1023, 1024, 1025, 5000])
def test_threads_change_no_bit(model: str, count: int) -> None:
    pairs = MIXED.first(count)
    network = mlp_numbers(MLP_FILE) if model == 'mlp' else None
    answers = []
    for threads in (1, 2, 3, 7):
        solver = native.Exact() if network is None else native.Mlp(network)
        found, refused = solver.solve(*pairs, threads)
        assert refused == -1
        answers.append(found)
        assert_same_bits(found, solve(a_solver(model), pairs, threads), where=threads)
    for threads, found in zip((2, 3, 7), answers[1:]):
        assert_same_bits(answers[0], found, where=threads)
    if count == 5000 and model == 'exact':
        assert probes.is_clipped(pairs).sum() > 100


@every_model
@pytest.mark.parametrize('bad', [(0,), (4999,), (40, 3000), (600, 601), (2500, 4999), (1300, 3700)])
def test_threads_name_the_first_row_that_is_refused(model: str, bad: tuple[int, ...]) -> None:
    pairs = Pairs(*(part.copy() for part in MIXED.first(5000)))
    pairs.pose_b[list(bad), 3:] = 0.0
    said = []
    for threads in (1, 2, 3, 7):
        solver = a_solver(model)
        with pytest.raises(ValueError) as refusal:
            solve(solver, pairs, threads)
        said.append(str(refusal.value))
    assert len(set(said)) == 1
    assert said[0].startswith(f'poses_b[{bad[0]}] quaternion ')


@every_model
@pytest.mark.parametrize('threads', [0, -1, 1025, 2**70, True, 1.0, '2', None, [2], np.nan])
def test_threads_that_are_none_are_refused(model: str, threads: object) -> None:
    with pytest.raises(ValueError, match='^threads must be '):
        solve(a_solver(model), MIXED.first(3), threads)


def test_more_threads_than_rows() -> None:
    pairs = MIXED.first(200)
    solver = a_solver('exact')
    for threads in (201, 1024, np.uint8(255)):
        assert_same_bits(solve(solver, pairs, threads), solve(solver, pairs))


@every_model
def test_one_solver_in_many_threads(model: str) -> None:
    """Single calls and batches, of threads of their own, at once: the answers of one thread."""
    solver = a_solver(model)
    pairs = MIXED.first(2000)
    unit = np.ones((2000, 3))
    wanted, singles = solve(solver, pairs), solve(solver, Pairs(*pairs[:2], unit, unit))

    def work(number: int) -> None:
        for turn in range(4):
            if (number + turn) % 2:
                assert_same_bits(solve(solver, pairs, 1 + number % 3), wanted)
            else:
                ones = [solver(a, b) for a, b in zip(pairs.pose_a, pairs.pose_b)]
                assert_same_bits(Contacts.of(ones), singles)

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(work, range(8)))


# --- one call and many ----------------------------------------------------------------------------


@pytest.fixture(scope='module')
def single_solvers() -> dict[str, Callable[..., native.PairSolver]]:
    """Return what makes the solver of one pair; the network of `mlp` is that of its file."""
    return {'exact': partial(native.PairSolver, native.Exact()),
            'mlp': partial(native.PairSolver, read_mlp(MLP_FILE))}


@every_model
def test_a_batch_is_its_single_calls(model: str, single_solvers: dict) -> None:
    """Bit for bit, points too: 21,000 drawn pairs, and the hard poses."""
    pairs = poses.joined(poses.of_all_kinds(3000, 7), poses.hard_pairs())
    many = solve(a_solver(model), pairs)
    make = single_solvers[model]
    rows = [make(size_a=tuple(size_a), size_b=tuple(size_b))(a, b)
            for a, b, size_a, size_b in zip(*pairs)]
    assert_same_bits(many, Contacts.of(rows))
    assert isinstance(rows[0], Contact) and type(rows[0].colliding) is bool
    assert many.colliding.sum() > 10_000


@pytest.mark.parametrize('model', ['paper', 'soup-2'])
def test_models_that_give_the_point_alone(model: str) -> None:
    """Volume and covariance are NaN in contact. Without contact the volume is zero, as of all."""
    if model == 'soup-2':
        pytest.importorskip('fcl')
    solver = ContactSolver(poses.CUBE, poses.CUBE, model=make_model(model))
    apart = poses.IDENTITY + (0, 0, 3, 0, 0, 0, 0)
    many = solver.batch([poses.IDENTITY] * 2, [ABOVE, apart])
    for row, b in enumerate((ABOVE, apart)):
        one = solver(poses.IDENTITY, b)
        assert one.colliding is (row == 0)
        assert_same_bits(one, many[row])
        assert np.array_equal(one.volume, [np.nan, 0.0][row], equal_nan=True)
        assert one.covariance.shape == (3, 3) and np.isnan(one.covariance).all()


def test_kinds_and_shapes_of_a_patch() -> None:
    """A float and a (3, 3) array of a single call, (n,) and (n, 3, 3) of a batch."""
    solver = a_solver('exact')
    b = poses.IDENTITY + (0.5, 0.25, 0.9, 0, 0, 0, 0)
    one = solver(poses.IDENTITY, b)
    assert type(one.volume) is float and one.volume == pytest.approx(0.5 * 0.75 * 0.1)
    assert type(one.covariance) is np.ndarray and one.covariance.dtype == np.float64
    assert one.covariance == pytest.approx(np.diag([0.25, 0.5625, 0.01]) / 12, abs=1e-15)
    for slow in (solver(list(poses.IDENTITY), b), pickle.loads(pickle.dumps(one))):
        assert type(slow) is Contact and type(slow.volume) is float
        assert_same_bits(one, slow)
    many = solver.batch([poses.IDENTITY] * 4, [b] * 4)
    assert many.volume.shape == (4,) and many.covariance.shape == (4, 3, 3)
    assert len(solver.batch(np.empty((0, 7)), np.empty((0, 7))).covariance) == 0


def test_a_contact_never_changes() -> None:
    """Arrays are new ones each time, and what the constructor was given stays its caller's."""
    one = a_solver('exact')(poses.IDENTITY, (0.5, 0.25, 0.9, 0, 0, 0, 1))
    before = fields(one)
    for name in ('normal', 'point', 'covariance'):
        getattr(one, name)[:] = 7.0
    for name in (*FIELDS, 'another'):
        with pytest.raises(AttributeError):
            setattr(one, name, before[0])
        with pytest.raises(AttributeError):
            delattr(one, name)
    point = np.array(one.point)
    again = Contact(one.colliding, one.separation, one.normal, point, one.volume, one.covariance,
                    one.axis)
    point[:] = 7.0
    for same in (one, again, copy.deepcopy(one)):
        for mine, theirs in zip(before, fields(same), strict=True):
            assert np.array_equal(mine, theirs, equal_nan=True)
    assert repr(again) == repr(one)
    assert repr(one).startswith('Contact(colliding=True, separation=-0.09')
    assert repr(one).endswith(', axis=2)')


def test_a_contact_of_numbers() -> None:
    """Kinds and shapes are checked; without an axis it is the unknown one."""
    numbers = (True, -1, [0, 0, 1], (1, 2, 3), 2, np.eye(3, dtype=np.float32))
    one = Contact(*numbers)
    assert one.axis == -1 and type(one.separation) is float and one.point.tolist() == [1, 2, 3]
    for place, wrong in ((1, 'deep'), (2, [0, 0]), (3, np.eye(3)), (5, [1, 2, 3]), (4, None)):
        with pytest.raises((TypeError, ValueError)):
            Contact(*numbers[:place], wrong, *numbers[place + 1:])
    for arguments in (numbers[:-1], (*numbers, 1, 2), (*numbers, 0.5)):
        with pytest.raises(TypeError):
            Contact(*arguments)


# --- the object -----------------------------------------------------------------------------------

ABOVE = np.array([0.1, 0.05, 1.9, 0.02, 0.01, 0.0, 1.0])


def test_a_solver_is_made_once() -> None:
    """A second __init__ is refused, and leaves all of the first."""
    solver = ContactSolver((2, 2, 2), poses.CUBE, model='exact')
    wanted = solver(poses.IDENTITY, ABOVE)
    for model in ('exact', 'mlp'):
        with pytest.raises(RuntimeError, match='a solver is made once'):
            solver.__init__((1, 2, 3), poses.CUBE, model=model)
    assert_same_bits(solver(poses.IDENTITY, ABOVE), wanted)


def test_a_solver_that_was_not_made_answers_nothing() -> None:
    """Python lets a subclass forget __init__: an exception, not a crash."""
    raw = native.PairSolver.__new__(native.PairSolver)
    with pytest.raises(AttributeError, match='_call_general'):
        raw(poses.IDENTITY, ABOVE)


class Counting(ContactSolver):
    """Counts the poses that are no plain arrays."""

    calls = 0

    def _call_general(self, pose_a: object, pose_b: object) -> Contact:
        self.calls += 1
        return super()._call_general(pose_a, pose_b)


@every_model
def test_a_subclass_of_a_solver(model: str) -> None:
    solver = Counting(poses.CUBE, poses.CUBE, model=model)
    wanted = ContactSolver(poses.CUBE, poses.CUBE, model=model)(poses.IDENTITY, ABOVE)
    assert_same_bits(solver(poses.IDENTITY, ABOVE), wanted)
    assert solver.calls == 0  # C++ answered
    assert_same_bits(solver(list(poses.IDENTITY), pose_b=ABOVE), wanted)
    assert solver.calls == 1
    with pytest.raises(ValueError, match='^pose_b quaternion'):
        solver(poses.IDENTITY, np.zeros(7))
    assert solver.calls == 2
    for words in ((), (ABOVE,), (ABOVE, ABOVE, ABOVE)):
        with pytest.raises(TypeError):
            solver(*words)


def memory() -> int:
    """Return the resident memory of this process [bytes]."""
    return int(Path('/proc/self/statm').read_text().split()[1]) * os.sysconf('SC_PAGE_SIZE')


def everything_once(solver: ContactSolver, pairs: Pairs) -> None:
    """Use each way into the core, refusals too."""
    solver(poses.IDENTITY, ABOVE)
    solver(poses.IDENTITY, ABOVE + (0, 0, 99, 0, 0, 0, 0))
    solver(list(poses.IDENTITY), ABOVE)
    solver.distance(poses.IDENTITY, ABOVE + (0, 0, 99, 0, 0, 0, 0))
    solver.distance(pose_a=list(poses.IDENTITY), pose_b=ABOVE)
    solver.distance_batch(pairs.pose_a, pairs.pose_b, size_a=pairs.size_a, size_b=pairs.size_b)
    solve(solver, pairs, 2)
    for bad in (np.zeros(7), np.zeros(6), None):
        for call in (solver, solver.distance):
            with pytest.raises(ValueError):
                call(poses.IDENTITY, bad)
    with pytest.raises(ValueError):
        solve(solver, pairs._replace(pose_b=0.0 * pairs.pose_b), 2)
    native.PairSolver(None)


@pytest.fixture
def traced() -> Iterator[None]:
    tracemalloc.start()
    yield
    tracemalloc.stop()


def allocated() -> int:
    """Return the traced memory that is held [bytes], less what the interpreter caches.

    Its cache of methods keeps up to 4096 names, such as those that reprlib makes for each call.
    """
    gc.collect()
    getattr(sys, '_clear_internal_caches', sys._clear_type_cache)()
    return tracemalloc.get_traced_memory()[0]


@every_model
def test_references_and_memory_stay(model: str, traced: None) -> None:
    """Hundreds of rounds leave neither a reference nor memory behind."""
    solver = ContactSolver(poses.CUBE, poses.CUBE, model=model)
    pairs = MIXED.first(40)
    rounds = 300
    watched = [solver, ContactSolver, native.PairSolver, Contact, poses.IDENTITY, ABOVE, *pairs,
               solver.model, Exception, np.ndarray]
    for _ in range(50):
        everything_once(solver, pairs)
    before = allocated()
    references = [sys.getrefcount(each) for each in watched]
    for _ in range(rounds):
        everything_once(solver, pairs)
    after = allocated()
    assert [sys.getrefcount(each) for each in watched] == references
    # An array or a tuple that were kept each round would be more.
    assert after - before < 50 * rounds


def test_networks_are_freed() -> None:
    """Each model has its own numbers, outside of what Python counts; a solver keeps its model."""
    numbers = core_numbers(Network([(np.zeros(shape), np.zeros(shape[0]))
                                    for shape in mlp_shapes((64, 64))]))  # 25 kB

    def make() -> native.PairSolver:
        return native.PairSolver(native.Mlp(numbers))

    solver = make()
    before = memory()
    for _ in range(4000):
        make()
        with pytest.raises(RuntimeError):
            solver.__init__(native.Mlp(numbers))
    assert memory() - before < 400 * numbers.nbytes


# --- planes ---------------------------------------------------------------------------------------


def share_certain(pairs: Pairs) -> float:
    found = solve(a_solver('exact'), pairs)
    assert found.colliding.mean() > 0.4
    return 1.0 - probes.is_clipped(pairs).sum() / found.colliding.sum()


def flush_stacks(kind: str, n: int = 4000) -> Pairs:
    """Draw boxes whose faces lie in common planes, in any orientation and place."""
    rng = np.random.default_rng(52)
    size_a = np.exp(rng.uniform(-1, 1, (n, 3)))
    size_b, shift = size_a.copy(), np.zeros((n, 3))
    turn = np.tile(poses.IDENTITY[3:], (n, 1))
    if kind in ('aligned', 'half overhanging', 'quarter turns'):
        shift[:, 2] = size_a[:, 2] * (1.0 - 10.0**rng.uniform(-6, -1, n))
    if kind == 'half overhanging':
        shift[:, 0] = 0.5 * size_a[:, 0] * rng.choice([-1, 1], n)
    if kind == 'quarter turns':
        size_a[:, 1] = size_a[:, 0]
        size_b = size_a.copy()
        turn = poses.small_rotations(np.tile([0.0, 0, 1], (n, 1)),
                                     0.5 * np.pi * rng.integers(0, 4, n))
    if kind == 'nested':
        size_b = size_a * rng.uniform(0.1, 0.9, (n, 1))
        shift = 0.5 * rng.integers(-1, 2, (n, 3)) * (size_a - size_b)
    whole, place = poses.unit_quaternions(rng, n), rng.uniform(-5, 5, (n, 3))
    return Pairs(poses.moved(np.tile(poses.IDENTITY, (n, 1)), place, whole),
                 poses.moved(np.hstack([shift, turn]), place, whole), size_a, size_b)


@pytest.mark.parametrize('kind', ['aligned', 'half overhanging', 'quarter turns', 'identical',
                                  'nested'])
def test_flush_boxes_are_certain(kind: str) -> None:
    """Faces in one plane are told apart once, so none of these has to be clipped."""
    assert share_certain(flush_stacks(kind)) == 1.0
