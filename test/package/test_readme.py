# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The README and docs/: every command in them works, every example prints what it says.

Commands are the lines of fenced `bash` blocks, and those after `$ ` in `console` blocks. Each must
match exactly one line of `COMMANDS`, whose check runs it, or a quick variant of it, or says what
can be checked where it cannot run (root, apt, an installed ROS). A command that nobody has thought
of fails.
"""
from __future__ import annotations

import contextlib
import inspect
import io
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from conftest import PROGRAMS
from geometry_msgs.msg import PoseStamped
from patience import PATIENCE
from test_library import INCLUDES, LINKED
from typed_messages import answered

from benchmarks import hard_poses
from box_contact_msgs.msg import Box
from box_contact_msgs.srv import Check
from box_contact_ros import PatchForces
from box_contact_ros.core import DEPTH_FLOOR
from box_contact_ros.models.make_model import most_near
from box_contact_ros.models.weights_file import load_weights
from box_contact_ros.node import check, check_path, diagnostics, topics
from box_contact_ros.node.check import CheckAnswerer
from box_contact_ros.node.parameters import CONTACT_PARAMETERS
from box_contact_ros.resources import resource_path
from box_contact_ros.scene import scene_check, scene_file
from box_contact_ros.scene.scene import two_boxes
from box_contact_ros.scene.scene_file import read_scene
from box_contact_ros.scene.scene_solver import SceneSolver
from box_contact_ros.stream import pairing

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*sorted(ROOT.glob('*.md'), key=lambda page: page.name != 'README.md'),
         *sorted((ROOT / 'docs').rglob('*.md'))]
FENCE = re.compile(r'^```([\w{}-]*)[^\n]*\n(.*?)^```$', re.MULTILINE | re.DOTALL)


def blocks(*languages: str) -> Iterator[tuple[Path, str, str]]:
    """Page, language and text of the fenced blocks."""
    for page in PAGES:
        for language, text in FENCE.findall(page.read_text('utf-8')):
            if language in languages:
                yield page, language, text


def commands() -> list[str]:
    """Every command once, continued lines joined, comments dropped."""
    found: dict[str, None] = {}
    for _, language, text in blocks('bash', 'console'):
        for line in text.replace('\\\n', ' ').splitlines():
            if language == 'console':
                if not line.startswith('$ '):
                    continue
                line = line[2:]
            line = ' '.join(line.partition(' #')[0].split())
            if line and not line.startswith('#'):
                found[line] = None
    return list(found)


# --- what is done with a command ------------------------------------------------------------------


def run(*words: str, **env: str) -> str:
    """Run a program of this Python's environment; its output. Fails unless the status is 0."""
    done = subprocess.run(words, cwd=ROOT, env=os.environ | env, text=True, timeout=PATIENCE,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == 0, f'{words}: {done.stdout}'
    return done.stdout


@cache
def help_of(*program: str) -> str:
    """Return what `python -m ... --help` prints."""
    return run(sys.executable, '-m', *program, '--help')


def make(words: list[str], **_) -> None:
    """Check that the targets exist: a dry run plans them."""
    env = {name: value for name, value in os.environ.items()
           if not name.startswith(('MAKE', 'MFLAGS'))}  # `make test` may be what runs this
    here = words[words.index('make') + 1:]
    done = subprocess.run(['make', '-n', *here], cwd=ROOT, env=env, capture_output=True,
                          text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    if here[0] == 'demo' and len(here) > 1:  # what ARGS hands on
        arguments = shlex.split(here[1].partition('=')[2])
        assert all(word in help_of('box_contact_ros.demo.demo')
                   for word in arguments if word.startswith('--'))


def program_and_arguments(words: list[str]) -> tuple[str, list[str]]:
    """Of either way to start a program."""
    if words[:3] == ['ros2', 'run', 'box_contact_ros']:
        return words[3], words[4:]
    return words[0].removeprefix('box_contact_'), words[1:]


def start(words: list[str], program, **_) -> None:
    """Check that a node starts and says 'ready', and that a crane is answered by one.

    Others know the options (their work takes minutes, and other tests do a little of it).
    """
    name, arguments = program_and_arguments(words)
    assert name in PROGRAMS
    if name == 'contact_node':
        program(name, *arguments).wait_for_output('ready')
    elif name == 'crane' and '--help' not in arguments:
        program('contact_node', '--ros-args', '-p', 'model:=exact').wait_for_output('ready')
        program(name, *arguments).wait_for_output('hanging')
    else:
        known = help_of(f'box_contact_ros.{PROGRAMS[name]}')
        for word in arguments:
            if word.startswith('--'):
                assert word in known


def module(words: list[str], **_) -> None:
    """Check that a module of the checkout knows the options."""
    known = help_of(words[2])
    assert all(word in known for word in words[3:] if word.startswith('--'))


def topic(words: list[str], **_) -> None:
    """Check that the topic is one of the contact node's."""
    document = yaml.safe_load(resource_path('msg_schemas', 'asyncapi.yaml').read_text('utf-8'))
    addresses = {channel['address'].removeprefix('/')
                 for channel in document['channels'].values()}
    assert words[3].removeprefix('/') in addresses


def echoed(words: list[str], **_) -> None:
    """Check the topic, which comes last."""
    topic(['', '', '', words[-1]])


def published(words: list[str], **_) -> None:
    """Check that the topic takes poses, and that the message is one."""
    topic(['', '', '', words[5]])
    pose, header = PoseStamped(), {'stamp': 'now', 'frame_id': 'map'}
    given = yaml.safe_load(words[7])
    assert words[6] == 'geometry_msgs/msg/PoseStamped' and given.pop('header') == header
    for part, values in given.pop('pose').items():
        for name, value in values.items():
            setattr(getattr(pose.pose, part), name, value)
    assert not given and pose.pose.orientation.w == 1.0


def called(words: list[str], **_) -> None:
    """Ask nodes of two cubes and of the yard: one answers that its boxes touch."""
    assert words[3:5] == ['/contact_node/check', 'box_contact_msgs/srv/Check']
    request = filled(Check.Request(), yaml.safe_load(words[5]))
    yard = read_scene(ROOT / 'config/scenes/yard_bay.yaml')
    scenes = [two_boxes((2.0, 2.0, 2.0), (2.0, 2.0, 2.0)), yard]
    responses = [answered(request, Check.Response(), CheckAnswerer(SceneSolver(scene)).answer)
                 for scene in scenes]
    assert sum(bool(response.contacts.contacts) for response in responses) >= 1, responses


def filled(message: Any, values: dict[str, Any]) -> Any:
    """Return a message with the values of a command; a list is of boxes."""
    for name, value in values.items():
        if isinstance(value, dict):
            filled(getattr(message, name), value)
        else:
            setattr(message, name, [filled(Box(), entry) for entry in value]
                    if isinstance(value, list) else value)
    return message


def parameter(words: list[str], **_) -> None:
    """`ros2 param set NODE NAME VALUE`: the node has it, and takes the value."""
    node, name, value = words[3:]
    assert node == '/contact_node'
    CONTACT_PARAMETERS[name].validate(name, yaml.safe_load(value))


def pip(words: list[str], setup_arguments, **_) -> None:
    """Names a checkout's existing extras, files that exist, or requirements of this package."""
    expected = 'file'
    for word in words[2:]:
        if word == '-c':
            expected = 'constraints'
        elif expected == 'constraints':
            assert (ROOT / word).is_file()
            expected = 'file'
        elif word.startswith('./'):
            assert (ROOT / word / 'pyproject.toml').is_file()
        elif word.startswith('.'):
            assert '-e' in words, 'without -e, the clone hides what was installed'
            extras = re.fullmatch(r'\.(?:\[([\w,]+)\])?', word).group(1)
            assert set(extras.split(',') if extras else ()) <= set(
                setup_arguments['extras_require'])
        elif not word.startswith('-'):
            assert word in [*setup_arguments['install_requires'], 'uv']  # which .ci/lock names


def rviz(words: list[str], **_) -> None:
    """Check that the config is one that is installed."""
    assert words[:2] == ['rviz2', '-d']
    assert resource_path(*words[-1].rpartition('box_contact_ros)/')[2].split('/')).is_file()


def launch(words: list[str], **_) -> None:
    """Check that the file exists and declares the arguments; `launch` has no wheel to run it."""
    assert words[2] == 'box_contact_ros'
    text = (ROOT / 'launch' / words[3]).read_text('utf-8')
    names = [word.partition(':=')[0] for word in words[4:]]
    assert all(f"'{name}'" in text or 'PARAMETERS' in text and name in CONTACT_PARAMETERS
               for name in names)


def elsewhere(words: list[str], **_) -> None:
    """Leave it to the tests that run it, or to who has ROS: files of the checkout exist."""
    for word in words:
        name = re.sub(r'^(box_contact_ros/(?=box_contact_msgs|docs|test)|-I|\w+=\$PWD/)', '', word)
        if re.match(r'(docs|test|config|\.ci|box_contact_\w+)/', name):
            assert (ROOT / name).exists(), name


COMMANDS = {
    r'\.ci/lock( --upgrade)?': elsewhere,
    r'(mkdir -p build|g\+\+|build/first|cmake|ln -s).*': elsewhere,
    r'(rosdep install|colcon|git subtree|ros2 run box_contact_examples) .+': elsewhere,
    r'(export|source|python3 -m venv) \S+': elsewhere,
    r'sudo apt install .+': elsewhere,
    r'python (docs/examples|test/helpers)/\w+\.py( /tmp/\w+)?': elsewhere,
    r'(cd box_contact_ros && )?make [\w-]+( .*)?': make,
    r'ros2 run box_contact_ros \w+( .*)?': start,
    r'python -m (benchmarks|training|box_contact_ros\.)[\w.]*( .*)?': module,
    r'box_contact_\w+( .*)?': start,
    r'ros2 topic echo (--\S+ (data )?)*/\S+': echoed,
    r'ros2 topic pub -r 10 .+': published,
    r'ros2 service call .+': called,
    r'ros2 param set \S+ \S+ \S+': parameter,
    r'ros2 launch \S+ \S+( .*)?': launch,
    r'rviz2 -d .+': rviz,
    r'pip install .+': pip,
}


@pytest.mark.parametrize('command', [
    pytest.param(command, marks=[pytest.mark.training] * bool(
        re.match(r'python -m (training|benchmarks\.paper\.search)\b', command)))
    for command in commands()])
def test_command(command, program, setup_arguments):
    matching = [check for pattern, check in COMMANDS.items() if re.fullmatch(pattern, command)]
    assert len(matching) == 1, f'no check, or several, for: {command}'
    matching[0](shlex.split(command), program=program, setup_arguments=setup_arguments)


FOREIGN = {'ros2: command not found', 'externally-managed-environment', 'ros2 topic pub',
           "cannot import name … from 'box_contact_ros' (unknown location)", 'Timeout (0:00:08)!',
           'librcl_action.so: cannot open shared object file', 'No executable found', 'python'}
"""What troubleshooting quotes of the shell, pip, Python, the loader and ROS."""


@cache
def sources() -> str:
    """Return the package's code with its strings joined, and without the names of values."""
    text = '\n'.join(path.read_text('utf-8') for kind in ('*.py', '*.cpp', '*.hpp')
                     for path in sorted((ROOT / 'box_contact_ros').rglob(kind)))
    return re.sub(r'\{[^{}]*\}', '…', re.sub(r"""['"]\s*\n\s*f?['"]""", '', text))


def quoted_messages() -> list[str]:
    """Return what two pages quote of the log, and of errors."""
    troubles = (ROOT / 'docs' / 'how-to' / 'troubleshooting.md').read_text('utf-8')
    found = [one or other for heading in re.findall(r'^[*]{2}(.+?)[*]{2}', troubles, re.M | re.S)
             for one, other in re.findall('`([^`]+)`|"([^"]+)"', heading)]
    lines = (ROOT / 'docs' / 'reference' / 'diagnostics.md').read_text('utf-8')
    said, keys, _ = lines.partition('The status also has values, by key:')
    assert keys
    found += re.findall('^- `([^`]+)`', said, re.M)
    return sorted(set(found) - FOREIGN)


@pytest.mark.parametrize('message', quoted_messages())
def test_quoted_messages_exist(message):
    """Each part between its values is in the source, so no page explains what nobody can see."""
    parts = re.split(r"…|; |: |\b[A-Z]+\b|\b(?:box_)?[ab]\b|'[\w/]+'|(?<= )/\w+|\b\d+ s\b", message)
    parts = [part.strip() for part in parts if len(part.strip(' ,')) > 2]
    assert parts and all(part in sources() for part in parts), parts


def test_the_pages_are_short():
    """At most 130 lines of README, and 18,500 words without the reports' results."""
    assert len((ROOT / 'README.md').read_text('utf-8').splitlines()) <= 130
    pages = [page for page in PAGES if page.parent == ROOT and page.name == 'README.md'
             or ROOT / 'docs' in page.parents and ROOT / 'docs' / 'results' not in page.parents]
    assert len(pages) > 40
    assert len((ROOT / 'README.md').read_text('utf-8').split()) <= 950
    assert sum(len(page.read_text('utf-8').split()) for page in pages) <= 18_500


# --- the rest of the pages ------------------------------------------------------------------------

def examples() -> Iterator[object]:
    """Yield the Python blocks with the lines that they print, and the page's nodes above them.

    A block of text right below says them, or the comments behind the prints.
    """
    for page in PAGES:
        text = page.read_text('utf-8')
        for number, found in enumerate(FENCE.finditer(text)):
            if found[1] == 'python':
                shown = re.match(r'\s*```text\n(.*?)^```$', text[found.end():],
                                 re.MULTILINE | re.DOTALL)
                lines = (shown[1].splitlines() if shown else
                         re.findall(r'^print\(.*\)  # (.*)$', found[2], re.MULTILINE))
                nodes = re.findall(r'^box_contact_contact_node(.*)$', text[:found.start()], re.M)
                yield pytest.param(found[2], lines, nodes, id=f'{page.name}-{number}')


@pytest.mark.parametrize(('text', 'lines', 'nodes'), list(examples()))
def test_python_example(text, lines, nodes, program, tmp_path, monkeypatch, request):
    """It runs, a client next to the node that its page starts last, and prints what it says."""
    monkeypatch.chdir(tmp_path)  # some write files
    if 'rclpy' in text:
        request.addfinalizer(rclpy.try_shutdown)  # some leave it to the end of their process
        arguments = shlex.split(nodes[-1]) if nodes else []
        program('contact_node', *arguments).wait_for_output('ready')
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(text, 'example', 'exec'), {'__name__': 'example'})
    assert printed.getvalue().splitlines() == lines


def test_the_table_of_programs_is_whole():
    text = (ROOT / 'docs' / 'reference' / 'programs.md').read_text('utf-8')
    assert set(re.findall(r'^\| `(\w+)` \|', text, re.M)) == set(PROGRAMS)


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    text = FENCE.sub('', page.read_text('utf-8'))
    return {re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-')
            for heading in re.findall(r'^#+ (.+)$', text, re.MULTILINE)}


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for link in re.findall(r'\]\(([^)\s]+)\)', FENCE.sub('', page.read_text('utf-8'))):
        if re.match(r'\w+:', link):
            continue
        path, _, anchor = link.partition('#')
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


def test_files_named_in_backticks_exist():
    """`docs/...`, `test/...` and `box_contact_ros/...` are paths of this repository."""
    for page in PAGES:
        for name in re.findall(r'`((?:docs|test|box_contact_ros|msg_schemas)/[\w./]+\.\w+)`',
                               page.read_text('utf-8')):
            assert (ROOT / name).is_file(), f'{page.name}: {name}'


@pytest.mark.reports
def test_figures_are_made(tmp_path):
    """The scripts draw all the figures there are; a browser takes the view's."""
    pytest.importorskip('matplotlib')
    pytest.importorskip('mujoco')
    folder = ROOT / 'docs' / 'figures'
    for script in ('make_figures.py', 'make_architecture.py'):
        run(sys.executable, str(folder / script), '--out', str(tmp_path), MPLBACKEND='Agg')
    assert {path.name for path in tmp_path.iterdir()} == {
        path.name for path in folder.iterdir() if path.suffix in ('.png', '.svg')} - {'view.png'}
    for name in ('architecture.svg', 'ros.svg'):
        assert (tmp_path / name).read_text() == (folder / name).read_text(), (
            'python docs/figures/make_architecture.py draws another')


def test_tables_have_the_figures_of_the_reports():
    """No number stands in two places with two values: `make tables` renews them."""
    assert run(sys.executable, 'docs/tables.py', '--check') == ''


def constant(file: str, name: str) -> str:
    """Return a constant of the core, as its source has it."""
    source = (ROOT / 'box_contact_ros' / 'core' / 'src' / file).read_text('utf-8')
    return re.search(rf'\b{name} = ([-\dxp.e]+)', source)[1].removesuffix('.0')


HARD = [len(cases.pairs.pose_a) for cases in hard_poses.load().values()]
LAYERS = [weights.shape for weights, _ in load_weights(
    ROOT / 'weights' / 'mlp.safetensors').networks['patch'].layers]
STEPS = inspect.signature(PatchForces).parameters
TUNING, AXIS = 'force/tuning.hpp', 'separating_axis.hpp'
SOFT, LATE, PARALLEL = (constant(file, name) for file, name in (
    (TUNING, 'soft_frequency'), (TUNING, 'late_frequency'), (AXIS, 'parallel')))
LENGTHS, QUATERNIONS = (
    ' to '.join(constant('poses.hpp', f'{what}_{end}') for end in ('min', 'max'))
    for what in ('length', 'quaternion'))
ITERATIONS = constant(TUNING, 'iterations')
HEADER = 'box_contact_ros/core/include/box_contact/box_contact.hpp'
CERTIFICATE = 'overlap/certificate.hpp'
ROUNDING = constant(CERTIFICATE, 'centroid_rounding')
LIMITS = {
    f'../{HEADER}': (
        f'up to {constant("poses.hpp", "contact_ulps")} ulp of the largest',
        f'max({constant(CERTIFICATE, "least_centroid_error")}, {ROUNDING} · size / depth) · size',
        f'max({constant(CERTIFICATE, "least_covariance_error")}, {ROUNDING} · size / depth) of the '
        'trace',
        f'shallower than {constant("minimum_depth.hpp", "depth_floor")} · size'),
    'contributing/decisions/patch-law.md': (
        f'Frequency of {SOFT}/window', f'Frequency of {LATE}/T',
        f'Damping ratio {constant(TUNING, "soft_damping_ratio")}',
        f'{STEPS["substeps"].default} sub-steps of {ITERATIONS} iterations'),
    'contributing/decisions/planes.md': (
        f'less than {constant("overlap/planes.hpp", "flush_limit")} of the overlap',),
    'contributing/testing.md': (f'{sum(HARD):,} cases in {len(HARD)} families',),
    'explanation/force.md': (
        f'{1e3 * float(constant(TUNING, "sub_step_limit")):g} ms at most',
        f'{constant("force/rectangle.hpp", "torsion_share")} times the mean',
        f'up to {constant(TUNING, "finest")} times as many sub-steps',
        f'grown by {constant(TUNING, "gap_share")}·g·dt²',
        f'slower than {1e3 * float(constant(TUNING, "sleep_speed")):g} mm/s',
        f'the frequency {SOFT}/window', f'{float(SOFT) ** -2:.1f}·g·h² deep',
        f'g·T²/{float(LATE) ** 2}',
        f'older than {constant(TUNING, "overdue_periods")} periods'),
    'explanation/mlp.md': (
        f'reads {LAYERS[0][1]} features',
        f'two hidden layers of {LAYERS[1][0]} rectified units, a linear path beside them, and '
        f'{LAYERS[-1][0]} outputs'),
    'explanation/separating_axis.md': (
        f'shorter than {PARALLEL} are skipped',),
    'how-to/security.md': (
        f'{scene_check.MOST_BOXES} boxes, {scene_check.MOST_PAIRS:,} listed pairs, '
        f'{most_near("exact"):,} near, {check.MOST_CONTACTS:,} contacts',
        f'{check_path.MOST_WAYPOINTS:,} times, {check_path.MOST_POSES:,} transforms, '
        f'{scene_check.MOST_ON_PATH:,} boxes at times; {scene_check.MOST_PAIRS:,} pairs',
        f'{scene_check.MOST_LOOKS:,} looks at pairs'),
    'reference/conventions.md': (
        f'more than {most_near("exact"):,} pairs near each other, of a soup {most_near("soup-8")}',
        f'δ = 1e{math.log10(DEPTH_FLOOR):.0f} · size',
        f'separation ≤ {constant("poses.hpp", "contact_ulps")} ulp',
        f'2⁻⁴⁶ ({float.fromhex(constant(AXIS, "tie")):.1e})',
        f'closer to parallel than {PARALLEL} rad',
        f'outside {LENGTHS} m', f'length is from {QUATERNIONS}'),
    'reference/diagnostics.md': (
        f'every {diagnostics.REMINDER_SECONDS:g} s',
        f'`unanswered for {diagnostics.UNANSWERED_SECONDS:g} s: PAIRS`',
        f'last {diagnostics.NEWEST_ANSWERS} answers are more than {diagnostics.LATE_TICKS:g} tick'),
    'reference/messages.md': (f'at most {most_near("soup-8")} pairs',),
    'reference/scenes.md': (
        f'At most {scene_file.MOST_STREAMS:,} boxes and bodies may have a topic',
        f'More than {topics.MOST_PAIRS_WITH_TOPICS:,} pairs need `pair_topics:=false`',
        f'for {pairing.PATIENCE} later ticks'),
}
"""What pages and the C++ header say of limits and constants of the code, by paths from docs/."""


def words_of(page: str) -> str:
    """Return the text of a page, by its path from docs/, in one line."""
    return ' '.join((ROOT / 'docs' / page).read_text('utf-8').split())


@pytest.mark.parametrize('page', sorted(LIMITS))
def test_pages_name_the_limits_of_the_code(page):
    assert [text for text in LIMITS[page] if text not in words_of(page)] == []


def test_cpp_examples(tmp_path):
    """They compile, as one program to save time, and print what the comments say."""
    if not shutil.which('g++'):
        pytest.skip('g++ is not installed')
    texts = [text for _, _, text in blocks('cpp')]
    names = [f'example_{number}' for number in range(len(texts))]
    program = [text.replace('int main()', f'int {name}()', 1).rstrip().removesuffix('}')
               + '  return 0;\n}' for name, text in zip(names, texts)]
    calls = ' '.join(f'{name}();' for name in names)
    (tmp_path / 'examples.cpp').write_text('\n'.join([*program, f'int main() {{ {calls} }}']))
    run('g++', '-std=c++17', INCLUDES, str(tmp_path / 'examples.cpp'), *LINKED,
        '-o', str(tmp_path / 'examples'))
    assert run(str(tmp_path / 'examples')).splitlines() == [
        line for text in texts
        for line in re.findall(r'printf\(.*\);  // (.*)$', text, re.MULTILINE)]


@pytest.mark.reports
def test_pages_build_without_a_warning(tmp_path):
    """`make docs`: every page is in a table of contents, and every link and reference leads on."""
    pytest.importorskip('myst_parser')
    pytest.importorskip('sphinx_rtd_theme')
    run(sys.executable, '-m', 'sphinx', '-q', '-W', '--keep-going', '-b', 'html', 'docs',
        str(tmp_path))
    assert 'Return the contacts of n pairs' in (
        tmp_path / 'reference' / 'python_api.html').read_text('utf-8')
    first = (tmp_path / 'index.html').read_text('utf-8')
    assert 'My crane sets loads down' in first and 'pallets.png' in first  # the README's
    browser = pytest.importorskip('browser', reason='needs websockets', exc_type=ImportError)
    if browser.chromium() is None:
        pytest.skip('Chromium is not installed')
    with browser.open_page((tmp_path / 'index.html').as_uri(), width=800) as tab:
        wide = "document.querySelector('[itemprop=articleBody]')?.clientWidth"
        assert tab.wait_for(wide) >= 640
