# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of public reports, replayed: which model and which other engine passes which."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from box_contact_ros.core import native
from box_contact_ros.solver.models import models_with_patch

from . import output
from .contestant import ours, packages_of
from .engines import installed
from .named_failures import NamedFailure, load, replay_apart


def reports_table(failures: Mapping[str, NamedFailure]) -> str:
    """Return what was reported, with the thread."""
    return output.markdown_table(
        ['', 'Report', 'What happened'],
        [[place, f'[{one.repo.partition("/")[2]} {one.number}]({one.link})'
          f'{"*" if one.source.startswith("nearest") else ""}', one.report]
         for place, one in enumerate(failures.values(), start=1)],
        words=3)


def passes_table(found: Mapping[str, Mapping[str, str]]) -> str:
    """Return who passes all, and a row for each other contestant: its faults by letter."""
    rows, passed = [], []
    for name, faults in found.items():
        failed: dict[str, list[int]] = {}
        for place, text in enumerate(faults.values(), start=1):
            if text:
                failed.setdefault(_letter(text), []).append(place)
        if failed:
            rows.append([name, '; '.join(f'{letter} {", ".join(map(str, places))}'
                                         for letter, places in failed.items()),
                         sum(not text for text in faults.values())])
        else:
            passed.append(name)
    count = len(next(iter(found.values())))
    table = output.markdown_table(['Model or engine', 'Faults', f'Passed of {count}'], rows,
                                  words=2)
    return f'All {count} pass with: {"; ".join(passed)}.\n\n{table}'


def _letter(text: str) -> str:
    if 'along' in text:
        return 'N'
    return {'missed': 'M', 'invented': 'I', 'depth': 'D', 'point': 'P', 'raised': 'E'}.get(
        text.partition(' ')[0], 'A')


def write_named(folder: Path, command: str, models: Sequence[str]) -> int:
    """Replay all for models and every other engine, print, write; 1 if a gated model fails one."""
    failures = load()
    rivals, missing = installed()
    engines = [*map(ours, models), *rivals]
    found = {engine.name: replay_apart(engine, failures) for engine in engines}
    text = output.page(
        'benchmarks/pages/named_failures', command=command,
        machine=output.machine(native, packages_of(engines)), reports=reports_table(failures),
        passes=passes_table(found), skipped=''.join(f'\n\nLeft out: {line}.' for line in missing))
    print(text)
    for name, faults in found.items():
        for one, fault in faults.items():
            if fault:
                print(f'{name}, {one}: {fault}')
    (folder / 'named_failures.md').write_text(text, encoding='utf-8')
    return int(any(text for model in models_with_patch() for text in found[model].values()))
