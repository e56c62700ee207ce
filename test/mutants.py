"""Do the laws bite? Each mutant is one line of the package made wrong; a test has to fail for it.

    python test/mutants.py [NAME ...]

Every mutant is a copy of the checkout with kernels of its own, which are compiled anew: about a
minute each, so this is no part of the suite. Prints which test killed which mutant; the exit status
is 1 if one survived.
"""
from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]


class Mutant(NamedTuple):
    """What is replaced in which file, and the tests that should notice."""

    file: str
    old: str
    new: str
    tests: str


FAMILIES = 'test/test_families.py'
MUTANTS = {
    'normal flipped': Mutant(
        'sat.py', 's = 1.0 if along >= 0.0 else -1.0', 's = -1.0 if along >= 0.0 else 1.0',
        f'{FAMILIES} -k gates'),
    'axis dropped': Mutant(
        'sat.py', 'max(g6, max(g7, g8))', 'max(g6, g7)', f'{FAMILIES} -k gates'),
    'cross product not normalised': Mutant(
        'sat.py', 'inverse = 1.0 / math.sqrt(length2)', 'inverse = 1.0', f'{FAMILIES} -k gates'),
    "constant added to R's entries": Mutant(
        'sat.py', 'width = ((h1 * abs(u2) + h2 * abs(u1))',
        'width = ((h1 * (abs(u2) + 1e-6) + h2 * (abs(u1) + 1e-6))', f'{FAMILIES} -k gates'),
    'float32 too early': Mutant(
        'pose.py', 'tx, ty, tz = bx - ax, by - ay, bz - az',
        'tx, ty, tz = bx - ax, by - ay, np.float64(np.float32(bz - az))', f'{FAMILIES} -k gates'),
    'frame of A for all edge axes': Mutant(
        'sat.py', 'first = work[A_FIRST + i] > 0.5\n        t0', 'first = True\n        t0',
        f'{FAMILIES} -k swap'),
    'grazing edges left as they are': Mutant(
        'sat.py', '        if work[GRAZING + i] > 0.5:\n', '        if False:\n',
        f'{FAMILIES} -k edges_along_each_other'),
    'frame of A for grazing pairs': Mutant(
        'grazing.py', 'a_first = work[A_FIRST + i] > 0.5', 'a_first = True',
        'test/test_laws.py -k swap_of_grazing'),
    'corners pressed along one axis': Mutant(
        'exact.py', 'press_on(work, i)\n', 'pass\n', f'{FAMILIES} -k exact_touch'),
    'one face for every centroid': Mutant(
        'overlap.py', 'if kept < CANCELLED:', 'if False:', f'{FAMILIES} -k thin_plates'),
    'absolute tolerance': Mutant(
        'overlap.py', 'move = DEPTH_FLOOR * work[SIZE + i] + work[SEPARATION + i]',
        'move = DEPTH_FLOOR + work[SEPARATION + i]', f'{FAMILIES} -k scale'),
    'contact plane not clipped': Mutant(
        'overlap.py', 'count = _clip(work, one, 4, two, 2, 1.0, 0.0)',
        'count = _clip(work, one, 4, two, 2, 1.0, 1e300)', f'{FAMILIES} -k exact_point'),
    'quaternion taken for a unit one': Mutant(
        'pose.py', 's = 2.0 /', 's = 2.0 + 0.0 *', 'test/test_fuzz.py -k gates_are'),
    'point left outside': Mutant(
        'mlp.py', 'return max(0.0, room) / step if step > max(0.0, room) else 1.0',
        'return 1.0', 'test/test_mlp.py -k garbage_for_weights'),
    'smaller bounding box, always': Mutant(
        'outline.py', '_ALIKE = 0.2', '_ALIKE = 1e-6',
        'test/test_outline.py -k keep_their_frame'),
    'side of a couple of faces taken as it comes': Mutant(
        'sites.py', 'numbers[(STRENGTHS + f) * LANES + i] = abs(push)',
        'numbers[(STRENGTHS + f) * LANES + i] = push', 'test/test_mlp.py -k box_symmetries'),
    # Guards of the nodes against faults.
    'weights taken as they are': Mutant(
        'network.py', "if tensors_digest(tensors) != card['sha256']:", 'if False:',
        'test/test_network.py -k edited_byte'),
    'an error ends the callback': Mutant(
        'nodes/contact.py', 'except Exception as error:', 'except KeyError as error:',
        'test/test_contact_node.py -k error_inside'),
    'length of a message not checked': Mutant(
        'nodes/wire.py', 'if len(data) != at + _POSE.size:', 'if False:',
        'test/test_wire.py -k other_bytes'),
    'numbers of a pose not checked': Mutant(
        'nodes/wire.py', 'and _LEAST < hypot(qx, qy, qz, qw) < _MOST):', '):',
        'test/test_faults.py -k half_of_the_poses'),
    'frames not compared': Mutant(
        'nodes/contact.py', 'elif pose.frame_id != frame_id:', 'elif False:',
        'test/test_contact_node.py -k frames_must'),
    'a stamp answered again': Mutant(
        'pairing.py', 'if stamp in taken:', 'if False:',
        'test/test_scene_node.py -k repeated_and_late'),
    'time that goes back is late': Mutant(
        'pairing.py', 'if stamp < self._newest.get(box, NEVER) - RESET:', 'if False:',
        'test/test_pairing.py -k set_back'),
    'a clock that jumps is not heard': Mutant(
        'nodes/contact.py', 'self.counts[RESETS] += 1\n            self._pairing.reset()',
        'pass', 'test/test_faults.py -k clock'),
    'a pose of any age': Mutant(
        'pairing.py', 'return newest is None or 0 < self.max_age < abs(now - newest)',
        'return newest is None', 'test/test_scene_node.py -k different_rates'),
    'a silent box is waited for': Mutant(
        'pairing.py', 'return 0 < self.max_age < now - self._missing_since.get(box, now)',
        'return False', 'test/test_scene_node.py -k stale_box'),
    'ticks wait without bound': Mutant(
        'pairing.py', 'poses.number + WAITING_TICKS < self._begun', 'False',
        'test/test_pairing.py -k dropped'),
    'ticks that were answered do not count': Mutant(
        'pairing.py', 'poses.number + WAITING_TICKS < self._begun',
        'len(waiting) > WAITING_TICKS and not over', 'test/test_pairing.py -k further_behind'),
    'a box that joins opens old ticks': Mutant(
        'pairing.py', 'return stamp <= self._joined[box] + self.tolerance or any(', 'return any(',
        'test/test_pairing.py -k joins'),
    'a scene that fails half way stays': Mutant(
        'nodes/contact.py', 'self._take_over(old, old_settings)', 'pass',
        'test/test_scene_node.py -k half_way'),
    "poses looked for on the node's own topics": Mutant(
        'nodes/contact.py', 'if self._resolved(topic) in taken:', 'if False:',
        'test/test_scene_node.py -k topic_of_the_node'),
    'a face in the far face counts twice': Mutant(
        'overlap.py', '        if highest > floor:', '        if True:',
        'test/test_exact.py -k concentric'),
    'the first of concentric boxes is A': Mutant(
        'pose.py', 'if concentric > 0:', 'if False:',
        'test/test_laws.py -k concentric'),
    'ticks held up by one that lacks a pose': Mutant(
        'pairing.py', 'self._changed |= not stale <= self._were_stale', 'pass',
        'test/test_pairing.py -k hold_up'),
    'a tick answered again': Mutant(
        'pairing.py', 'if self._is_too_late(box, stamp):', 'if False:',
        'test/test_pairing.py -k answered_again'),
    'a change forgets what waits': Mutant(
        'nodes/contact.py', "if running and settings['pairing'] == old['pairing']:", 'if False:',
        'test/test_scene_node.py -k come_and_go'),
    'a bad scene goes through': Mutant(
        'nodes/contact.py', 'return SetParametersResult(successful=False, reason=_reason(error))',
        'return SetParametersResult(successful=True)', 'test/test_scene_node.py -k bad_scene'),
    'nesting without limit': Mutant(
        'scene_file.py', 'if depth > DEEPEST:', 'if False:', 'test/test_scene.py -k refusal_names'),
    'answers kept for whoever does not read': Mutant(
        'nodes/runtime.py', 'CONTACT_QOS = QoSProfile(depth=10,',
        'CONTACT_QOS = QoSProfile(history=2,', 'test/test_faults.py -k never_reads'),
    'events of poses served': Mutant(
        'nodes/contact.py', 'self._keep_events(subscription)',
        'self._events_of[subscription] = []', 'test/test_faults.py -k deadlines'),
    'events of contacts served': Mutant(
        'nodes/contact.py', 'self._keep_events(self._contacts)',
        'self._events_of[self._contacts] = []', 'test/test_faults.py -k topics_go'),
    "events of pairs' contacts served": Mutant(
        'nodes/contact.py', 'PublisherEventCallbacks(use_default_callbacks=False)',
        'PublisherEventCallbacks()', 'test/test_faults.py -k topics_go'),
    'publishers gone by what is left': Mutant(
        'nodes/contact.py', 'event.total_count_change - event.current_count_change',
        'max(0, -event.current_count_change)', 'test/test_scene_node.py -k come_and_go_between'),
    'room in shared memory not asked for': Mutant(
        'programs.py', 'room < LEAST_ROOM', 'False', 'test/test_faults.py -k memory_is_full'),
    'little shared memory used': Mutant(
        'programs.py', 'room < USUAL_ROOM', 'False', 'test/test_faults.py -k almost_full'),
}


def copied(folder: Path) -> Path:
    """The checkout without what is generated."""
    copy = folder / 'checkout'
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(
        '.*', '__pycache__', 'build', 'install', 'log', '*.egg-info'))
    return copy


def run(checkout: Path, tests: str) -> tuple[bool, str]:
    """Whether tests pass, and the first that fails."""
    env = os.environ | {'PYTHONPATH': str(checkout),
                        'NUMBA_CACHE_DIR': str(checkout.parent / 'kernels')}
    words = [sys.executable, '-m', 'pytest', '-x', '-q', '-p', 'no:cacheprovider',
             *re.findall(r'"[^"]*"|\S+', tests)]
    done = subprocess.run([word.strip('"') for word in words], cwd=checkout, env=env, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    failed = re.search(r'^(?:FAILED|ERROR) (\S+)', done.stdout, re.MULTILINE)
    if done.returncode > 1 and not failed:
        raise RuntimeError(done.stdout)
    return done.returncode == 0, failed.group(1) if failed else 'the end of the process'


def main() -> int:
    """Try the mutants named, or all."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('names', nargs='*', metavar='NAME', help=', '.join(MUTANTS))
    names = parser.parse_args().names or list(MUTANTS)
    survivors = []
    for name in names:
        mutant = MUTANTS[name]
        with tempfile.TemporaryDirectory() as folder:
            checkout = copied(Path(folder))
            file = checkout / 'box_contact_ros' / mutant.file
            text = file.read_text()
            if mutant.old not in text:
                raise SystemExit(f'{name}: {mutant.file} has no {mutant.old!r}')
            file.write_text(text.replace(mutant.old, mutant.new))
            passed, killer = run(checkout, mutant.tests)
        print(f'{name:<32} {"SURVIVED" if passed else "killed by " + killer}', flush=True)
        if passed:
            survivors.append(name)
    print(f'{len(names) - len(survivors)} of {len(names)} killed')
    return 1 if survivors else 0


if __name__ == '__main__':
    sys.exit(main())
