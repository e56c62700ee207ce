# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report `frontier`: its judge finds planted errors, its contestants keep one convention."""
from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from benchmarks import frontier, settled, trials
from benchmarks.contestant import APART, CORE_MODELS, Contestant, Manifold, chosen, ours
from benchmarks.engines import installed
from benchmarks.output import number, read_csv, write_csv
from benchmarks.pose_sets import CONTAINER, SETS, Pairs, apart
from benchmarks.timing import take_turns
from box_contact_ros.solver.pose import rotation_matrix

pytestmark = pytest.mark.reports

ROOT = Path(__file__).resolve().parents[2]
ALL = [ours('exact'), *installed()[0]]
COARSE = {'Drake hydroelastic': 0.03}
"""What a component of a normal may be off by, where more than 1e-5."""


@pytest.fixture(scope='module')
def containers() -> Pairs:
    return SETS['containers'](np.random.default_rng(4), 400)


def answers(pairs: Pairs) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    found = pairs.contacts()
    return found.colliding.copy(), found.normal.copy(), found.point.copy()


def test_goods_at_rest_overlap_and_the_others_stand_apart() -> None:
    """Beyond a billionth of the size, as a simulator settled them; together, all that touch."""
    rest, others = settled.measured()
    assert (-rest.contacts().separation > 1e-9 * rest.size).all()
    touching = settled.touching(learnt=False)
    assert len(rest.size) > 2000 and len(rest.size) + len(others.size) == len(touching.size)
    assert len(others.size) > 500
    assert (-others.contacts().separation <= 1e-9 * others.size).all()
    for make, pairs in ((settled.at_rest, rest), (settled.as_placed, others)):
        drawn = make(np.random.default_rng(1), 100)
        assert len(drawn.size) == 100 and set(drawn.pose_a[:, 0]) <= set(pairs.pose_a[:, 0])


# --- planted errors -------------------------------------------------------------------------------


def test_planted_errors_have_their_size(containers: Pairs) -> None:
    """None; a normal turned by a tenth of a degree, and flipped; a point 1 cm off of 12.192 m."""
    colliding, normals, points = answers(containers)
    found = trials.judge(containers, colliding, normals, points)
    assert found.points['all'] == (len(containers.pose_a), 0.0, 0.0, 0.0, 0.0)
    assert (found.normal, found.missed, found.invented) == ((0.0, 0.0), 0, 0)
    across = np.cross(normals, [0.3, 0.5, 0.2])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    turn = math.radians(0.1)
    turned = math.cos(turn) * normals + math.sin(turn) * across
    found = trials.judge(containers, colliding, turned, points + [0.01, 0.0, 0.0])
    assert found.normal == pytest.approx((0.1, 0.1), rel=1e-6)
    assert len(found.points) > 2
    for _, *errors in found.points.values():
        assert errors == pytest.approx([100.0 * 0.01 / 12.192] * 4, rel=1e-9)
    normals[17] *= -1.0
    assert trials.judge(containers, colliding, normals, points).normal[1] == pytest.approx(180.0)


@pytest.mark.parametrize('name, flipped, expected', [
    ('containers', [3, 5], (2, 0)), ('just apart', [7], (0, 1)),
    ('touching', slice(None, None, 2), (0, 0))])  # at exact touch either verdict is right
def test_wrong_verdicts_are_counted(name: str, flipped: object, expected: tuple[int, int]) -> None:
    pairs = {**SETS, 'just apart': apart}[name](np.random.default_rng(1), 60)
    colliding, normals, points = answers(pairs)
    colliding[flipped] ^= True
    found = trials.judge(pairs, colliding, normals, points)
    assert (found.missed, found.invented) == expected


# --- contestants ----------------------------------------------------------------------------------


@pytest.mark.parametrize('engine', ALL, ids=lambda one: one.name)
def test_conventions(engine: Contestant) -> None:
    """Two containers, 20 mm deep, under any rigid motion.

    The normal is from A to B, the point is in the patch, thickened by the depth. An order of axes
    or of a quaternion that is wrong would show in either.
    """
    rng = np.random.default_rng(3)
    turn = rng.normal(size=(20, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    size = np.tile(CONTAINER, (20, 1))
    up = rotation_matrix(turn)[:, :, 2]
    place = rng.uniform(-5, 5, (20, 3))
    pairs = Pairs(np.hstack([place, turn]), np.hstack([place + (2.591 - 0.02) * up, turn]), size,
                  size)
    for call, middle, normal in zip(engine.prepare(pairs), place + 0.5 * 2.591 * up, up):
        found = engine.read(call())
        for choice in engine.choices:
            answer = chosen(found, choice)
            assert answer.touching
            np.testing.assert_allclose(answer.normal, normal, atol=COARSE.get(engine.name, 1e-5))
            off = answer.point - middle
            assert abs(off @ normal) <= 0.0201
            assert np.linalg.norm(off - (off @ normal) * normal) <= 0.5 * math.hypot(12.2, 2.44)


@pytest.mark.parametrize('engine', ALL, ids=lambda one: one.name)
def test_boxes_apart(engine: Contestant) -> None:
    size = np.tile((2.0, 2.0, 2.0), (1, 1))
    pose = np.array([[0.0, 0, 0, 0, 0, 0, 1]])
    pairs = Pairs(pose, pose + [[0, 0, 2.5, 0, 0, 0, 0]], size, size)
    touching, normal, point = chosen(engine.read(engine.prepare(pairs)[0]()), engine.choices[0])
    assert not touching and np.isnan([normal, point]).all()


def test_contacts_that_an_engine_misses_are_odd() -> None:
    """All of containers and none of cubes; the cause is named where it is known."""
    exact = ours('exact')
    engine = dataclasses.replace(exact, name='blind', causes={'missed': 'Planted.'}, boxes=lambda
                                 p, q: (lambda a, b: None) if p[0] > 10.0 else exact.boxes(p, q),
                                 read=lambda found: APART if found is None else exact.read(found),
                                 prepare_batch=None)
    rows = []
    for name in ('random cubes', 'containers'):
        pairs = SETS[name](np.random.default_rng(1), 30)
        trial = trials.Trial(engine, name, pairs, trials.ask(engine, pairs, trials.QUICK),
                             trials.QUICK)
        take_turns([trial.time], trials.QUICK.rounds)
        rows.append(trial.row())
    cubes, containers = rows
    assert cubes.errors.points['all'].worst == 0.0 and (cubes.rounds[:, 0] > 0.0).all()
    assert containers.errors.missed == containers.judged > 10 and cubes.calls > 30
    line, = frontier.odd_answers(rows, [engine])
    assert line == f'Planted. blind, containers: missed {containers.judged}.'


def test_the_centroid_of_a_polygon() -> None:
    """An L cannot be: the points are convex; their order does not matter, nor do inner ones."""
    corners = np.array([[0, 0, 1], [4, 0, 1], [4, 2, 1], [0, 2, 1], [4, 1, 1]], float)
    found = chosen(Manifold(corners[[0, 2, 4, 1, 3]], np.tile([0, 0, 1.0], (5, 1)), np.ones(5)),
                   'patch centroid')
    np.testing.assert_allclose(found.point, [2, 1, 1], atol=1e-12)
    triangle = corners[:3] @ rotation_matrix(np.array([0.5, 0.5, 0.5, 0.5])).T
    found = chosen(Manifold(triangle, np.tile([1.0, 0, 0], (3, 1)), np.ones(3)), 'patch centroid')
    np.testing.assert_allclose(found.point, triangle.mean(axis=0), atol=1e-12)


def test_the_mean_by_depth() -> None:
    """Two springs, one pressed three times as deep; without any depth, the mean."""
    points, normals = np.array([[0.0, 0, 0], [4, 0, 0]]), np.tile([0, 0, 1.0], (2, 1))
    for depths, along in (((0.3, 0.1), 1.0), ((0.0, 0.0), 2.0)):
        found = chosen(Manifold(points, normals, np.array(depths)), 'mean by depth')
        np.testing.assert_allclose(found.point, [along, 0, 0], atol=1e-12)


# --- the whole ------------------------------------------------------------------------------------


@pytest.mark.parametrize('name', frontier.PICTURES)
def test_the_picture_is_of_the_table(name: str) -> None:
    """All that the committed table has, each with the best of its points: a time and an error."""
    table, picture = ROOT / 'docs' / 'results' / 'frontier.csv', frontier.PICTURES[name]
    for of_sets in frontier.PANELS.values():
        measured = {row['contestant'] for row in read_csv(table)
                    if row['set'] in of_sets and row[picture.column]}
        found = frontier.shown_points(table, of_sets, picture)
        assert set(found) == measured & set(picture.shown)
        assert len(found) >= 5 and found['exact'][1] == 0.0 < found['mlp'][1]
        for time, error in found.values():
            assert picture.limits[0] < picture.unit * time < picture.limits[1]
            assert error <= frontier.ERRORS[1]


def check_short_table(folder: Path) -> None:
    """One point stands for an engine on all sets, with the share of pairs that it answers."""
    found = {(f'`{row["contestant"]}`, {row["instruction_set"]}' if row['contestant'] in CORE_MODELS
              else row['contestant'], row['set'], row['point']): row
             for row in read_csv(folder / 'frontier.csv') if row['class'] == 'all'}
    page = (folder / 'frontier.md').read_text('utf-8').partition('## In short')[2]
    lines = [line.strip('| ').split(' | ') for line in page.partition('## Odd')[0].splitlines()
             if line.startswith('| ')]
    assert len(lines) > 10
    for name, _, _, point, *cells in lines[2:]:
        for of_set, cell in zip(('containers', 'settled', 'as placed'), cells):
            row = found.get((name, of_set, point.replace('–', 'its point')), {})
            assert cell == (f'{number(float(row["point_p99"]))}, '
                            f'{number(100 * int(row["contacts"]) / int(row["judged"]))}'
                            if row and row['point_p99'] else '–'), (name, of_set)


def test_the_short_table_is_of_the_committed_table() -> None:
    check_short_table(ROOT / 'docs' / 'results')


def test_no_contestant_vanishes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One that misses all pairs of a set is left out of its panel; a model of others is drawn."""
    rows = [dict(contestant=name, set='containers', point='its point', point_p99=error,
                 call_p50=400, batch_p50=100, **{'class': 'all'})
            for name, error in (('exact', 0.0), ('MuJoCo mj_collision', None), ('Mine', 3.0))]
    write_csv(tmp_path / 'frontier.csv', rows)
    picture = frontier.PICTURES['frontier']
    assert set(frontier.shown_points(tmp_path / 'frontier.csv', ['containers'], picture)) == {
        'exact'}
    frontier.draw(tmp_path, tmp_path / 'frontier.csv', ['Mine'])
    said = capsys.readouterr().err
    assert 'not in frontier.png, as not measured: ' in said and 'Drake' in said
    assert 'Mine' not in said and (tmp_path / 'frontier_batches.png').exists()


def test_a_missing_rival_ends_a_full_run_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                 capsys: pytest.CaptureFixture[str]) -> None:
    """Unless it is left out on purpose."""
    monkeypatch.setattr(frontier, 'installed', lambda: ([], ['coal is not installed (extra)']))
    assert frontier.main(['--out', str(tmp_path)]) == 1
    assert 'add --leave-out coal' in capsys.readouterr().err and not list(tmp_path.iterdir())
    monkeypatch.setattr(frontier, 'measure_all', Mock(side_effect=InterruptedError))
    with pytest.raises(InterruptedError):
        frontier.main(['--leave-out', 'coal', '--out', str(tmp_path)])


def test_mlp_is_more_exact_than_mujoco_in_the_committed_table() -> None:
    """On every set, beside the best point that MuJoCo's contacts give."""
    errors: dict[str, dict[str, list[float]]] = {}
    for row in read_csv(ROOT / 'docs' / 'results' / 'frontier.csv'):
        if row['class'] == 'all' and row['point_p99']:
            errors.setdefault(row['set'], {}).setdefault(row['contestant'], []).append(
                float(row['point_p99']))
    assert len(errors) == len(frontier.TIMED_SETS) - 1  # apart, no box has a point
    for name, found in errors.items():
        assert max(found['mlp']) < min(found['MuJoCo mj_collision']), name


@pytest.mark.parametrize('name', [one for one in frontier.TIMED_SETS if one != 'just apart'])
def test_mlp_is_more_exact_than_mujoco(name: str) -> None:
    """A sample of each set, drawn anew."""
    engine = next((one for one in ALL if one.name == 'MuJoCo mj_collision'), None)
    if engine is None:
        pytest.skip('MuJoCo is not installed')
    pairs = frontier.TIMED_SETS[name](np.random.default_rng(6), 100)

    def p99(one: Contestant) -> float:
        found = trials.ask(one, pairs, dataclasses.replace(trials.QUICK, single_pairs=100))
        return min(trials.judge(pairs.rows(slice(100)), found.colliding[:100], found.normals[:100],
                                points[:100]).points['all'].p99 for points in found.points.values())

    assert p99(ours('mlp')) < p99(engine)


@pytest.mark.reports
def test_quick_run(tmp_path: Path) -> None:
    assert frontier.main(['--quick', '--out', str(tmp_path)]) == 0
    with (tmp_path / 'frontier.csv').open() as file:
        rows = list(csv.DictReader(file))
    engines = {engine.name for engine in installed()[0]}
    assert {'python-fcl collide', *frontier.QUICK_MODELS, *frontier.SIZES, 'mlp, linear',
            'paper-at-rest', *engines & set(frontier.CALLS)} <= {row['contestant'] for row in rows}
    assert {row['set'] for row in rows} == set(frontier.TIMED_SETS)
    page = (tmp_path / 'frontier.md').read_text('utf-8')
    assert '| `mlp, linear` |' not in page.partition('![')[0]
    check_short_table(tmp_path)
    for of_sets in frontier.PANELS.values():
        found = frontier.shown_points(tmp_path / 'frontier.csv', of_sets,
                                      frontier.PICTURES['frontier_batches'])
        assert {'exact', 'paper', *frontier.SIZES} <= set(found)
    core = [row for row in rows if row['contestant'] in ('exact', 'mlp')]
    for row in core:
        assert (row['missed'], row['invented']) == ('0', '0')
        assert row['set'] in ('just apart', 'touching', 'as placed') or (
            float(row['normal_worst']) == 0.0)
        assert 0.0 < float(row['call_p50']) <= float(row['call_p99']) <= float(row['call_max'])
        assert float(row['batch_p50']) > 0.0
    assert all(float(row['point_worst']) == 0.0 for row in core
               if row['contestant'] == 'exact' and row['set'] != 'just apart')
    assert 'nan' not in (tmp_path / 'frontier.md').read_text().lower()
    assert (tmp_path / 'frontier.png').stat().st_size > 10_000
