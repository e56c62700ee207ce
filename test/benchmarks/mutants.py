# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Do the laws bite? Each mutant is one wrong line; a test has to fail for it.

    python test/benchmarks/mutants.py [NAME ...]

Each mutant is a copy of the checkout with one line changed. If the line belongs to the core, the
core is compiled in the copy, for the baseline instruction set only. Prints which test killed which
mutant; the exit status is 1 if one survived.
"""
from __future__ import annotations

import argparse
import functools
import os
import re
import runpy
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest import mock

ROOT = Path(__file__).resolve().parents[2]


class Mutant(NamedTuple):
    """What is replaced in which file, and the tests that should notice."""

    file: str
    old: str
    new: str
    tests: str


FAMILIES = 'test/benchmarks/test_hard_poses.py'
LAWS = 'test/core/test_laws.py'
FUZZ = 'test/benchmarks/test_fuzz.py'
TEST_TRAINING_MLP = 'test/training/test_training_mlp.py'
MLP_MODEL = 'core/src/mlp/mlp_model.hpp'
UPPER_FACES = 'core/src/columns/upper_faces.hpp'
LOWER_FACE = 'core/src/columns/lower_face.hpp'
CONTACT_FRAME = 'core/src/columns/contact_frame.hpp'
EVALUATOR = 'node/evaluator.py'
BYTES = 'node/message_bytes.py'
MESSAGES = 'node/messages.py'
NODE = 'node/contact_node.py'
FILES = 'node/named_files.py'
STRANGERS = 'test/node/test_strangers.py'
ATTACKS = 'test/node/test_attacks.py'
TEST_BYTES = 'test/node/test_message_bytes.py'
TOPICS = 'node/topics/scene_topics.py'
TEST_PAIRING = 'test/scene/test_stamp_pairing.py'
FIRST_RUN = 'test/node/test_first_run.py'
TEST_SCENE_NODE = 'test/node/test_scene_node.py'
TF = 'node/topics/tf_poses.py'
TEST_TF = 'test/node/test_tf_poses.py'
TEST_CORE = 'test/core/test_core.py'
EXACT = 'test/core/test_exact.py'
LAW = 'core/src/force/patch_law.hpp'
STIFFNESS = 'core/src/force/stiffness.hpp'
CONSTANTS = 'core/src/force/constants.hpp'
TEST_LAW = 'test/scene/test_force_laws.py'
PAIR_WRENCHES = 'scene/force/pair_wrenches.py'
TEST_PAIR_WRENCHES = 'test/scene/test_pair_wrenches.py'
TEST_WRENCH = 'test/node/test_wrench.py'
MUTANTS = {
    'mean velocities taken for those of now': Mutant(
        PAIR_WRENCHES, 'LATE = 0.5', 'LATE = 0.0', f'{TEST_PAIR_WRENCHES} -k rest'),
    'friction of before a gap': Mutant(
        PAIR_WRENCHES, 'law.reset()  # friction', 'pass  # friction',
        f'{TEST_PAIR_WRENCHES} -k gap'),
    'wrenches of before time went back': Mutant(
        EVALUATOR, 'if self._times != self.counts[RESETS]:', 'if False:',
        f'{TEST_WRENCH} -k goes_back'),
    'bytes of a wrench out of place': Mutant(
        BYTES, 'wrench[body:-48]', 'wrench[body:-40]', f'{TEST_BYTES} -k alike'),
    'wrenches of a model without patches': Mutant(
        'node/wrench_output.py', 'if not solver.gives_patch:', 'if False:',
        f'{TEST_WRENCH} -k remedy'),
    'half a covariance': Mutant(
        MESSAGES, 'covariance[_UPPER] = covariance.T[_UPPER] = [', 'covariance[_UPPER] = [',
        f'{TEST_WRENCH} -k by_pair'),
    'normal flipped': Mutant(
        'core/src/separating_axis.hpp', 'select<T>(along >= 0.0, splat<T>(1.0), splat<T>(-1.0));',
        'select<T>(along >= 0.0, splat<T>(-1.0), splat<T>(1.0));', f'{FAMILIES} -k gates'),
    'largest gap taken for that of the axis': Mutant(
        'core/src/separating_axis.hpp', 'largest_gap = max(largest_gap, candidate_gap);',
        'largest_gap = gap;', f'{LAWS} -k swap'),
    'float32 too early': Mutant(
        'core/src/poses.hpp', 'Vec<T> t = b.position - a.position;',
        'Vec<T> t = b.position - a.position; t[2] = t[2] * 0x20000001p0 - '
        '(t[2] * 0x20000001p0 - t[2]);', f'{FAMILIES} -k gates'),
    'frame of A for all edge axes': Mutant(
        'core/src/separating_axis.hpp',
        'BC_INLINE SeparatingAxis<T> separating_axis(const Pair<T>& pair) {',
        'inline SeparatingAxis<T> separating_axis(Pair<T> pair) { pair.a_first = T{} == T{};',
        f'{FAMILIES} -k swap'),
    'near-parallel edges left as they are': Mutant(
        'core/src/contact.hpp', '  if (any(doubtful)) {', '  if (false) {',
        f'{FAMILIES} -k edges_along_each_other'),
    'frame of A for near-parallel edges': Mutant(
        'core/src/contact.hpp', 'refine(lane(q.pair, i), one_a, one_b, one);',
        'Pair<double> it = lane(q.pair, i); it.a_first = true; refine(it, one_a, one_b, one);',
        f'{LAWS} -k swap_of_grazing'),
    'sums of two doubles not exact': Mutant(
        'core/src/near_parallel_edges.hpp',
        'return {s, (a - (s - c)) + (b - c)};', 'return {s, 0.0};',
        f'{FAMILIES} -k gates'),
    'quaternions not scaled for 32 digits': Mutant(
        'core/src/near_parallel_edges.hpp', 'q[k] = std::ldexp(q[k], -exponent);',
        'q[k] = std::ldexp(q[k], 0);', f'{LAWS} -k any_length'),
    'quaternion taken for a unit one': Mutant(
        'core/src/poses.hpp', 'T s = 2.0 / (', 'T s = 2.0 + 0.0 * (',
        f'{FUZZ} -k gates_are'),
    'the first of concentric boxes is A': Mutant(
        'core/src/poses.hpp',
        '  if (any(concentric)) {', '  if (false) {', f'{LAWS} -k concentric'),
    'corners pressed along one axis': Mutant(
        'core/src/contact.hpp', 'if (pressed) enforce_on_further_axes(pair);',
        'if (false) enforce_on_further_axes(pair);',
        f'{EXACT} -k in_a_point'),
    'absolute tolerance': Mutant(
        'core/src/minimum_depth.hpp', 'max(depth_floor * pair.size + axis.separation, T{});',
        'max(depth_floor + axis.separation, T{});', f'{FAMILIES} -k scale'),
    'one face for every centroid': Mutant(
        'core/src/overlap/clipping.hpp', '  if (kept < cancelled) {', '  if (false) {',
        f'{FAMILIES} -k thin_plates'),
    'contact plane not clipped': Mutant(
        'core/src/overlap/clipping.hpp', 'double bounds[5] = {0.0,', 'double bounds[5] = {1e300,',
        f'{FAMILIES} -k exact_point'),
    'a face in the far face counts twice': Mutant(
        'core/src/overlap/clipping.hpp', '    if (high > floor) visit(', '    if (true) visit(',
        f'{EXACT} -k clipping'),
    'no certificate': Mutant(
        'core/src/overlap/face_sums.hpp',
        'certificate(x_n, normal, area, length, volume, radius, wedge, pair.size, depth)',
        '(volume == volume)', f'{EXACT} -k "thin and sharing"'),
    'pieces far outside the overlap trusted': Mutant(
        'core/src/overlap/face_sums.hpp', '(farthest2 <= reach * reach) | (wedge == 0);',
        '(farthest2 == farthest2) | (wedge == 0);',
        f'{EXACT} -k far_outside'),
    'second moments from A alone': Mutant(
        'core/src/overlap/face_sums.hpp', '(of_a.second + rotated(r, of_b.second))', 'of_a.second',
        f'{EXACT} -k through_each_other'),
    "middles for the edges' pieces": Mutant(
        'core/src/overlap/face_sums.hpp',
        '+ (1.0 / 12.0) * by_sign<T, Side::sigma>(w_ll).sum();', ';',
        f'{LAWS} -k of_the_parts'),
    'second moments not divided by the volume': Mutant(
        'core/src/overlap/face_sums.hpp', '(0.05 * by_volume) *', '(T{} + 0.05) *',
        f'{LAWS} -k powers_of_two'),
    "covariance left in A's frame": Mutant(
        'core/src/overlap/face_sums.hpp', 'rotated(pair.axes_a, covariance);', 'covariance;',
        f'{LAWS} -k rigid_motion'),
    "covariance left in the first box's frame": Mutant(
        'core/src/contact.hpp', 'select<T>(a_first, pair.axes_a[i][j], pair.axes_b[i][j]);',
        'pair.axes_a[i][j];', f'{LAWS} -k test_swap'),
    "clipped covariance left in the reference box's frame": Mutant(
        'core/src/overlap/clipping.hpp', 'rotated(pair.axes_b, covariance)}', 'covariance}',
        f'{EXACT} -k clipping_is'),
    'covariance of the other sign': Mutant(
        'core/src/contact.hpp', 'c = overlap.covariance;',
        'c = splat<T>(-1.0) * overlap.covariance;',
        f'{LAWS} -k positive'),
    'covariance not symmetric': Mutant(
        'core/src/overlap/moments.hpp', '{s(1, 0), s(1, 1)', '{-s(1, 0), s(1, 1)',
        f'{LAWS} -k positive'),
    'volume of the unpressed overlap': Mutant(
        'core/src/minimum_depth.hpp',
        'T distance = max(depth_floor * pair.size + axis.separation, T{});', 'T distance{};',
        f'{EXACT} -k pressed_volume'),
    'volume by its magnitude of the wrong part': Mutant(
        'core/src/contact.hpp', 'volume[1] = {overlap.volume};',
        'volume[1] = {overlap.volume * (1.0 + 0.1 * q.axis.separation)};',
        f'{LAWS} -k of_the_parts'),
    'volume that shrinks with the depth': Mutant(
        'core/src/contact.hpp', 'volume[1] = {overlap.volume};',
        'volume[1] = {1.0 / overlap.volume};', f'{LAWS} -k grows_with_the_depth'),
    'patch of a model that gives none': Mutant(
        'core/src/contact.hpp', 'T unknown = splat<T>(not_a_number);',
        'T unknown{};', f'{TEST_CORE} -k point_alone'),
    'faces not moved out of each other': Mutant(
        'core/src/overlap/face_sums.hpp', 'Mask<T> risky = unflush(pair, depth);',
        'Mask<T> risky = depth != depth;', f'{TEST_CORE} -k flush'),
    'mirrored rounding trusted': Mutant(
        'core/src/overlap/face_sums.hpp', 'certain &= risky == 0;', '',
        f'{EXACT} -k almost_aligned'),
    'face sums in the order of the names': Mutant(
        'core/src/contact.hpp', 'Mask<T> certain =',
        'pair.a_first = T{} == T{}; Mask<T> certain =',
        f'{LAWS} -k roundings'),
    'a piece of an edge of length below zero': Mutant(
        'core/src/overlap/face_sums.hpp',
        'Four<T> length = max(t - s, Four<T>{}), middle = 0.5 * (s + t) - origin[j];',
        'Four<T> length = t - s, middle = 0.5 * (s + t) - origin[j];',
        f'{TEST_CORE} -k certain'),
    # What model `mlp` guarantees.
    'brackets however far apart': Mutant(
        MLP_MODEL, '(bracket <= bracket_limit * volume)', '(bracket <= volume)',
        f'{FUZZ} -k garbage'),
    'second moments however far apart': Mutant(
        MLP_MODEL, '(spread <= spread_limit * volume * sum(moments.variance))',
        '(spread == spread)', f'{TEST_TRAINING_MLP} -k beyond'),
    'a network beyond its brackets': Mutant(
        'core/src/mlp/network.hpp', 'min(splat<F>(3.0F), max(splat<F>(-3.0F), sum))', 'sum',
        f'{FUZZ} -k garbage'),
    'a side face leaves all but its share of the extent': Mutant(
        UPPER_FACES, 'least_in - (one - inside * (inside * inside))', 'least_in - share',
        f'{FUZZ} -k gates_are'),
    'upper faces that cut little are not looked at': Mutant(
        MLP_MODEL, 'upper_least = 1e-6F', 'upper_least = 1e-2F', f'{FUZZ} -k gates_are'),
    'pieces for the terms whose differences they are': Mutant(
        LOWER_FACE, 'abs(by_length) * reach(from, to)', 'abs(by_length) * length',
        f'{FUZZ} -k gates_are'),
    'a variance below zero': Mutant(
        MLP_MODEL, ' & (moments.variance[k] > F{});', ';', f'{FUZZ} -k variance'),
    'columns pressed along another face': Mutant(
        CONTACT_FRAME, 'upright > least_upright', 'upright == upright', f'{FUZZ} -k gates_are'),
    'covariance in mirrored coordinates': Mutant(
        MLP_MODEL, '(rotated(sign) * rotated_back(sign)) *', 'uniform(splat<T>(1.0)) *',
        f'{TEST_TRAINING_MLP} -k errors_are'),
    'threads overlap': Mutant(
        'core/src/library/solver.hpp', 'long begin = chunk * rows_per_chunk,',
        'long begin = std::max(0L, chunk * rows_per_chunk - 8),',
        f'{TEST_CORE} -k threads'),
    'lanes that repeat the last row are counted': Mutant(
        'core/src/contact.hpp', 'set_lane(q.touching, int(i), 0);', ';',
        f'{TEST_CORE} -k threads_change'),
    'rows that wait are forgotten': Mutant(
        'core/src/contact.hpp', 'if (!count) return;', 'return;',
        f'{TEST_CORE} -k single_calls'),
    'a reference to the type is kept': Mutant(
        'core/binding/module.cpp', '  Py_DECREF(type);', '  ', f'{TEST_CORE} -k references'),
    'the forced instruction set is ignored': Mutant(
        'core/src/library/library.cpp', 'if (!forced || !*forced) return', 'return',
        f'{TEST_CORE} -k instruction_set_is'),
    # Guards of the nodes against faults.
    'weights taken as they are': Mutant(
        'solver/weights_file.py', "if tensors_digest(tensors) != card['sha256']:", 'if False:',
        'test/solver/test_weights_file.py -k edited_byte'),
    'an error ends the callback': Mutant(
        EVALUATOR, 'except Exception as error:', 'except KeyError as error:',
        'test/node/test_contact_node.py -k error_inside'),
    'length of a message not checked': Mutant(
        BYTES, 'if not 0 <= len(data) - (at + _POSE.size) <= _PADDING:', 'if False:',
        f'{TEST_BYTES} -k other_bytes'),
    'padding behind a message refused': Mutant(
        BYTES, '_PADDING = 3', '_PADDING = 0', f'{TEST_BYTES} -k leaves_open'),
    'a message of another type that begins alike': Mutant(
        BYTES, '_PADDING = 3', '_PADDING = 99', f'{TEST_BYTES} -k mutated'),
    'any encapsulation taken for plain CDR': Mutant(
        BYTES, '_ORDERS.get(data[:2])', "_ORDERS.get(data[:2], '<')",
        f'{TEST_BYTES} -k another_encapsulation'),
    'the wrong triangle of the covariance sent': Mutant(
        'node/message_bytes.py', 'square[32:48]', 'square[24:40]',
        f'{TEST_BYTES} -k written_alike'),
    'bounding boxes of before the margin': Mutant(
        'scene/scene_solver.py', 'np.minimum(self._size + margin, LENGTH_MAX)', 'self._size',
        'test/scene/test_scene.py -k close_pairs'),
    'the point in float32 alone': Mutant(
        MESSAGES, 'if found.keys().isdisjoint(_POINT):', 'if False:',
        f'{TEST_BYTES} -k older_cloud'),
    'no matter whether a cloud has the field': Mutant(
        MESSAGES, 'if name not in found:', 'if False:', f'{TEST_BYTES} -k wrong_field'),
    'bytes of a cloud not counted': Mutant(
        MESSAGES, 'if len(data) < count * message.point_step:', 'if False:',
        f'{TEST_BYTES} -k cut_short'),
    'a program ends with its callback': Mutant(
        'node/runtime.py', 'except Exception as error:\n                # A signal shuts',
        'except ZeroDivisionError as error:\n                # A signal shuts',
        'test/demo/test_callbacks.py -k raises'),
    'numbers of a pose not checked': Mutant(
        BYTES, 'and _LEAST < hypot(qx, qy, qz, qw) < _MOST):', '):',
        'test/node/test_faults.py -k half_of_the_poses'),
    'frames not compared': Mutant(
        EVALUATOR, 'elif pose.frame_id != frame_id:', 'elif False:',
        'test/node/test_contact_node.py -k frames_must'),
    'a stamp answered again': Mutant(
        'scene/stamp_pairing.py', 'if stamp in taken:', 'if False:',
        f'{TEST_PAIRING} -k answered_twice'),
    'the newest stamp held back': Mutant(
        'scene/stamp_pairing.py', 'elif stamp == state.newest:', 'elif False:',
        f'{TEST_PAIRING} -k stand_still'),
    'a short loop is refused for ever': Mutant(
        'scene/stamp_pairing.py', 'if len(held) < AGAIN:', 'if True:',
        f'{TEST_PAIRING} -k loop_shorter'),
    'late poses taken for a loop': Mutant(
        'scene/stamp_pairing.py', 'if stamp in state.taken:', 'if True:',
        f'{TEST_PAIRING} -k undisturbed'),
    'copies among newer poses taken for a loop': Mutant(
        'scene/stamp_pairing.py', '                self._refuse_held()\n        elif',
        '                pass\n        elif', f'{TEST_PAIRING} -k is_answered_twice'),
    'a tolerance of a whole period proposed': Mutant(
        'scene/stamp_pairing.py', 'int(0.5 * MARGIN * period)', 'int(MARGIN * period)',
        f'{TEST_PAIRING} -k proposed'),
    'one refusal hides another': Mutant(
        EVALUATOR, 'if kind not in self._refusals:', 'if not self._refusals:',
        f'{FIRST_RUN} -k hides_no_other'),
    'a slash in front ignored': Mutant(
        EVALUATOR, "if frame.lstrip('/') == odd.frame_id.lstrip('/')", 'if False',
        f'{FIRST_RUN} -k frames'),
    'a pair without answers is no error': Mutant(
        EVALUATOR, 'level=ERROR)', ')', f'{FIRST_RUN} -k zero'),
    'a box that never came is stale': Mutant(
        EVALUATOR, 'if box not in never]', ']', f'{FIRST_RUN} -k never_came'),
    'poses of another type are none': Mutant(
        TOPICS, "if offer.topic_type != f'geometry_msgs/msg/{wanted.__name__}':", 'if False:',
        f'{FIRST_RUN} -k never_came'),
    'nobody minds that poses have stopped': Mutant(
        EVALUATOR, 'if look.has_heard and 0 < max_age <= look.quiet:', 'if False:',
        f'{FIRST_RUN} -k stop'),
    'an inactive node is well': Mutant(
        'node/diagnostics.py', 'if state != ACTIVE:', 'if False:', f'{FIRST_RUN} -k state'),
    'time that goes back is late': Mutant(
        'scene/stamp_pairing.py', '(0 if self._deserted else RESET)',
        '(0 if self._deserted else 2**62)', f'{TEST_PAIRING} -k set_back'),
    'a restarted simulator is refused for ever': Mutant(
        'scene/stamp_pairing.py', '(0 if self._deserted else RESET)', 'RESET',
        f'{TEST_PAIRING} -k started_anew'),
    'a box whose publisher has gone has another clock': Mutant(
        EVALUATOR, 'if behind is None or not self._topics.is_heard(box):', 'if False:',
        f'{FIRST_RUN} -k falls_silent'),
    'a transform without a stamp is taken': Mutant(
        TF, 'if not at:', 'if False:', f'{TEST_TF} -k that_are_none'),
    'transforms of the time before are kept': Mutant(
        TF, 'self._buffer.clear()', 'pass', f'{TEST_TF} -k goes_back'),
    'a pose from /tf comes again': Mutant(
        TF, 'if stamp == self._given.get(box):', 'if False:', f'{TEST_TF} -k same_contacts'),
    'a static frame is looked up once': Mutant(
        TF, '# What was static may have another value now.\n        self._given', '_',
        f'{TEST_TF} -k always_current'),
    'an inactive node remembers static frames': Mutant(
        EVALUATOR, 'if not time_only:', 'if False:', f'{TEST_TF} -k state_change'),
    'a frame is kept when the scene has another': Mutant(
        'scene/stamp_pairing.py', 'and scene.frames.get(box) == self._scene.frames.get(box)', '',
        f'{TEST_TF} -k state_change'),
    'ticks wait for a fixed box': Mutant(
        'scene/stamp_pairing.py', 'if box not in self._fixed}', '}', f'{TEST_PAIRING} -k fixed'),
    'a box that moves again stays fixed': Mutant(
        'scene/stamp_pairing.py', 'del self._fixed[box]', 'pass', f'{TEST_PAIRING} -k again'),
    'a clock that jumps is not heard': Mutant(
        NODE, 'self.counts[RESETS] += 1\n            self._evaluator.reset(time_only=True)',
        'pass', 'test/node/test_faults.py -k clock'),
    'a pose of any age': Mutant(
        'scene/stamp_pairing.py',
        'state.last is None or 0 < self.max_age < abs(now - state.newest)',
        'state.last is None', f'{TEST_SCENE_NODE} -k different_rates'),
    'a silent box is waited for': Mutant(
        'scene/stamp_pairing.py', 'return since is not None and 0 < self.max_age < now - since',
        'return False', f'{TEST_SCENE_NODE} -k stale_box'),
    'ticks wait without bound': Mutant(
        'scene/stamp_pairing.py', 'tick.number + WAITING_TICKS < self._begun', 'False',
        f'{TEST_PAIRING} -k dropped'),
    'ticks that were answered do not count': Mutant(
        'scene/stamp_pairing.py', 'tick.number + WAITING_TICKS < self._begun',
        'len(self._waiting) > WAITING_TICKS and not over', f'{TEST_PAIRING} -k further_behind'),
    'a box that joins opens old ticks': Mutant(
        'scene/stamp_pairing.py', 'return stamp <= state.joined + self.tolerance or any(',
        'return any(',
        f'{TEST_PAIRING} -k joins'),
    'a scene that fails half way stays': Mutant(
        TOPICS, 'self._change(old)', 'pass',
        f'{TEST_SCENE_NODE} -k half_way'),
    "poses looked for on the node's own topics": Mutant(
        TOPICS, 'if self._resolved(topic) in taken:', 'if False:',
        f'{TEST_SCENE_NODE} -k topic_of_the_node'),
    'ticks held up by one that lacks a pose': Mutant(
        'scene/stamp_pairing.py', 'self._awaits_less |= not stale <= self._were_stale', 'pass',
        f'{TEST_PAIRING} -k hold_up'),
    'a tick answered again': Mutant(
        'scene/stamp_pairing.py', 'if self._is_too_late(state, stamp):', 'if False:',
        f'{TEST_PAIRING} -k answered_again'),
    'a change forgets what waits': Mutant(
        EVALUATOR, "if settings['pairing'] == old.get('pairing'):", 'if False:',
        f'{TEST_SCENE_NODE} -k come_and_go'),
    'a bad scene goes through': Mutant(
        'node/declared_parameters.py',
        'return SetParametersResult(successful=False, reason=reason_of(error))',
        'return SetParametersResult(successful=True)', f'{TEST_SCENE_NODE} -k bad_scene'),
    'nesting without limit': Mutant(
        'scene/files/scene_file.py', 'if depth > DEEPEST:', 'if False:',
        'test/scene/test_scene.py -k refusal_names'),
    'a file is quoted': Mutant(
        FILES, 'if starts or not files:', 'if True:', f'{STRANGERS} -k quoted'),
    'a refused file in /rosout': Mutant(
        FILES, "get_logger(f'{self._node.get_logger().name}.local').error(",
        'self._node.get_logger().error(',
        f'{STRANGERS} -k "quoted or transition"'),
    'files from anywhere': Mutant(
        'resources.py', 'if found in self._files or any(', 'if found.name or any(',
        f'{STRANGERS} -k open'),
    'a scene as text of any length': Mutant(
        FILES, '> LARGEST_TEXT:', '> 2**40:', f'{STRANGERS} -k texts'),
    'a request without an answer': Mutant(
        'node/runtime.py', 'service.callback = self.answered(', 'self.answered(',
        f'{ATTACKS} -k "rclpy_cannot_read or transitions"'),
    'a stranger may ask for as much as the owner': Mutant(
        FILES, "return OWN if settings['scene'] == self._scene else FOREIGN", 'return OWN',
        f'{ATTACKS} -k "files or texts"'),
    'a reason as long as what is refused': Mutant(
        'node/parameters.py', '[:LONGEST_REASON]', '', f'{STRANGERS} -k texts'),
    'a locked node takes parameters': Mutant(
        'node/declared_parameters.py', "if self.values.get('locked'):", 'if False:',
        f'{STRANGERS} -k locked'),
    'a locked node makes transitions': Mutant(
        NODE, 'refuse_transitions(self)', 'pass', f'{STRANGERS} -k locked'),
    'names of one checksum share an id': Mutant(
        'scene/files/short_forms.py', 'while key in taken:', 'while False:',
        'test/scene/test_short_forms.py -k one_checksum'),
    'intervals of a sweep not widened': Mutant(
        'core/binding/bounding_boxes.hpp', 'double margin = 2.0 * near * scale(box);',
        'double margin = 0.0;', 'test/scene/test_broad_phase.py -k boxes_that_are_near'),
    'a sweep answers in its own order': Mutant(
        'scene/scene_solver.py', 'np.sort(self._by_key[at[is_pair]])', 'self._by_key[at[is_pair]]',
        'test/scene/test_broad_phase.py -k answers_as'),
    'length of a pose array not checked': Mutant(
        BYTES, 'if not 0 <= len(data) - (at + count * _POSE.size) <= _PADDING:', 'if False:',
        f'{TEST_BYTES} -k no_pose_array'),
    'a pose array for any number of boxes': Mutant(
        EVALUATOR, 'if len(poses.numbers) != len(moving):', 'if False:',
        f'{TEST_SCENE_NODE} -k another_length'),
    'a bad pose of an array goes through': Mutant(
        EVALUATOR, 'poses.numbers[bad] = np.nan', 'pass', f'{TEST_SCENE_NODE} -k bad_pose'),
    'answers kept for whoever does not read': Mutant(
        'node/runtime.py', 'CONTACT_QOS = QoSProfile(depth=10,',
        'CONTACT_QOS = QoSProfile(history=2,', 'test/node/test_faults.py -k stops_reading'),
    'events of poses served': Mutant(
        TOPICS, 'self.events.watch(subscription)', 'pass', 'test/node/test_faults.py -k deadlines'),
    'events of contacts served': Mutant(
        TOPICS, 'self.events.watch(publisher)', 'pass', f'{TEST_SCENE_NODE} -k no_executor'),
    "events of pairs' contacts served": Mutant(
        TOPICS, 'PublisherEventCallbacks(use_default_callbacks=False)',
        'PublisherEventCallbacks()', 'test/node/test_faults.py -k topics_go'),
    'publishers gone by what is left': Mutant(
        'node/topics/qos_events.py', 'event.total_count_change - event.current_count_change',
        'max(0, -event.current_count_change)', f'{TEST_SCENE_NODE} -k come_and_go_between'),
    'the modulus rises at once': Mutant(
        LAW, 'patch.modulus = std::min(patch.modulus, borne);', 'patch.modulus = borne;',
        f'{TEST_LAW} -k rises_slowly'),
    'a point alone goes through': Mutant(
        'core/src/library/force.cpp', 'if (!is_positive(contact.volume) ||', 'if (false &&',
        f'{TEST_LAW} -k point_alone'),
    'the foundation pulls': Mutant(
        LAW, 'if (!(push > 0.0)) {', 'if (false) {', f'{TEST_LAW} -k never_pulls'),
    'rocking beyond what pressures can': Mutant(
        LAW, 'at_rim > least ? std::max(0.0, least) / at_rim : 1.0', '1.0',
        f'{TEST_LAW} -k fast_rocking'),
    'no area of a needle': Mutant(
        STIFFNESS, 'least_aspect = 1e-7', 'least_aspect = 0.0', f'{TEST_LAW} -k only_just_touches'),
    'a corner as stiff as a face': Mutant(
        STIFFNESS, 'normal.add(factor * shape.area, r);',
        'r[3] = r[4] = r[5] = 0.0; normal.add(factor * shape.area, r);', f'{TEST_LAW} -k softer'),
    'damping that vanishes with the load': Mutant(
        CONSTANTS, 'whole_damper_depth = 0.02', 'whole_damper_depth = 1.0',
        f'{TEST_LAW} -k damper_is_whole'),
    'no cap of the impulse': Mutant(
        LAW, 'push > 0.0 && push > limit', 'false', f'{TEST_LAW} -k impulse'),
    'a held patch that does not follow': Mutant(
        LAW, 'patch.volume + shape.area * relative.deeper', 'patch.volume',
        f'{TEST_LAW} -k contact_of_the_new_pose'),
    'a patch that stays where its carrier was': Mutant(
        LAW, 'if (!is_free(body) || both) found.point', 'if (both) found.point',
        f'{TEST_LAW} -k goes_with_what_carries'),
    'friction without memory': Mutant(
        LAW, 'u = u + relative.slid - dot(relative.slid, n) * n;',
        'u = relative.slid - dot(relative.slid, n) * n;', f'{TEST_LAW} -k holds_by_a_spring'),
    'a stiffer spring gains energy': Mutant(
        LAW, 'if (stiffness > patch.anchor_stiffness) {', 'if (false) {',
        f'{TEST_LAW} -k gains_no_energy'),
    'slip and spin have a limit each': Mutant(
        LAW, 'turn = torsion * torsion, both', 'turn = 0.0, both', f'{TEST_LAW} -k one_limit'),
    'the radius of gyration for that of friction': Mutant(
        STIFFNESS, 'radius * std::sqrt(spread),', 'std::sqrt(spread),',
        f'{TEST_LAW} -k coulombs_sum'),
    'a pair is known by its place': Mutant(
        LAW, 'const Patch* old = held(touch.pair);',
        'const Patch* old = next_.size() < patches_.size() ? &patches_[next_.size()] : nullptr;',
        f'{TEST_LAW} -k by_its_name'),
    'the turn of late is never forgotten': Mutant(
        LAW, '(1.0 - law_.forget) * patch.lean', 'patch.lean', f'{TEST_LAW} -k turn_of_late'),
    'dampers smaller than the step allows': Mutant(
        CONSTANTS, 'law.damping_ratio *= larger;', '', f'{TEST_LAW} -k step_allows'),
    'a limit surface without its dent': Mutant(
        STIFFNESS, 'dent_of_square = 0.45', 'dent_of_square = 0.0', f'{TEST_LAW} -k one_limit'),
    'two free bodies as stiff as one': Mutant(
        LAW, 'is_free(patch.b) ? 2.0 : 1.0', 'is_free(patch.b) ? 1.0 : 1.0',
        f'{TEST_LAW} -k half_the_modulus'),
    'no reaction': Mutant(
        LAW, 'add(found[patch.b], -1.0,', 'add(found[patch.b], 0.0,',
        f'{TEST_LAW} -k acts_back'),
    'a normal that cannot be meant goes through': Mutant(
        'core/src/library/force.cpp', 'return body.compound ||', 'return true ||',
        f'{TEST_LAW} -k cannot_be_meant'),
    'a held patch as soft as a held wrench': Mutant(
        CONSTANTS, 'patch_delay_limit = 2.0', 'patch_delay_limit = 0.45',
        f'{TEST_LAW} -k follow_the_loop'),
    'room in shared memory not asked for': Mutant(
        'cli.py', 'room < LEAST_ROOM', 'False', 'test/node/test_faults.py -k memory_is_full'),
    'little shared memory used': Mutant(
        'cli.py', 'room < USUAL_ROOM', 'False', 'test/node/test_faults.py -k almost_full'),
}


def copied(folder: Path) -> Path:
    """Copy the checkout, without what is generated but for the extensions."""
    copy = folder / 'checkout'
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(
        '.*', '__pycache__', 'build', 'install', 'log', '*.egg-info'))
    return copy


@functools.cache
def setup() -> SimpleNamespace:
    """Return what setup.py says of the core: flags, and the extension."""
    given: dict[str, Any] = {}
    with mock.patch('setuptools.setup', given.update):
        names = runpy.run_path(str(ROOT / 'setup.py'))
    extension, = (one for one in given['ext_modules'] if one.name == names['CORE_EXTENSION'])
    return SimpleNamespace(flags=names['FLAGS'], library=f'{names["CORE"]}/src/library',
                           extension=extension)


def build(checkout: Path) -> None:
    """Compile the core of a copy, for the baseline instruction set alone."""
    core = setup()
    folder = checkout / 'box_contact_ros' / 'core'
    for built in folder.glob('*.so'):
        built.unlink()
    folders = [f'-I{path}' for path in (sysconfig.get_path('include'),
                                        *core.extension.include_dirs)]
    sources = [*core.extension.sources,
               *(f'{core.library}/{name}.cpp' for name in ('kernel', 'library', 'force'))]
    # Half as long to compile with -O1. The bits are the same.
    subprocess.run(
        [*os.environ.get('CXX', 'g++').split(), '-shared', '-fPIC', '-DBOX_CONTACT_VERSION=""',
         *folders, *core.flags, '-O1', '-w', *sources,
         '-o', folder / f'_native{sysconfig.get_config_var("EXT_SUFFIX")}'],
        cwd=checkout, check=True)


def run(checkout: Path, tests: str) -> tuple[bool, str]:
    """Return whether tests pass, and the first that fails."""
    env = os.environ | {'PYTHONPATH': str(checkout)}
    words = [sys.executable, '-m', 'pytest', '-x', '-q', '-p', 'no:cacheprovider',
             *re.findall(r'"[^"]*"|\S+', tests)]
    done = subprocess.run([word.strip('"') for word in words], cwd=checkout, env=env, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    failed = re.search(r'^(?:FAILED|ERROR) (\S+)', done.stdout, re.MULTILINE)
    if done.returncode > 1 and not failed:
        raise RuntimeError(done.stdout)
    return done.returncode == 0, failed.group(1) if failed else 'the end of the process'


def killer_of(name: str) -> str | None:
    """Make a mutant and run its tests. Return the test that failed, or None if none did."""
    mutant = MUTANTS[name]
    with tempfile.TemporaryDirectory() as folder:
        checkout = copied(Path(folder))
        file = checkout / 'box_contact_ros' / mutant.file
        text = file.read_text()
        if mutant.old not in text:
            raise SystemExit(f'{name}: {mutant.file} has no {mutant.old!r}')
        file.write_text(text.replace(mutant.old, mutant.new))
        if file.suffix in ('.hpp', '.cpp'):
            build(checkout)
        passed, killer = run(checkout, mutant.tests)
    return None if passed else killer


def main() -> int:
    """Try the mutants named, or all."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('names', nargs='*', metavar='NAME', help=', '.join(MUTANTS))
    parser.add_argument('--jobs', type=int, default=1, help='mutants at a time (default: 1)')
    given = parser.parse_args()
    names = given.names or list(MUTANTS)
    setup()  # once, before there are threads
    survivors = []
    with ThreadPoolExecutor(given.jobs) as pool:
        for name, killer in zip(names, pool.map(killer_of, names), strict=True):
            print(f'{name:<45} {f"killed by {killer}" if killer else "SURVIVED"}', flush=True)
            if killer is None:
                survivors.append(name)
    print(f'{len(names) - len(survivors)} of {len(names)} killed')
    return 1 if survivors else 0


if __name__ == '__main__':
    sys.exit(main())
