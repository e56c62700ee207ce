"""What answers for a pair of boxes: this package's models and the engines that users would take.

All behind one interface, `Contestant`, so that `frontier` measures all alike: from two poses, in
the form that the engine takes them, to a result that Python can read. Making shapes and models is
preparation and not measured; setting both poses is.

An engine that answers with several points is entered with the two ways in which users make one of
them: the deepest, and the mean. Normals are turned to point from A to B, the convention here.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..scene.pose import rotation_matrix
from ..scene.pose_sets import Pairs
from ..solver.contact_solver import ContactSolver

MOST_CONTACTS = 16
"""Contacts asked for; two boxes have at most eight."""


class EngineAnswer(NamedTuple):
    """What a contestant answers: normal (3,) from A to B and point (3,), None if apart."""

    touching: bool
    normal: np.ndarray | None
    point: np.ndarray | None


class Contestant(Protocol):
    """One way to answer."""

    name: str
    """As the report shows it."""

    def prepare(self, pairs: Pairs) -> list[tuple[Any, ...]]:
        """Arguments of `ask` for every pair. ValueError: not for boxes of these sizes."""

    def ask(self, *arguments: Any) -> Any:
        """What is timed."""

    def read(self, result: Any) -> EngineAnswer:
        """The answer, read before `ask` is called again."""


class Ours:
    """A model of this package."""

    def __init__(self, model: str, name: str | None = None, weights: str | None = None) -> None:
        self.name = name or model
        self.model = model
        self.weights = weights

    def solver(self, size_a: np.ndarray, size_b: np.ndarray) -> ContactSolver:
        """The solver for full extents (3,)."""
        return ContactSolver(size_a, size_b, model=self.model, weights=self.weights)

    def prepare(self, pairs: Pairs) -> list[tuple[Any, ...]]:
        solver = _per_sizes(self.solver)
        return [(solver(p, q), a, b) for a, b, p, q in _rows(pairs)]

    def ask(self, solver: ContactSolver, a: np.ndarray, b: np.ndarray) -> Any:
        return solver(a, b)

    def read(self, result: Any) -> EngineAnswer:
        if not result.colliding:
            return EngineAnswer(False, None, None)
        return EngineAnswer(True, result.normal, result.point)


class MujocoDistance:
    """MuJoCo's `mj_geomDistance`: signed distance and the two nearest points; their middle."""

    name = 'MuJoCo mj_geomDistance'

    def __init__(self) -> None:
        import mujoco

        self._distance, self._matrix = mujoco.mj_geomDistance, mujoco.mju_quat2Mat
        self._ends = np.zeros(6)

    def prepare(self, pairs: Pairs) -> list[tuple[Any, ...]]:
        models = _per_sizes(_mujoco_model)
        found = []
        for a, b, p, q in _rows(pairs):
            model, data = models(p, q)
            found.append((model, data, *data.geom_xpos, *data.geom_xmat,
                          a[:3], b[:3], np.roll(a[3:], 1), np.roll(b[3:], 1)))
        return found

    def ask(self, model: Any, data: Any, place_a: Any, place_b: Any, turn_a: Any, turn_b: Any,
            a: np.ndarray, b: np.ndarray, quat_a: np.ndarray, quat_b: np.ndarray) -> Any:
        place_a[:] = a
        place_b[:] = b
        self._matrix(turn_a, quat_a)
        self._matrix(turn_b, quat_b)
        return self._distance(model, data, 0, 1, 1.0, self._ends)

    def read(self, result: Any) -> EngineAnswer:
        if result > 0.0:
            return EngineAnswer(False, None, None)
        start, end = self._ends[:3], self._ends[3:]
        step = start - end
        length = np.linalg.norm(step)
        return EngineAnswer(True, step / length if length else None, 0.5 * (start + end))


class MujocoCollision:
    """MuJoCo's `mj_collision`, after `mj_kinematics`: up to eight contacts."""

    def __init__(self, choose: str) -> None:
        import mujoco

        self.name = f'MuJoCo mj_collision, {choose}'
        self._choose = CHOICES[choose]
        self._kinematics, self._collide = mujoco.mj_kinematics, mujoco.mj_collision

    def prepare(self, pairs: Pairs) -> list[tuple[Any, ...]]:
        models = _per_sizes(_mujoco_model)
        found = []
        for a, b, p, q in _rows(pairs):
            model, data = models(p, q)
            found.append((model, data, data.qpos, np.concatenate(
                [a[:3], np.roll(a[3:], 1), b[:3], np.roll(b[3:], 1)])))
        return found

    def ask(self, model: Any, data: Any, places: np.ndarray, poses: np.ndarray) -> Any:
        places[:] = poses
        self._kinematics(model, data)
        self._collide(model, data)
        return data

    def read(self, result: Any) -> EngineAnswer:
        contacts = result.contact
        return self._choose(np.array(contacts.pos), np.array(contacts.frame)[:, :3],
                            -np.array(contacts.dist))


class Fcl:
    """python-fcl's `collide` of two boxes."""

    def __init__(self, choose: str) -> None:
        import fcl

        self.name = f'python-fcl collide, {choose}'
        self._choose = CHOICES[choose]
        self._fcl = fcl
        self._request = fcl.CollisionRequest(num_max_contacts=MOST_CONTACTS, enable_contact=True)

    def prepare(self, pairs: Pairs) -> list[tuple[Any, ...]]:
        fcl = self._fcl
        boxes = _per_sizes(lambda p, q: (fcl.CollisionObject(fcl.Box(*p)),
                                         fcl.CollisionObject(fcl.Box(*q))))
        return [(*boxes(p, q), a[:3], b[:3], np.roll(a[3:], 1), np.roll(b[3:], 1))
                for a, b, p, q in _rows(pairs)]

    def ask(self, one: Any, two: Any, a: np.ndarray, b: np.ndarray, quat_a: np.ndarray,
            quat_b: np.ndarray) -> Any:
        fcl = self._fcl
        one.setTransform(fcl.Transform(quat_a, a))
        two.setTransform(fcl.Transform(quat_b, b))
        result = fcl.CollisionResult()
        fcl.collide(one, two, self._request, result)
        return result

    def read(self, result: Any) -> EngineAnswer:
        contacts = result.contacts
        return self._choose(np.array([c.pos for c in contacts]),
                            np.array([c.normal for c in contacts]),
                            np.array([c.penetration_depth for c in contacts]))


class Coal:
    """Coal's `collide`: the deepest point."""

    name = 'Coal collide'

    def __init__(self) -> None:
        import coal

        self._coal = coal
        self._request = coal.CollisionRequest()
        self._request.enable_contact = True
        self._request.num_max_contacts = MOST_CONTACTS
        self._result = coal.CollisionResult()

    def prepare(self, pairs: Pairs) -> list[tuple[Any, ...]]:
        coal = self._coal
        boxes = _per_sizes(lambda p, q: (coal.Box(*p), coal.Box(*q), coal.Transform3s(),
                                         coal.Transform3s()))
        return [(*boxes(p, q), a[:3], b[:3], rotation_matrix(a[3:]), rotation_matrix(b[3:]))
                for a, b, p, q in _rows(pairs)]

    def ask(self, one: Any, two: Any, at_one: Any, at_two: Any, a: np.ndarray, b: np.ndarray,
            turn_a: np.ndarray, turn_b: np.ndarray) -> Any:
        at_one.setTranslation(a)
        at_one.setRotation(turn_a)
        at_two.setTranslation(b)
        at_two.setRotation(turn_b)
        self._result.clear()
        self._coal.collide(one, at_one, two, at_two, self._request, self._result)
        return self._result

    def read(self, result: Any) -> EngineAnswer:
        if not result.numContacts():
            return EngineAnswer(False, None, None)
        contact = result.getContact(0)
        return EngineAnswer(True, np.array(contact.normal), np.array(contact.pos))


class Bullet:
    """PyBullet's `getClosestPoints` at distance 0."""

    def __init__(self, choose: str) -> None:
        import pybullet

        self.name = f'PyBullet getClosestPoints, {choose}'
        self._choose = CHOICES[choose]
        self._bullet = pybullet
        self._client = pybullet.connect(pybullet.DIRECT)

    def prepare(self, pairs: Pairs) -> list[tuple[Any, ...]]:
        bullet, client = self._bullet, self._client
        # Bodies stay in the world and slow its broad phase down: only those of these pairs.
        bullet.resetSimulation(physicsClientId=client)

        def bodies(p: np.ndarray, q: np.ndarray) -> tuple[int, int]:
            return tuple(bullet.createMultiBody(
                1.0, bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=list(0.5 * size),
                                                 physicsClientId=client),
                physicsClientId=client) for size in (p, q))

        made = _per_sizes(bodies)
        return [(*made(p, q), tuple(a[:3]), tuple(b[:3]), tuple(a[3:]), tuple(b[3:]))
                for a, b, p, q in _rows(pairs)]

    def ask(self, one: int, two: int, a: Any, b: Any, turn_a: Any, turn_b: Any) -> Any:
        bullet, client = self._bullet, self._client
        bullet.resetBasePositionAndOrientation(one, a, turn_a, physicsClientId=client)
        bullet.resetBasePositionAndOrientation(two, b, turn_b, physicsClientId=client)
        return bullet.getClosestPoints(one, two, 0.0, physicsClientId=client)

    def read(self, result: Any) -> EngineAnswer:
        # 5, 6: the points on A and B; 7: the normal on B, towards A; 8: the distance.
        return self._choose(np.array([0.5 * (np.array(c[5]) + np.array(c[6])) for c in result]),
                            np.array([-np.array(c[7]) for c in result]),
                            np.array([-c[8] for c in result]))


def _deepest(points: np.ndarray, normals: np.ndarray, depths: np.ndarray) -> EngineAnswer:
    if not len(points):
        return EngineAnswer(False, None, None)
    first = int(np.argmax(depths))
    return EngineAnswer(True, normals[first], points[first])


def _mean(points: np.ndarray, normals: np.ndarray, depths: np.ndarray) -> EngineAnswer:
    if not len(points):
        return EngineAnswer(False, None, None)
    return EngineAnswer(True, normals[int(np.argmax(depths))], points.mean(axis=0))


CHOICES: dict[str, Callable[[np.ndarray, np.ndarray, np.ndarray], EngineAnswer]] = {
    'deepest': _deepest, 'mean': _mean}
"""One point of several (n, 3), with their normals (n, 3) and depths (n,)."""

PEERS: dict[str, tuple[str, list[Callable[[], Contestant]]]] = {
    'mujoco': ('sim', [MujocoDistance, lambda: MujocoCollision('deepest'),
                       lambda: MujocoCollision('mean')]),
    'fcl': ('soup', [lambda: Fcl('deepest'), lambda: Fcl('mean')]),
    'coal': ('peers', [Coal]),
    'pybullet': ('peers', [lambda: Bullet('deepest'), lambda: Bullet('mean')]),
}
"""By module: the extra of this package that brings it, and its contestants."""


def installed() -> tuple[list[Contestant], list[str]]:
    """The peers that can be imported, and a line about each that cannot."""
    found, missing = [], []
    for module, (extra, makers) in PEERS.items():
        try:
            found += [make() for make in makers]
        except ImportError:
            missing.append(f"{module} is not installed (extra '{extra}')")
    return found, missing


def _rows(pairs: Pairs) -> Iterator[tuple[np.ndarray, ...]]:
    """Contiguous rows: pose_a, pose_b, size_a, size_b."""
    return zip(*(np.ascontiguousarray(part) for part in pairs))


def _per_sizes(make: Callable[[np.ndarray, np.ndarray], Any]) -> Callable[..., Any]:
    """`make`, called once for every pair of sizes."""
    made: dict[bytes, Any] = {}

    def cached(p: np.ndarray, q: np.ndarray) -> Any:
        key = p.tobytes() + q.tobytes()
        if key not in made:
            made[key] = make(p, q)
        return made[key]
    return cached


def _mujoco_model(p: np.ndarray, q: np.ndarray) -> tuple[Any, Any]:
    import mujoco

    bodies = ''.join(
        f'<body><freejoint/><geom type="box" size="{" ".join(map(repr, (0.5 * size).tolist()))}"/>'
        '</body>' for size in (p, q))
    model = mujoco.MjModel.from_xml_string(f'<mujoco><worldbody>{bodies}</worldbody></mujoco>')
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data
