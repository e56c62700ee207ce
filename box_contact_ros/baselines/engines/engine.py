"""What answers for a pair of boxes: this package's models and the engines that users would take.

All are an `Engine`, so reports ask and time them alike. A call goes from two poses, in the engine's
own form, to a result that Python can read. Making shapes and models is preparation and is not
timed. Setting both poses is timed.

An engine that returns several points is entered with the two ways in which users make one of them:
the deepest, and the mean. All normals point from A to B.
"""
from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from ...scene.pose import rotation_matrix
from ...scene.pose_sets import Pairs
from ...solver.contact import Contacts
from ...solver.contact_solver import ContactSolver
from ...solver.models import find_model

MOST_CONTACTS = 16  # contacts asked for; two boxes have at most eight


class EngineAnswer(NamedTuple):
    """What an engine answers for a pair: normal (3,) from A to B and point (3,), None if apart."""

    touching: bool
    normal: np.ndarray | None
    point: np.ndarray | None


APART = EngineAnswer(False, None, None)


@dataclass(frozen=True, kw_only=True)
class Engine:
    """One way to answer."""

    name: str  # as reports show it
    prepare: Callable[[Pairs], list[Callable[[], Any]]]
    """Return a call for each pair, to be timed. ValueError: not for boxes of these sizes."""
    read: Callable[[Any], EngineAnswer]
    """Return the answer in what a call returned; to be read before the next call."""
    prepare_batch: Callable[..., Callable[[], Contacts]] | None = None
    """Return a call that answers for all pairs at once, not in a loop; takes pairs, `threads`."""
    any_boxes: bool = True  # whether it answers for boxes of any sizes


def ours(model: str, name: str | None = None, weights: str | None = None) -> Engine:
    """Return a model of this package, which reports show as `name`."""
    entry, _ = find_model('model', model)

    def solver(p: np.ndarray, q: np.ndarray) -> ContactSolver:
        return ContactSolver(p, q, model=model, weights=weights)

    def prepare(pairs: Pairs) -> list[Callable[[], Any]]:
        solvers = _per_sizes(solver)
        return [partial(solvers(p, q), a, b) for a, b, p, q in _rows(pairs)]

    def prepare_batch(pairs: Pairs, threads: int = 1) -> Callable[[], Contacts]:
        a, b, size_a, size_b = pairs
        return partial(solver(size_a[0], size_b[0]).batch, a, b, size_a=size_a, size_b=size_b,
                       threads=threads)

    def read(contact: Any) -> EngineAnswer:
        return EngineAnswer(True, contact.normal, contact.point) if contact.colliding else APART

    return Engine(name=name or model, prepare=prepare, read=read, any_boxes=entry.any_boxes,
                  prepare_batch=prepare_batch if entry.native_batch else None)


def mujoco_distance() -> Engine:
    """Return MuJoCo's `mj_geomDistance`: signed distance and two nearest points; their middle."""
    import mujoco

    ends = np.zeros(6)
    distance, matrix = mujoco.mj_geomDistance, mujoco.mju_quat2Mat

    def ask(model: Any, data: Any, place_a: Any, place_b: Any, turn_a: Any, turn_b: Any,
            a: np.ndarray, b: np.ndarray, quat_a: np.ndarray, quat_b: np.ndarray) -> float:
        place_a[:] = a
        place_b[:] = b
        matrix(turn_a, quat_a)
        matrix(turn_b, quat_b)
        return distance(model, data, 0, 1, 1.0, ends)

    def prepare(pairs: Pairs) -> list[Callable[[], Any]]:
        models = _per_sizes(_mujoco_model)
        return [partial(ask, model, data, *data.geom_xpos, *data.geom_xmat, *_wxyz(a, b))
                for a, b, p, q in _rows(pairs) for model, data in [models(p, q)]]

    def read(result: float) -> EngineAnswer:
        if result > 0.0:
            return APART
        start, end = ends[:3], ends[3:]
        step = start - end
        length = np.linalg.norm(step)
        return EngineAnswer(True, step / length if length else None, 0.5 * (start + end))

    return Engine(name='MuJoCo mj_geomDistance', prepare=prepare, read=read)


def mujoco_collision(choice: str) -> Engine:
    """Return MuJoCo's `mj_collision`, after `mj_kinematics`: up to eight contacts."""
    import mujoco

    kinematics, collide = mujoco.mj_kinematics, mujoco.mj_collision

    def ask(model: Any, data: Any, places: np.ndarray, poses: np.ndarray) -> Any:
        places[:] = poses
        kinematics(model, data)
        collide(model, data)
        return data

    def prepare(pairs: Pairs) -> list[Callable[[], Any]]:
        models = _per_sizes(_mujoco_model)
        calls: list[Callable[[], Any]] = []
        for a, b, p, q in _rows(pairs):
            model, data = models(p, q)
            place_a, place_b, quat_a, quat_b = _wxyz(a, b)
            calls.append(partial(ask, model, data, data.qpos, np.concatenate(
                [place_a, quat_a, place_b, quat_b])))
        return calls

    def read(data: Any) -> EngineAnswer:
        contacts = data.contact
        # A frame's first row is the normal, from the geom of lower number to the other.
        return CHOICES[choice](np.array(contacts.pos), np.array(contacts.frame)[:, :3],
                               -np.array(contacts.dist))

    return Engine(name=f'MuJoCo mj_collision, {choice}', prepare=prepare, read=read)


def _mujoco_model(p: np.ndarray, q: np.ndarray) -> tuple[Any, Any]:
    import mujoco

    bodies = ''.join(
        f'<body><freejoint/><geom type="box" size="{" ".join(map(repr, (0.5 * size).tolist()))}"/>'
        '</body>' for size in (p, q))
    model = mujoco.MjModel.from_xml_string(f'<mujoco><worldbody>{bodies}</worldbody></mujoco>')
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def fcl_collision(choice: str) -> Engine:
    """Return python-fcl's `collide` of two boxes."""
    import fcl

    request = fcl.CollisionRequest(num_max_contacts=MOST_CONTACTS, enable_contact=True)

    def ask(one: Any, two: Any, a: np.ndarray, b: np.ndarray, quat_a: np.ndarray,
            quat_b: np.ndarray) -> Any:
        one.setTransform(fcl.Transform(quat_a, a))
        two.setTransform(fcl.Transform(quat_b, b))
        result = fcl.CollisionResult()
        fcl.collide(one, two, request, result)
        return result

    def prepare(pairs: Pairs) -> list[Callable[[], Any]]:
        boxes = _per_sizes(lambda p, q: (fcl.CollisionObject(fcl.Box(*p)),
                                         fcl.CollisionObject(fcl.Box(*q))))
        return [partial(ask, *boxes(p, q), *_wxyz(a, b)) for a, b, p, q in _rows(pairs)]

    def read(result: Any) -> EngineAnswer:
        contacts = result.contacts
        return CHOICES[choice](np.array([c.pos for c in contacts]),
                               np.array([c.normal for c in contacts]),
                               np.array([c.penetration_depth for c in contacts]))

    return Engine(name=f'python-fcl collide, {choice}', prepare=prepare, read=read)


def coal_collision() -> Engine:
    """Return Coal's `collide`: the deepest point."""
    import coal

    request, result = coal.CollisionRequest(), coal.CollisionResult()
    request.enable_contact = True
    request.num_max_contacts = MOST_CONTACTS

    def ask(one: Any, two: Any, at_one: Any, at_two: Any, a: np.ndarray, b: np.ndarray,
            matrix_a: np.ndarray, matrix_b: np.ndarray) -> Any:
        at_one.setTranslation(a)
        at_one.setRotation(matrix_a)
        at_two.setTranslation(b)
        at_two.setRotation(matrix_b)
        result.clear()
        coal.collide(one, at_one, two, at_two, request, result)
        return result

    def prepare(pairs: Pairs) -> list[Callable[[], Any]]:
        boxes = _per_sizes(lambda p, q: (coal.Box(*p), coal.Box(*q), coal.Transform3s(),
                                         coal.Transform3s()))
        return [partial(partial(ask, *boxes(p, q)), a[:3], b[:3], rotation_matrix(a[3:]),
                        rotation_matrix(b[3:])) for a, b, p, q in _rows(pairs)]

    def read(_: Any) -> EngineAnswer:
        if not result.numContacts():
            return APART
        contact = result.getContact(0)
        return EngineAnswer(True, np.array(contact.normal), np.array(contact.pos))

    return Engine(name='Coal collide', prepare=prepare, read=read)


def bullet_points(choice: str) -> Engine:
    """Return PyBullet's `getClosestPoints` at distance 0."""
    import pybullet as bullet

    client = bullet.connect(bullet.DIRECT)
    place = partial(bullet.resetBasePositionAndOrientation, physicsClientId=client)

    def bodies(p: np.ndarray, q: np.ndarray) -> list[int]:
        shapes = [bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=list(0.5 * size),
                                              physicsClientId=client) for size in (p, q)]
        return [bullet.createMultiBody(1.0, shape, physicsClientId=client) for shape in shapes]

    def ask(one: int, two: int, a: Any, b: Any, quat_a: Any, quat_b: Any) -> Any:
        place(one, a, quat_a)
        place(two, b, quat_b)
        return bullet.getClosestPoints(one, two, 0.0, physicsClientId=client)

    def prepare(pairs: Pairs) -> list[Callable[[], Any]]:
        # Bodies stay in the world and slow its broad phase down: only those of these pairs.
        bullet.resetSimulation(physicsClientId=client)
        made = _per_sizes(bodies)
        return [partial(ask, *made(p, q), *(tuple(part) for part in (a[:3], b[:3], a[3:], b[3:])))
                for a, b, p, q in _rows(pairs)]

    def read(contacts: Any) -> EngineAnswer:
        # 5, 6: the points on A and B; 7: the normal on B, towards A; 8: the distance.
        return CHOICES[choice](np.array([0.5 * (np.array(c[5]) + np.array(c[6]))
                                         for c in contacts]),
                               np.array([-np.array(c[7]) for c in contacts]),
                               np.array([-c[8] for c in contacts]))

    return Engine(name=f'PyBullet getClosestPoints, {choice}', prepare=prepare, read=read)


def _deepest(points: np.ndarray, normals: np.ndarray, depths: np.ndarray) -> EngineAnswer:
    if not len(points):
        return APART
    first = int(np.argmax(depths))
    return EngineAnswer(True, normals[first], points[first])


def _mean(points: np.ndarray, normals: np.ndarray, depths: np.ndarray) -> EngineAnswer:
    deepest = _deepest(points, normals, depths)
    return deepest._replace(point=points.mean(axis=0)) if deepest.touching else APART


CHOICES = {'deepest': _deepest, 'mean': _mean}
"""One point of several (n, 3), with their normals (n, 3) and depths (n,)."""

RIVALS: dict[str, tuple[str, list[Callable[[], Engine]]]] = {
    'mujoco': ('sim', [mujoco_distance, *(partial(mujoco_collision, one) for one in CHOICES)]),
    'fcl': ('soup', [partial(fcl_collision, one) for one in CHOICES]),
    'coal': ('peers', [coal_collision]),
    'pybullet': ('peers', [partial(bullet_points, one) for one in CHOICES]),
}
"""By module: the extra of this package that brings it, and its engines."""


def installed() -> tuple[list[Engine], list[str]]:
    """Return the rivals that can be imported, and a line about each that cannot."""
    found, missing = [], []
    for module, (extra, makers) in RIVALS.items():
        try:
            found += [make() for make in makers]
        except ImportError:
            missing.append(f"{module} is not installed (extra '{extra}')")
    return found, missing


def in_subprocess(work: Callable[..., Any], *arguments: Any, patience: float) -> Any:
    """Return what `work` returns in a subprocess. RuntimeError: what ended the subprocess."""
    context = multiprocessing.get_context('spawn')
    receiving, sending = context.Pipe(duplex=False)
    process = context.Process(target=_answer_to, args=(sending, work, *arguments))
    process.start()
    sending.close()
    try:
        if receiving.poll(patience):
            return receiving.recv()
        raise RuntimeError(f'no answer in {patience:g} s')
    except EOFError:
        process.join()
        status = process.exitcode or 0
        raise RuntimeError(f'ended by signal {-status}' if status < 0 else
                           f'ended with status {status}') from None
    finally:
        process.kill()
        process.join()


def _answer_to(pipe: Any, work: Callable[..., Any], *arguments: Any) -> None:
    pipe.send(work(*arguments))


def _rows(pairs: Pairs) -> Iterator[tuple[np.ndarray, ...]]:
    """Yield contiguous rows: pose_a, pose_b, size_a, size_b."""
    return zip(*(np.ascontiguousarray(part) for part in pairs))


def _wxyz(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return places (3,) of both poses, then their quaternions (4,) wxyz."""
    return a[:3], b[:3], np.roll(a[3:], 1), np.roll(b[3:], 1)


def _per_sizes(make: Callable[[np.ndarray, np.ndarray], Any]) -> Callable[..., Any]:
    """Return `make`, called once for each pair of sizes."""
    cached = cache(lambda p, q: make(np.array(p), np.array(q)))
    return lambda p, q: cached(tuple(p), tuple(q))
