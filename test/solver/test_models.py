# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The registry of models: one entry makes a model, and what is listed elsewhere is what it has."""
from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import poses
import pytest
import yaml

import box_contact_ros
from box_contact_ros import ContactSolver, models
from box_contact_ros.solver.arguments import model_name, seed_number
from box_contact_ros.solver.models import (
    Exact,
    Family,
    ModelEntry,
    NativeModel,
    build_model,
    find_model,
    model_names,
)

ROOT = Path(__file__).resolve().parents[2]
HIGHER = np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])


class Lifted(Exact):
    """The exact point, moved up by N mm: a model of this test's own."""

    def __init__(self, millimetres):
        super().__init__()
        self.lift = 1e-3 * millimetres

    def solve(self, a, b, size_a, size_b, threads=1):
        found, refused = super().solve(a, b, size_a, size_b, threads)
        found.point[found.colliding, 2] += self.lift
        return found, refused


@pytest.fixture
def lifted(monkeypatch):
    """Return the model above as an entry, which is all that it takes."""
    monkeypatch.setitem(sys.modules, 'of_a_test', SimpleNamespace(Lifted=Lifted))
    monkeypatch.setitem(models(), 'lifted', ModelEntry(
        name='lifted', line='the exact point, lifted', builder='of_a_test:Lifted',
        takes=('millimetres',), native_batch=True, patch=True,
        family=Family(argument='millimetres', default=1, most=9)))


@pytest.mark.parametrize('name, lift', [('lifted', 1e-3), ('lifted-7', 7e-3)])
def test_a_model_is_added_by_an_entry(lifted, name, lift):
    """Single calls and batches answer with it, for any threads."""
    exact, solver = (ContactSolver(poses.CUBE, poses.CUBE, model=model)
                     for model in ('exact', name))
    want = exact(poses.IDENTITY, HIGHER).point + (0, 0, lift)
    assert solver(poses.IDENTITY, HIGHER).point == pytest.approx(want, abs=1e-15)
    many = solver.batch([poses.IDENTITY] * 3, [HIGHER] * 3, threads=2)
    assert many.point == pytest.approx(np.tile(want, (3, 1)), abs=1e-15)
    assert model_name(name) == name


def test_programs_take_names_and_seeds():
    with pytest.raises(argparse.ArgumentTypeError, match="'exakt' is not one of"):
        model_name('exakt')
    assert seed_number('7') == 7
    for text in ('-1', '1.5', '²', '9' * 19):
        with pytest.raises(argparse.ArgumentTypeError, match='not a whole number from 0'):
            seed_number(text)


def test_an_added_model_is_named_where_another_is_refused(lifted):
    with pytest.raises(ValueError, match="model 'lifte' is not one of: .*, lifted, lifted-N "
                       r'\(did you mean lifted\?\)$'):
        ContactSolver(poses.CUBE, poses.CUBE, model='lifte')
    with pytest.raises(ValueError, match='millimetres N of lifted-N must be a whole .* 1 to 9'):
        ContactSolver(poses.CUBE, poses.CUBE, model='lifted-10')


@pytest.mark.parametrize('name', models())
def test_entries_say_what_their_models_do(name):
    """Weights are read where the entry says so; the core answers for its own models."""
    if models()[name].extra:
        pytest.importorskip('fcl')
    size = np.array([poses.CUBE])
    made = build_model(name, size, size, None)
    assert models()[name].name == name and find_model('model', name)[0] is models()[name]
    assert isinstance(made, NativeModel) is models()[name].native_batch
    has_weights = getattr(made, 'weights', None) is not None
    assert has_weights == ('weights' in models()[name].takes)


def test_a_missing_library_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, 'fcl', None)
    monkeypatch.delitem(sys.modules, 'box_contact_ros.soup.fcl_box', raising=False)
    with pytest.raises(ModuleNotFoundError, match="fcl.*model 'fcl' needs the extra 'soup'"
                       r".*pip install -c constraints\.txt -e '\.\[soup\]'"):
        ContactSolver((1, 1, 1), (1, 1, 1), model='fcl')


def test_the_docs_have_a_row_for_every_entry():
    """Names, boxes and extra."""
    page = ROOT / 'docs' / 'how-to' / 'models.md'
    table = page.read_text('utf-8').partition('\n| Model | Boxes |')[2]
    rows = [line.strip('| ').split(' | ')
            for line in table.partition('\n\n')[0].splitlines()[2:]]
    assert [re.findall('`(.*?)`', names) for names, _, _ in rows] == [
        list(entry.names) for entry in models().values()]
    for (_, boxes, point), entry in zip(rows, models().values(), strict=True):
        assert boxes == entry.boxes
        assert re.findall('extra `(.*)`', point) == ([entry.extra] if entry.extra else [])


def test_the_parameter_file_lists_every_name():
    text = (ROOT / 'config' / 'contact_node.yaml').read_text('utf-8')
    assert f'found: {model_names()}.' in re.sub(r'\n *# ', ' ', text)
    assert find_model('model', yaml.safe_load(text)['/**']['ros__parameters']['model'])


PACKAGE = """
from box_contact_ros.solver.models import ModelEntry, exact as build
ENTRY = ModelEntry(name='mine', line='exact, renamed', builder='mine:build')
"""
POINTS = """
[box_contact_ros.models]
mine = mine:ENTRY
lost = mine:NOTHING
exact = mine:ENTRY
"""
ASKED = """
import box_contact_ros as b
solver = b.ContactSolver((1, 1, 1), (1, 1, 1), model='mine')
print(solver([0.0] * 6 + [1.0], [0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0]).separation)
print([name for name in b.models() if name in ('mlp', 'exact', 'lost', 'mine')])
"""


def python(code, **environment):
    return subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          cwd=Path(box_contact_ros.__file__).parents[1],
                          env={**os.environ, **environment})


def test_a_package_adds_a_model(tmp_path):
    """By an entry point of its own; one that cannot be loaded warns and hides no other."""
    (tmp_path / 'mine.py').write_text(PACKAGE)
    info = tmp_path / 'mine-1.0.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text('Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n')
    (info / 'entry_points.txt').write_text(POINTS)
    done = python(ASKED, PYTHONPATH=os.pathsep.join([str(tmp_path), *filter(None, sys.path)]))
    assert done.stdout == "-0.5\n['mlp', 'exact', 'mine']\n", done.stderr
    for name, cause in (('lost', "AttributeError: module 'mine' has no attribute 'NOTHING'"),
                        ('exact', "TypeError: it is not the ModelEntry of a model 'exact'")):
        assert re.search(f"model '{name}' of mine:.* is left out: {cause}", done.stderr)


def test_the_default_asks_for_no_other_model():
    """Looking for packages takes 20 ms, and importing their models longer."""
    done = python('import box_contact_ros.solver.models as m; m.build_model("mlp", *[None] * 3); '
                  'print(m.models.cache_info().currsize)')
    assert done.stdout == '0\n', done.stderr
