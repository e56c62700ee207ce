# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""~/get_boxes and `YardClient`: a yard is listed while it lives, and followed from then on."""
from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from raw_client import ORIGIN
from ros_client import CUBES, Client, serving
from std_msgs.msg import Header
from typed_messages import a_box, answered, joint_state

from box_contact_msgs.msg import Body, Code
from box_contact_msgs.srv import Check, CheckPath, GetBoxes, SetBoxes
from box_contact_ros import Box, Frame, Pair, Scene, SceneSolver
from box_contact_ros.node import get_boxes
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.get_boxes import KEPT_SCENES, KEPT_SECONDS, PAGE, Lister
from box_contact_ros.node.messages import set_pose
from box_contact_ros.node.yard_client import Yard, YardClient, _scene_of

pytest.importorskip('benchmarks.yard_clients')

from benchmarks import yard_clients

CUBE = (2.0, 2.0, 2.0)
EPOCH = 7
CHANGES = 60  # 600 were tried
LARGE = Scene({'hook': Box(CUBE), **{f'c{n}': Box(CUBE, (3.0 * n, 0, 0, 0, 0, 0, 1))
                                     for n in range(3 * PAGE)}},
              poses='named', patterns=(('*', '*'),))


class Listing:
    """Asks a `Lister` by a clock that stands, while its scene changes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.solver, self.lister = 0.0, SceneSolver(LARGE), Lister(EPOCH)
        monkeypatch.setattr(get_boxes, 'time', SimpleNamespace(monotonic=lambda: self.now))

    def page(self, **fields: Any) -> GetBoxes.Response:
        """Return an answer of the newest scene's node."""
        return answered(GetBoxes.Request(**fields), GetBoxes.Response(),
                        lambda *both: self.lister.answer(self.solver, 'exact', *both))

    def change(self, *names: str) -> None:
        """Let boxes go."""
        self.solver.set_boxes(absent=names)
        self.solver = self.solver.with_model('exact')


@pytest.fixture
def listing(monkeypatch: pytest.MonkeyPatch) -> Listing:
    return Listing(monkeypatch)


def test_a_scene_is_listed_whole_though_it_changes(listing: Listing) -> None:
    """The pages are those of the scene that was the newest at first."""
    pages = [listing.page()]
    while sum(len(page.boxes) for page in pages) < pages[0].count:
        listing.change(f'c{len(pages)}', f'c{3 * PAGE - len(pages)}')
        pages.append(listing.page(epoch=EPOCH, revision=0,
                                  first=sum(len(page.boxes) for page in pages)))
    assert [len(page.boxes) for page in pages] == [PAGE, PAGE, PAGE, 1]
    assert {page.revision for page in pages} == {0} and _scene_of(pages) == LARGE
    assert listing.page().revision == 3
    assert (pages[0].model, pages[1].model, pages[1].patterns) == ('exact', '', [])


def test_a_scene_is_kept_for_ten_seconds_after_its_last_page(listing: Listing) -> None:
    listing.page()
    for number in range(3):
        listing.change(f'c{number}')
        listing.now += 0.9 * KEPT_SECONDS
        assert listing.page(revision=0, first=PAGE).success
    listing.now += 1.1 * KEPT_SECONDS
    gone = listing.page(revision=0, first=2 * PAGE)
    assert gone.code.value == Code.OUTDATED and not gone.boxes
    assert gone.message == 'revision 0 of epoch 0 is not kept: the newest is 3 of 7; begin anew'
    assert listing.page(epoch=8).code.value == Code.OUTDATED


def test_as_few_scenes_are_kept_as_are_listed_last(listing: Listing) -> None:
    """One that nobody lists is not kept at all."""
    listing.change('c0')
    listing.page()
    for number in range(1, KEPT_SCENES + 1):
        listing.change(f'c{number}')
        listing.page()
    assert [listing.page(revision=number, first=PAGE).success
            for number in range(KEPT_SCENES + 2)] == [False, False, True, True, True, True]


def test_a_scene_of_topics_is_told_with_its_pairs() -> None:
    """What a file may have: topics, names of pairs, bodies, a frame; also after changes."""
    scene = Scene(
        {'load': Box(CUBE, pose_topic='crane/load'), 'beam': Box(CUBE, body='spreader'),
         's1': Box(CUBE, (9, 0, 0, 0, 0, 0, 1)),
         'post': Box(CUBE, (0, 0, 1, 0, 0, 0, 1), body='gate')},
        (Pair('landing', 'load', 's1'), Pair('', 'load', 'beam')), frame_id='map',
        patterns=(('spreader', 's*'),),
        bodies={'spreader': Frame(pose_topic='spreader_at'), 'gate': Frame((5, 0, 0, 0, 0, 0, 1))})
    solver = SceneSolver(scene, margin=0.5)
    solver.set_boxes(absent=['gate'])
    page = answered(GetBoxes.Request(), GetBoxes.Response(),
                    lambda *both: Lister(EPOCH).answer(solver, 'mlp', *both))
    assert page.pose_topics == ['crane/load', 'spreader_at']
    assert (page.margin, page.model, page.poses) == (0.5, 'mlp', 'topics')
    assert _scene_of([page]) == solver.scene


# --- over ROS -------------------------------------------------------------------------------------


@pytest.fixture
def client() -> Iterator[Client]:
    with closing(Client()) as client:
        yield client


def scene_file(tmp_path: Path) -> str:
    path = tmp_path / 'yard.yaml'
    path.write_text(yaml.safe_dump(yard_clients.YARD))
    return str(path)


def is_at(mirror: YardClient, node: ContactNode) -> Callable[[], bool]:
    """Return what tells whether a client has the scene of a node."""
    def is_at() -> bool:
        answerer = node._answerer
        return answerer is not None and mirror.is_current and mirror.yard is not None and (
            mirror.yard.epoch, mirror.yard.revision) == (answerer.epoch, answerer.solver.revision)
    return is_at


def assert_same(mirror: YardClient, scene: Scene) -> None:
    """Hold the mirrored scene against another; a box that came back may have another place."""
    assert mirror.yard is not None
    found = mirror.yard.scene
    assert dict(found.boxes) == dict(scene.boxes) and dict(found.bodies) == dict(scene.bodies)
    assert (found.pairs, found.patterns, found.poses) == (scene.pairs, scene.patterns, scene.poses)


def test_a_client_follows_whatever_changes(client: Client, tmp_path: Path) -> None:
    """Each yard is that of the player, also for clients that start later."""
    seen: list[Yard] = []
    with serving(ContactNode, scene=scene_file(tmp_path), pair_topics=False) as node:
        player = yard_clients.Yard(node._answerer.solver.scene, 5)
        mirrors = [YardClient(client.node, on_yard=seen.append)]
        assert client.spin(is_at(mirrors[0], node))
        for number in range(CHANGES):
            answer = client.call(SetBoxes, 'contact_node/set_boxes', player.change())
            assert answer.success, answer.message
            if number % (CHANGES // 3) == 7:
                mirrors.append(YardClient(client.node))
        for mirror in mirrors:
            assert client.spin(is_at(mirror, node))
            assert_same(mirror, player.now())
    revisions = [yard.revision for yard in seen]
    assert revisions == sorted(set(revisions)) and revisions[-1] == CHANGES
    assert dict(player.kinds).keys() >= {'attach', 'detach', 'fixed', 'moving', 'absent'}


def test_a_large_yard_is_complete_beside_changes(client: Client, tmp_path: Path) -> None:
    """A change with each page, as a crane makes them."""
    def request_of(*boxes: Any) -> SetBoxes.Request:
        return SetBoxes.Request(header=Header(frame_id='map'), fixed=boxes)

    with serving(ContactNode, scene=scene_file(tmp_path), pair_topics=False) as node:
        for first in range(0, 3000, 1000):
            assert client.call(SetBoxes, 'contact_node/set_boxes', request_of(
                *(a_box(f'p{n}', (3 * n, 0, 1, 0, 0, 0, 1), CUBE)
                  for n in range(first, first + 1000)))).success
        change = client._client_of(SetBoxes, 'contact_node/set_boxes')
        seen: list[tuple[int, int]] = []
        mirror = YardClient(client.node, on_yard=lambda yard: seen.append(
            (yard.revision, node._answerer.solver.revision)))
        ask, asked = mirror._ask, []

        def asking() -> None:
            if not seen:
                change.call_async(request_of(
                    a_box('k', (0, -50 - len(asked), 1, 0, 0, 0, 1), CUBE)))
                asked.append(len(mirror._pages))
            ask()

        mirror._ask = asking  # type: ignore[method-assign]
        assert client.spin(lambda: seen)
        assert asked == [0, 1, 2, 3, 4, 5, 6] and seen[0][1] >= seen[0][0] + 3
        assert client.spin(is_at(mirror, node))
        assert_same(mirror, node._answerer.solver.scene)


def test_a_node_that_is_configured_anew_is_listed_anew(client: Client, tmp_path: Path) -> None:
    with serving(ContactNode, scene=scene_file(tmp_path), pair_topics=False) as node:
        mirror = YardClient(client.node)
        assert client.spin(is_at(mirror, node))
        assert client.call(SetBoxes, 'contact_node/set_boxes', SetBoxes.Request(
            header=Header(frame_id='map'), fixed=[a_box('c1', ORIGIN, CUBE)])).success
        node.trigger_deactivate()
        node.trigger_cleanup()
        refused = client.call(GetBoxes, 'contact_node/get_boxes', GetBoxes.Request())
        assert refused.code.value == Code.NOT_ACTIVE
        node.start()
        assert client.spin(is_at(mirror, node)) and mirror.yard is not None
        assert 'c1' not in mirror.yard.scene.boxes


def test_what_makes_no_scene_ends_no_client(client: Client, tmp_path: Path) -> None:
    """Where a callback of a future raises, EventsExecutor ends the process."""
    def refuse(yard: Yard) -> None:
        seen.append(yard.revision)
        if len(seen) == 1:
            raise ValueError('not this one')

    seen: list[int] = []
    with serving(ContactNode, scene=scene_file(tmp_path), pair_topics=False) as node:
        mirror = YardClient(client.node, on_yard=refuse)
        assert client.spin(lambda: len(seen) == 2) and client.spin(is_at(mirror, node))


# --- codes ----------------------------------------------------------------------------------------


def test_each_service_says_success_by_its_code_too(client: Client) -> None:
    """Success is code OK; what is refused has another code, and words."""
    def call(kind: Any, name: str, **fields: Any) -> Any:
        return client.call(kind, f'contact_node/{name}', kind.Request(**fields))

    cube = a_box('g', ORIGIN, CUBE)
    far = Body(name='b', fixed=True, boxes=[cube])
    set_pose(far.pose, ORIGIN)
    way = [joint_state({'g': ORIGIN}, 'map', 0)] * 2
    with serving(ContactNode, autostart=False, **CUBES) as node:
        for kind, name in ((Check, 'check'), (CheckPath, 'check_path'), (SetBoxes, 'set_boxes'),
                           (GetBoxes, 'get_boxes')):
            assert call(kind, name).code.value == Code.NOT_ACTIVE
        node.start()
        told = {
            (Code.OK, 'check'): call(Check, 'check', boxes=[cube]),
            (Code.INVALID, 'check'): call(Check, 'check'),
            (Code.TOO_MUCH, 'check'): call(Check, 'check', boxes=[cube] * 257),
            (Code.OK, 'path'): call(CheckPath, 'check_path', boxes=[cube], waypoints=way),
            (Code.INVALID, 'path'): call(CheckPath, 'check_path', boxes=[cube], waypoints=way[:1]),
            (Code.TOO_MUCH, 'path'): call(CheckPath, 'check_path', boxes=[cube],
                                          waypoints=way * 501),
            (Code.OK, 'set'): call(SetBoxes, 'set_boxes', bodies=[far]),
            (Code.INVALID, 'set'): call(SetBoxes, 'set_boxes', fixed=[a_box('q', ORIGIN)]),
            (Code.TOO_MUCH, 'set'): call(SetBoxes, 'set_boxes', absent=['q'] * 1001),
            (Code.OUTDATED, 'set'): call(SetBoxes, 'set_boxes', expected_revision=9),
            (Code.OK, 'get'): call(GetBoxes, 'get_boxes'),
            (Code.OUTDATED, 'get'): call(GetBoxes, 'get_boxes', revision=9)}
    for (code, what), response in told.items():
        assert (what, response.code.value) == (what, code)
        assert response.success == (code == Code.OK) == (not response.message)
