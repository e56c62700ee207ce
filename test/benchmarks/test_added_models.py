# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A model that is added to the registry is in the reports and in the programs' help."""
from __future__ import annotations

import pytest
from test_models import lifted

__all__ = ['lifted']


@pytest.mark.slow
def test_an_added_model_is_in_reports_and_programs(lifted, tmp_path, capsys):
    """None of them has a list of its own."""
    from benchmarks import frontier, fuzz, speed, stability

    assert 'lifted-1' in {engine.name for engine in frontier.contestants()[0]}
    assert 'lifted-1' in [timing.name for timing in speed.single_calls(10)]
    assert fuzz.main(['--pairs', '6', '--workers', '1']) in (0, 1)
    assert '\ncube            lifted-1' in capsys.readouterr().out
    assert stability.main(['--families', 'a4_ridges', '--out', str(tmp_path)]) in (0, 1)
    assert '## `lifted-1`' in (tmp_path / 'stability.md').read_text('utf-8')


@pytest.mark.slow
@pytest.mark.parametrize('module', [
    'reports.accuracy', 'reports.hard.stability', 'verification.fuzz', 'bench.bench'])
def test_programs_accept_an_added_model(lifted, module, capsys):
    main = pytest.importorskip(f'benchmarks.{module}').main
    with pytest.raises(SystemExit, match='0'):
        main(['--help'])
    assert 'lifted, lifted-N' in ' '.join(capsys.readouterr().out.split())
