# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments that several programs have in common."""
from __future__ import annotations

import argparse
import importlib

import pytest

from benchmarks import output
from box_contact_ros.cli import PROGRAMS
from box_contact_ros.solver import arguments

FOLDERS = ('accuracy', 'bench', 'frontier', 'search paper', 'stability', 'train')
FILES = ('fuzz', 'paper')


def main_of(name):
    return importlib.import_module(PROGRAMS[name].module).main


@pytest.mark.parametrize('words', FOLDERS)
def test_a_file_in_the_place_of_the_folder_is_refused_before_the_work(words, tmp_path, capsys):
    name, *chosen = words.split()
    (tmp_path / 'file').write_text('mine')
    with pytest.raises(SystemExit, match='2'):
        main_of(name)([*chosen, '--out', str(tmp_path / 'file')])
    assert f'cannot write to {tmp_path}/file (File exists)' in capsys.readouterr().err
    assert (tmp_path / 'file').read_text() == 'mine'


@pytest.mark.parametrize('name', FILES)
def test_a_folder_in_the_place_of_the_file_is_refused_before_the_work(name, tmp_path, capsys):
    with pytest.raises(SystemExit, match='2'):
        main_of(name)(['--out', str(tmp_path)])
    assert f'--out {tmp_path} is a folder: name a file' in capsys.readouterr().err
    (tmp_path / 'file').write_text('mine')
    with pytest.raises(SystemExit, match='2'):
        main_of(name)(['--out', str(tmp_path / 'file' / 'below')])
    assert f'cannot write to {tmp_path}/file' in capsys.readouterr().err


def test_folders_are_made(tmp_path):
    parser = argparse.ArgumentParser()
    assert output.make_folder(parser, tmp_path / 'a' / 'b').is_dir()
    assert not list((tmp_path / 'a' / 'b').iterdir())
    assert output.make_room(parser, tmp_path / 'c' / 'file').parent.is_dir()
    assert not list((tmp_path / 'c').iterdir())


@pytest.mark.parametrize('low, high, text, wanted', [
    (1.0, 4.0, '4', 4.0), (0, 9, '9', 9), (1.0, 4.0, '4.1', None), (0, 9, '-1', None),
    (1.0, 4.0, 'nan', None), (0, 9, '1.5', None),
    (1, None, '7', 7), (1, None, '0', None)])
def test_numbers_within(low, high, text, wanted, capsys):
    """Both ends are accepted; what is outside, or not whole where it must be, is refused."""
    parser = argparse.ArgumentParser()
    parser.add_argument('--rate', type=arguments.within(low, high))
    if wanted is not None:
        found = parser.parse_args(['--rate', text]).rate
        assert found == wanted and type(found) is type(wanted)
        return
    with pytest.raises(SystemExit):
        parser.parse_args(['--rate', text])
    assert 'argument --rate: ' in capsys.readouterr().err
