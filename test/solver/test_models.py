# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models: their names, and objects of a user's own."""
from __future__ import annotations

import argparse
import pickle
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import poses
import pytest
import yaml

import box_contact_ros
from box_contact_ros import ContactSolver
from box_contact_ros.arguments import model_name
from box_contact_ros.core import native
from box_contact_ros.models.make_model import MODELS, check_model, make_model, most_near
from box_contact_ros.solver.model import NATIVE

ROOT = Path(__file__).resolve().parents[2]
HIGHER = np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])


def python(code):
    return subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          cwd=Path(box_contact_ros.__file__).parents[1])


class Lifted:
    """The exact point, moved up by some millimetres: a model of this test's own."""

    def __init__(self, millimetres):
        self.exact, self.lift = native.Exact(), 1e-3 * millimetres

    def size_fault(self, size_a, size_b):
        return None if max(size_a) < 9.0 else 'box A is too large'

    def solve(self, a, b, size_a, size_b, threads=1):
        found, refused = self.exact.solve(a, b, size_a, size_b, threads)
        found.point[found.colliding, 2] += self.lift
        return found, refused


@pytest.mark.parametrize(('answer', 'words'), [
    (None, 'must return Contacts and the first refused row or -1, not None'),
    ((None, -1), 'must return Contacts and'),
    (native.Exact().solve(*[np.array([poses.IDENTITY])] * 2, *[np.ones((1, 3))] * 2, 1),
     'must return 3 contacts, a row a pair, not 1')])
def test_an_answer_that_is_none_is_refused(answer, words):
    """By the model's name, not by an error deep in the solver."""
    class Mine:
        def solve(self, *_):
            return answer

    with pytest.raises(ValueError, match=f'model <.*Mine.*: solve {re.escape(words)}'):
        ContactSolver(poses.CUBE, poses.CUBE, model=Mine()).batch(
            [poses.IDENTITY] * 3, [HIGHER] * 3)


def test_an_object_is_a_model():
    """Single calls, batches and rows by place answer with it, for any threads, and when copied."""
    exact, solver = (ContactSolver(poses.CUBE, poses.CUBE, model=model)
                     for model in ('exact', Lifted(7)))
    want = exact(poses.IDENTITY, HIGHER).point + (0, 0, 7e-3)
    assert solver(poses.IDENTITY, HIGHER).point == pytest.approx(want, abs=1e-15)
    assert pickle.loads(pickle.dumps(solver))(
        poses.IDENTITY, HIGHER).point == pytest.approx(want, abs=1e-15)
    for many in (solver.batch([poses.IDENTITY] * 3, [HIGHER] * 3, threads=2),
                 solver.batch([poses.IDENTITY, HIGHER], pairs=[[0, 1]] * 3)):
        assert many.point == pytest.approx(np.tile(want, (3, 1)), abs=1e-15)


def test_an_object_refuses_poses_and_sizes():
    with pytest.raises(ValueError, match='^box A is too large$'):
        ContactSolver((9, 1, 1), poses.CUBE, model=Lifted(1))
    with pytest.raises(ValueError, match=r'^pose_b position \(nan'):
        ContactSolver(poses.CUBE, poses.CUBE, model=Lifted(1))(poses.IDENTITY, HIGHER * np.nan)
    with pytest.raises(ValueError, match='margin 0.1 has no effect on model <.*Lifted'):
        ContactSolver(poses.CUBE, poses.CUBE, model=Lifted(1), margin=0.1)


@pytest.mark.parametrize('model, words', [
    *((model, 'and no object with the method solve') for model in (None, 3, Lifted, object())),
    ('paper', 'make_model makes others'), ('exakt', 'did you mean exact')])
def test_what_is_no_model(model, words):
    """Neither is a class, which is not yet made."""
    with pytest.raises(ValueError, match=f'^model .* is not one of: exact, mlp.*{words}'):
        ContactSolver(model=model)


@pytest.mark.parametrize('name', ['exact', 'mlp', 'paper', 'soup-2'])
def test_a_model_answers_for_the_sizes_of_its_call(name):
    """A solver without sizes is every solver with sizes, also in another process."""
    if name == 'soup-2':
        pytest.importorskip('fcl')
    model = make_model(name)
    pair = np.stack([poses.IDENTITY, HIGHER])
    sizes = [poses.CUBE, poses.CONTAINER] if name == 'paper' else [poses.CUBE, (3, 2, 2)]
    size = np.repeat(sizes, 2, axis=0)
    many = ContactSolver(model=model).batch(
        np.tile(pair, (2, 1)), sizes=size, pairs=[[2, 3], [0, 1], [3, 2]])
    for row, (a, b) in zip(many, ((2, 3), (0, 1), (3, 2))):
        solver = pickle.loads(pickle.dumps(ContactSolver(size[a], size[b], model=model)))
        assert type(solver.model) is type(model)
        poses.assert_same_bits(row, solver(pair[a % 2], pair[b % 2]))
    assert many.colliding.all()


def test_a_size_that_nobody_gave():
    with pytest.raises(ValueError, match='^size_a is missing: give it to ContactSolver'):
        ContactSolver()(poses.IDENTITY, HIGHER)
    with pytest.raises(ValueError, match='^size_b is missing: .* or to batch'):
        ContactSolver(poses.CUBE).batch([poses.IDENTITY], [HIGHER])
    with pytest.raises(ValueError, match='^sizes is missing'):
        ContactSolver().batch(np.stack([poses.IDENTITY, HIGHER]), pairs=np.array([[0, 1]]))


def test_programs_take_names_of_models():
    assert model_name('soup-64') == 'soup-64'
    with pytest.raises(argparse.ArgumentTypeError, match="'exakt' is not one of"):
        model_name('exakt')


@pytest.mark.parametrize('name, words', [
    ('exakt', r"^here 'exakt' is not one of: exact, mlp, paper, soup-N \(did you mean exact\?\)$"),
    ('soup', r'\(did you mean soup-N\?\)$'), ('fcl', 'is not one of: exact, mlp, paper, soup-N$'),
    (None, 'is not one of'),
    *((f'soup-{n}', 'must be a whole number from 1 to 64')
      for n in ('0', '65', '', 'x', '8.0', '-8', '²', '008', '8\n', '9' * 5000)),
    ('x' * 100_000, 'is not one of')])
def test_wrong_names(name, words):
    """One short line, whatever the name."""
    with pytest.raises(ValueError, match=words) as refusal:
        check_model('here', name)
    assert len(str(refusal.value)) < 400


def test_a_missing_library_is_named_with_its_extra():
    code = ('import sys; sys.modules["fcl"] = None\n'
            'from box_contact_ros import make_model\n'
            'make_model("soup-8")')
    done = python(code)
    assert re.fullmatch(r"box_contact_ros: the Python module 'fcl' is not installed: .*"
                        r"pip install -c constraints\.txt -e '\.\[soup\]'\n", done.stderr)


def test_a_node_answers_fewer_pairs_by_a_slow_model():
    assert most_near('soup-8') == 64 < most_near('paper') == most_near('mlp') == 32_768


def test_the_docs_have_a_row_for_every_model():
    text = (ROOT / 'docs' / 'how-to' / 'models.md').read_text('utf-8')
    table = text.partition('\n| Model | Boxes |')[2].partition('\n\n')[0]
    assert re.findall('^[|] `(.*?)`', table, re.MULTILINE) == list(MODELS)
    assert {*NATIVE} < {*MODELS}


def test_the_parameter_file_lists_every_name():
    text = (ROOT / 'config' / 'contact_node.yaml').read_text('utf-8')
    assert f'found: {", ".join(MODELS)}.' in re.sub(r'\n *# ', ' ', text)
    check_model('model', yaml.safe_load(text)['/**']['ros__parameters']['model'])


def test_the_default_reads_no_file_and_imports_no_other_model():
    """Its weights are compiled in; FCL and the reader of weights files take time to import."""
    code = ('import sys, builtins, pathlib\n'
            'from box_contact_ros import ContactSolver\n'
            'pathlib.Path.open = builtins.open = None\n'
            'ContactSolver(model="mlp")\n'
            'print({"fcl", "safetensors", "box_contact_ros.models.networks"} & {*sys.modules})')
    done = python(code)
    assert done.stdout == 'set()\n', done.stderr
