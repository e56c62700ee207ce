"""The report `frontier`: its judge finds planted errors, its contestants keep one convention."""
from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from box_contact_ros import output
from box_contact_ros.baselines.engines.engine import Engine, installed, ours
from box_contact_ros.reports.frontier import frontier
from box_contact_ros.scene.pose import rotation_matrix
from box_contact_ros.scene.pose_sets import SETS, Pairs
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.models import MODELS

ROOT = Path(__file__).resolve().parents[2]
RIVALS, MISSING = installed()


@pytest.fixture(scope='module')
def containers() -> Pairs:
    return SETS['containers'](np.random.default_rng(4), 400)


def answers(pairs: Pairs) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    found = ContactSolver((1, 1, 1), (1, 1, 1), model='exact').batch(
        pairs.pose_a, pairs.pose_b, size_a=pairs.size_a, size_b=pairs.size_b)
    return found.colliding.copy(), found.normal.copy(), found.point.copy()


def wrong_verdicts(pairs: Pairs, *given: np.ndarray) -> tuple[int, int]:
    """Return how many contacts were missed and invented."""
    found = frontier.judge(pairs, *given)
    return found.missed, found.invented


# --- planted errors -------------------------------------------------------------------------------


def test_no_error_is_found_where_there_is_none(containers: Pairs) -> None:
    found = frontier.judge(containers, *answers(containers))
    assert found.points['all'] == (len(containers.pose_a), 0.0, 0.0, 0.0)
    assert (found.normal, found.missed, found.invented) == ((0.0, 0.0), 0, 0)


def test_a_flipped_normal_shows(containers: Pairs) -> None:
    colliding, normals, points = answers(containers)
    normals[17] *= -1.0
    assert frontier.judge(containers, colliding, normals, points).normal[1] == pytest.approx(180.0)


def test_a_normal_off_by_a_tenth_of_a_degree_shows(containers: Pairs) -> None:
    colliding, normals, points = answers(containers)
    across = np.cross(normals, [0.3, 0.5, 0.2])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    turn = math.radians(0.1)
    worst = frontier.judge(containers, colliding,
                           math.cos(turn) * normals + math.sin(turn) * across, points).normal[1]
    assert worst == pytest.approx(0.1, rel=1e-6)


def test_a_point_shifted_by_a_centimetre_shows(containers: Pairs) -> None:
    """In its class, as 1 cm of 12.192 m."""
    colliding, normals, points = answers(containers)
    points[:, 0] += 0.01
    found = frontier.judge(containers, colliding, normals, points).points
    assert len(found) > 2
    for _, *errors in found.values():
        assert errors == pytest.approx([100.0 * 0.01 / 12.192] * 3, rel=1e-9)


def test_wrong_verdicts_show(containers: Pairs) -> None:
    colliding, normals, points = answers(containers)
    colliding[[3, 5]] = False
    assert wrong_verdicts(containers, colliding, normals, points) == (2, 0)
    gaps = frontier.apart(np.random.default_rng(1), 60)
    colliding, normals, points = answers(gaps)
    assert not colliding.any()
    colliding[7] = True
    assert wrong_verdicts(gaps, colliding, normals, points) == (0, 1)


def test_at_exact_touch_either_verdict_is_right() -> None:
    touching = SETS['touching'](np.random.default_rng(1), 60)
    colliding, normals, points = answers(touching)
    colliding[::2] ^= True
    assert wrong_verdicts(touching, colliding, normals, points) == (0, 0)


# --- contestants ----------------------------------------------------------------------------------


@pytest.mark.parametrize('engine', [ours('exact'), *RIVALS], ids=lambda one: one.name)
def test_conventions(engine: Engine) -> None:
    """Two containers, 20 mm deep, under any rigid motion.

    The normal is from A to B, the point is in the patch, thickened by the depth. An order of axes
    or of a quaternion that is wrong would show in either.
    """
    rng = np.random.default_rng(3)
    turn = rng.normal(size=(20, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    size = np.tile((12.192, 2.438, 2.591), (20, 1))
    up = rotation_matrix(turn)[:, :, 2]
    place = rng.uniform(-5, 5, (20, 3))
    pairs = Pairs(np.hstack([place, turn]), np.hstack([place + (2.591 - 0.02) * up, turn]), size,
                  size)
    for call, middle, normal in zip(engine.prepare(pairs), place + 0.5 * 2.591 * up, up):
        answer = engine.read(call())
        assert answer.touching and answer.normal is not None and answer.point is not None
        np.testing.assert_allclose(answer.normal, normal, atol=1e-5)
        off = answer.point - middle
        assert abs(off @ normal) <= 0.0201
        assert np.linalg.norm(off - (off @ normal) * normal) <= 0.5 * math.hypot(12.2, 2.44)


@pytest.mark.parametrize('engine', [ours('exact'), *RIVALS], ids=lambda one: one.name)
def test_boxes_apart(engine: Engine) -> None:
    size = np.tile((2.0, 2.0, 2.0), (1, 1))
    pose = np.array([[0.0, 0, 0, 0, 0, 0, 1]])
    pairs = Pairs(pose, pose + [[0, 0, 2.5, 0, 0, 0, 0]], size, size)
    answer = engine.read(engine.prepare(pairs)[0]())
    assert answer == (False, None, None)


def test_what_is_not_installed_is_said() -> None:
    """The extras `sim` and `soup` are there in the tests; other peers may be."""
    assert not any('mujoco' in line or 'fcl' in line for line in MISSING)
    assert all("extra 'peers'" in line for line in MISSING)


# --- the frontier ---------------------------------------------------------------------------------


def test_pareto() -> None:
    """Against the definition, point by point."""
    rng = np.random.default_rng(2)
    points = [tuple(p) for p in rng.uniform(size=(60, 2))]
    expected = sorted(p for p in points
                      if not any(q[0] <= p[0] and q[1] <= p[1] and q != p for q in points))
    assert [points[place] for place in output.pareto(points)] == expected


def test_quick_run(tmp_path: Path) -> None:
    assert frontier.main(['--quick', '--out', str(tmp_path)]) == 0
    with (tmp_path / 'frontier.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert {'exact', 'mlp', 'paper', 'fcl', 'soup-8'} <= {row['contestant'] for row in rows}
    assert {row['set'] for row in rows} == set(frontier.ALL_SETS)
    ours = [row for row in rows if row['contestant'].split()[0] in ('exact', 'mlp')]
    for row in ours:
        assert (row['missed'], row['invented']) == ('0', '0')
        assert row['set'] in ('just apart', 'touching') or float(row['normal_worst']) == 0.0
        assert 0.0 < float(row['call_p50']) <= float(row['call_p99']) <= float(row['call_max'])
        assert float(row['batch_p50']) > 0.0
    assert all(float(row['point_worst']) == 0.0 for row in ours
               if row['contestant'] == 'exact' and row['class'] != 'all')
    text = (tmp_path / 'frontier.md').read_text()
    assert 'nan' not in text.lower().replace('nanosecond', '')
    assert (tmp_path / 'frontier.png').stat().st_size > 10_000


# --- what is committed ----------------------------------------------------------------------------


def test_the_readme_has_the_table_of_the_report() -> None:
    text = (ROOT / 'docs' / 'results' / 'frontier.md').read_text()
    lines = text.split('## In short')[1].split('\n\n')[2]
    assert lines.count('\n') == 1 + len(frontier.IN_SHORT)
    assert lines in (ROOT / 'README.md').read_text()


def test_the_committed_report_has_all_of_them() -> None:
    with (ROOT / 'docs' / 'results' / 'frontier.csv').open() as file:
        names = {row['contestant'] for row in csv.DictReader(file)}
    assert {*frontier.IN_SHORT, 'mlp 8', 'mlp edges 64', 'paper-continuous',
            *MODELS['soup'].reported_names} <= names
