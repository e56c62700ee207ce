# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments that several programs have in common."""
from __future__ import annotations

import argparse

import pytest

from box_contact_ros import arguments


@pytest.mark.parametrize('low, high, text, wanted', [
    (1.0, 4.0, '4', 4.0), (0, 9, '9', 9), (1.0, 4.0, '4.1', None), (0, 9, '-1', None),
    (1.0, 4.0, '1', 1.0), (0, 9, '0', 0), (1, None, '1', 1), (1.0, 4.0, '0.9', None),
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
