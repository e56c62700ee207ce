"""The page of public reports, replayed: which model and which other engine passes which."""
from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ... import output
from ...baselines.engines import installed
from ...baselines.engines.engine import Engine, ours, packages_of
from ...core import native
from ...solver.models import MODELS, gated_models
from ...verification.named_failures import NamedFailure, load, replay_apart


def contestants() -> tuple[list[Engine], list[str]]:
    """Return every model for boxes of any sizes and every other engine, and what is missing."""
    rivals, missing = installed()
    models = [ours(entry.full_name) for entry in MODELS.values() if entry.any_boxes]
    return [*models, *rivals], missing


def reports_table(failures: Mapping[str, NamedFailure]) -> str:
    """Return what was reported, with the thread, its numbers and the truth."""
    return output.markdown_table(
        ['', 'thread', 'reported', 'numbers from', 'separation'],
        [[place, f'[{one.repo} {one.number}]({one.link})', one.report, one.source,
          f'{one.separation:.4g}'] for place, one in enumerate(failures.values(), start=1)],
        words=4)


def passes_table(found: Mapping[str, Mapping[str, str]]) -> str:
    """Return a row a contestant: '·' for what it passes, else a letter."""
    places = [str(place + 1) for place in range(len(next(iter(found.values()))))]
    return output.markdown_table(
        ['', *places, 'passed'],
        [[name, *('·' if not text else _letter(text) for text in faults.values()),
          f'{sum(not text for text in faults.values())} of {len(faults)}']
         for name, faults in found.items()])


def _letter(text: str) -> str:
    return {'missed': 'M', 'invented': 'I', 'depth': 'D', 'point': 'P', 'raised': 'E'}.get(
        text.partition(' ')[0], 'A') if 'along' not in text else 'N'


def write_named(folder: Path, command: str) -> int:
    """Replay all, print, write named_failures.md; 1 if a gated model fails one."""
    failures = load()
    engines, missing = contestants()
    found = {engine.name: replay_apart(engine, failures) for engine in engines}
    place = {name: number for number, name in enumerate(failures, start=1)}
    text = output.page(
        'reports/pages/named_failures', command=command,
        machine=output.machine(native, packages_of(engines)), reports=reports_table(failures),
        passes=passes_table(found), skipped=''.join(f'\n\nLeft out: {line}.' for line in missing),
        faults='\n'.join(f'- {name}: {", ".join(wrong)}.' for name, faults in found.items()
                         if (wrong := [f'{place[one]} {text}' for one, text in faults.items()
                                       if text])))
    print(text)
    (folder / 'named_failures.md').write_text(text, encoding='utf-8')
    return int(any(text for model in gated_models() for text in found[model].values()))
