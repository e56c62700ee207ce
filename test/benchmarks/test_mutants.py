# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The list of mutants is of this code; trying them takes long: docs/contributing/testing.md."""

import mutants
import pytest


@pytest.mark.parametrize('name', mutants.MUTANTS)
def test_a_mutant_is_of_a_line_that_is_there(name):
    mutant = mutants.MUTANTS[name]
    text = (mutants.ROOT / 'box_contact_ros' / mutant.file).read_text('utf-8')
    assert mutant.old in text
    assert text.replace(mutant.old, mutant.new) != text
    assert (mutants.ROOT / mutant.tests.split()[0]).is_file()
