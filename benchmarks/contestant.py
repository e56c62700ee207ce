# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A contestant: a model of this package or another engine, asked and timed alike by all reports.

A call goes from two poses, in the contestant's own form, to a result that Python can read. Shapes
and models are made beforehand and are not timed. Setting both poses is timed.
"""
from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from box_contact_ros.arguments import model_name
from box_contact_ros.core import FORCE, native
from box_contact_ros.models.make_model import make_model
from box_contact_ros.models.networks import GROUP, INPUTS_TOGETHER, core_numbers, mlp_numbers
from box_contact_ros.models.weights_file import Network
from box_contact_ros.resources import resource_path
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.pose import rotation_matrix

from .mlp_samples import draw_samples, mixture
from .pose_sets import Pairs
from .weights import mlp_shapes

MODELS = ('exact', 'mlp', 'paper', 'soup-1', 'soup-8', 'soup-22')
"""Our contestants; the soups are the coarsest, and the ends of the paper's Table 3."""
CORE_MODELS = ('exact', 'mlp')
"""Models in C++ with volume and covariance: each instruction set of the machine is measured."""
WEIGHTS = resource_path('weights', 'mlp.safetensors').parent
OTHER_WEIGHTS = Path(__file__).with_name('weights')
MLP_SIZES = {path.stem: path for path in sorted(OTHER_WEIGHTS.glob('mlp-*.safetensors'))}
"""Weights files of other sizes of the network of `mlp`, by name: `python -m training --hidden`."""
AT_REST = Path(__file__).with_name('paper') / 'weights' / 'paper-at-rest.safetensors'
"""Weights of `paper` for cubes that lie on each other: `python -m training paper --scene`."""
ENDING = 5.0  # time that a subprocess has to end after its answer [s]
LINEAR_PAIRS = 200_000  # that the linear map of `mlp` is fitted to
MOST_CONTACTS = 16  # contacts asked for; two boxes have at most eight


class Manifold(NamedTuple):
    """What a contestant answers for a pair: n points, none where the boxes are apart."""

    points: np.ndarray  # (n, 3)
    normals: np.ndarray  # (n, 3), unit, from A to B; NaN: none was given
    depths: np.ndarray  # (n,) [m]


APART = Manifold(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))


def manifold(contacts: Iterable[tuple[ArrayLike, ArrayLike, float]]) -> Manifold:
    """Return the answer of contacts, each a point (3,), a normal (3,) and a depth [m]."""
    columns = list(zip(*contacts))
    return Manifold(*map(np.array, columns)) if columns else APART


class Answer(NamedTuple):
    """One contact of a pair: normal (3,) from A to B and point (3,), NaN if apart."""

    touching: bool
    normal: np.ndarray
    point: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Contestant:
    """One way to answer: a model of this package or another engine."""

    name: str  # as reports show it
    call: str = 'ContactSolver(…)(pose_a, pose_b)'  # what a user writes
    returns: str = 'one contact'
    patch: str = '–'  # what it says of the patch beyond points: its volume or area
    package: str = ''  # distribution whose version reports name
    choices: tuple[str, ...] = ('deepest', 'mean', 'mean by depth', 'patch centroid')
    """Ways, of `CHOICES`, in which users make one point of the answer."""
    boxes: Callable[[np.ndarray, np.ndarray], Callable[..., Any]]
    """Return what answers for boxes of two sizes (3,). ValueError: not for these sizes."""
    at: Callable[[np.ndarray, np.ndarray], tuple[Any, ...]]
    """Return two poses (7,) in the engine's own form, the arguments of what answers."""
    read: Callable[[Any], Manifold]
    """Return the answer in what a call returned; to be read before the next call."""
    solve: Callable[[Pairs], Contacts] | None = None
    """Answer for all pairs, with volume and covariance; models of this package have it."""
    prepare_batch: Callable[..., Callable[[], Any]] | None = None
    """Return a call that answers for all pairs at once, not in a loop; takes pairs, `threads`."""
    any_boxes: bool = True  # whether it answers for boxes of any sizes
    causes: Mapping[str, str] = field(default_factory=dict)
    """Why it is 'missed', 'invented' or 'normal' in a report, where that is known."""

    def prepare(self, pairs: Pairs) -> list[Callable[[], Any]]:
        """Return a call for each pair, to be timed. ValueError: not for boxes of these sizes."""
        made = cache(lambda p, q: self.boxes(np.array(p), np.array(q)))
        return [partial(made(tuple(p), tuple(q)), *self.at(a, b))
                for a, b, p, q in zip(*map(np.ascontiguousarray, pairs))]


def packages_of(contestants: Sequence[Contestant]) -> list[str]:
    """Return the distributions whose versions a report of these contestants names."""
    return list(dict.fromkeys(['numpy', *(one.package for one in contestants if one.package)]))


def model_or_class(text: str) -> Any:
    """Return the name of a model, or an object of `package.module:Class` that answers as one."""
    module, colon, name = text.partition(':')
    if not colon:
        return model_name(text)
    sys.path.insert(0, '')  # modules of the current folder, however the program was started
    try:
        return getattr(import_module(module), name)()
    except (ImportError, AttributeError) as error:
        raise argparse.ArgumentTypeError(f'{text}: {error}') from error


def add_models(parser: argparse.ArgumentParser) -> None:
    """Add the argument that names more models than the report's."""
    parser.add_argument('--model', nargs='+', type=model_or_class, default=[], metavar='MODEL',
                        help='more models: names, or package.module:Class; results then go to '
                        'quick-results')


def ours(model: Any, *, weights: str | None = None, name: str = '') -> Contestant:
    """Return a model of this package, or an object with `solve` under a name of its own."""
    name = name or (model if isinstance(model, str) else type(model).__name__)
    made = make_model(model, weights=weights) if isinstance(model, str) else model
    solver = partial(ContactSolver, model=made)

    def solve(pairs: Pairs) -> Contacts:
        return pairs.contacts(solver(pairs.size_a[0], pairs.size_b[0]))

    def prepare_batch(pairs: Pairs, threads: int = 1) -> Callable[[], Any]:
        a, b, size_a, size_b = pairs
        return partial(solver(size_a[0], size_b[0]).batch, a, b, size_a=size_a, size_b=size_b,
                       threads=threads)

    def read(contact: Any) -> Manifold:
        if not contact.colliding:
            return APART
        return manifold([(contact.point, contact.normal, -contact.separation)])

    return Contestant(
        name=name, patch='volume, covariance', choices=('its point',), boxes=solver,
        at=lambda a, b: (a, b), read=read, solve=solve,
        any_boxes=model != 'paper' and not hasattr(model, 'size_fault'),
        prepare_batch=None if name.startswith('soup') else prepare_batch)  # it loops over pairs


def idle_mlp() -> native.Mlp:
    """Return `mlp` with the last layer of its network zeroed: what its geometry alone knows."""
    numbers = mlp_numbers(resource_path('weights', 'mlp.safetensors'))
    inputs = sum(-(-int(numbers[k]) // INPUTS_TOGETHER) * INPUTS_TOGETHER for k in (0, 2))
    groups = -(-int(numbers[3]) // GROUP)
    numbers[-groups * GROUP * (1 + inputs):] = 0.0
    return native.Mlp(numbers)


@cache
def linear_mlp() -> native.Mlp:
    """Return `mlp` whose network is the best linear map of its features, by least squares.

    The linear path is that map; the hidden layers are one unit each, which is 0.
    """
    samples = draw_samples(mixture, [1, 0], LINEAR_PAIRS)
    root = np.linalg.cholesky(samples.covariance)
    wanted = np.column_stack([
        samples.mean, np.sqrt(samples.volume), *(root[:, k, k] for k in range(3)),
        root[:, 1, 0], root[:, 2, 0], root[:, 2, 1]])
    known = np.column_stack([samples.features, np.ones(len(samples))])
    # Errors of the point count by the box's extents, as in the training.
    weight = samples.half.max(axis=1, keepdims=True)
    fitted = np.linalg.lstsq(weight * known, weight * wanted, rcond=None)[0].T
    slopes, bias = fitted[:, :-1], fitted[:, -1]
    *hidden, last = [(np.zeros(shape), np.zeros(shape[0])) for shape in mlp_shapes((1, 1))]
    last[0][:, :-1], last[1][:] = slopes, bias
    return native.Mlp(core_numbers(Network([*hidden, last])))


def other_networks() -> list[Contestant]:
    """Return `mlp` by other sizes, linear and idle, and `paper` by weights for other scenes."""
    return [*(ours('mlp', weights=str(path), name=name) for name, path in MLP_SIZES.items()),
            ours(linear_mlp(), name='mlp, linear'),
            ours(idle_mlp(), name='mlp, idle'),
            ours('paper', weights=str(AT_REST), name='paper-at-rest')]


def _deepest(points: np.ndarray, normals: np.ndarray, depths: np.ndarray) -> np.ndarray:
    return points[int(np.argmax(depths))]


def _mean(points: np.ndarray, normals: np.ndarray, depths: np.ndarray) -> np.ndarray:
    return points.mean(axis=0)


def _mean_by_depth(points: np.ndarray, normals: np.ndarray, depths: np.ndarray) -> np.ndarray:
    """Return the mean with the depths as weights: where springs at the points push, all alike."""
    weights = np.maximum(depths, 0.0)
    return weights @ points / weights.sum() if weights.sum() > 0.0 else points.mean(axis=0)


def _patch_centroid(points: np.ndarray, normals: np.ndarray, depths: np.ndarray) -> np.ndarray:
    """Return the centroid of the polygon of the points, seen along the deepest one's normal."""
    middle = points.mean(axis=0)
    normal = normals[int(np.argmax(depths))]
    if len(points) < 3 or not np.isfinite(normal).all():
        return middle
    across = np.linalg.svd(normal[None])[2][1:]
    flat = (points - middle) @ across.T
    order = np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))
    following = np.roll(order, -1)
    areas = flat[order, 0] * flat[following, 1] - flat[order, 1] * flat[following, 0]
    if not areas.sum() > 0.0:
        return middle
    corners = points[order] + points[following] - 2.0 * middle
    return middle + areas @ corners / (3.0 * areas.sum())


def _last(points: np.ndarray, normals: np.ndarray, depths: np.ndarray) -> np.ndarray:
    return points[-1]


CHOICES: dict[str, Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]] = {
    'its point': _deepest, 'deepest': _deepest, 'mean': _mean, 'mean by depth': _mean_by_depth,
    'patch centroid': _patch_centroid, 'centre of pressure': _last}
"""One point of n > 0 points (n, 3), with their normals (n, 3) and depths (n,)."""


def chosen(answer: Manifold, choice: str) -> Answer:
    """Return one contact of an answer: the deepest one's normal, the point by a choice."""
    if not len(answer.points):
        return Answer(False, np.full(3, np.nan), np.full(3, np.nan))
    return Answer(True, answer.normals[int(np.argmax(answer.depths))], CHOICES[choice](*answer))


def in_subprocess(work: Callable[..., Any], *arguments: Any, patience: float,
                  instruction_set: str = '') -> Any:
    """Return what `work` returns in a subprocess. RuntimeError: what ended the subprocess.

    patience: the longest wait [s]. instruction_set: that of the core there, instead of the best.
    """
    context, before = multiprocessing.get_context('spawn'), dict(os.environ)
    receiving, sending = context.Pipe(duplex=False)
    process = context.Process(target=_answer_to, args=(sending, work, *arguments))
    try:
        os.environ |= {FORCE: instruction_set} if instruction_set else {}
        process.start()
        sending.close()
        if receiving.poll(patience):
            answer = receiving.recv()
            process.join(ENDING)
            return answer
        raise RuntimeError(f'no answer in {patience:g} s')
    except EOFError:
        process.join()
        status = process.exitcode or 0
        raise RuntimeError(f'ended by signal {-status}' if status < 0 else
                           f'ended with status {status}') from None
    finally:
        os.environ.clear()
        os.environ |= before
        process.kill()
        process.join()


def _answer_to(pipe: Any, work: Callable[..., Any], *arguments: Any) -> None:
    pipe.send(work(*arguments))


def wxyz(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return places (3,) of both poses, then their quaternions (4,) wxyz."""
    return a[:3], b[:3], np.roll(a[3:], 1), np.roll(b[3:], 1)


def matrices(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return places (3,) of both poses, then how they are turned, (3, 3) each."""
    return a[:3], b[:3], rotation_matrix(a[3:]), rotation_matrix(b[3:])
