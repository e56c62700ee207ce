// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Loads of boxes: the corners of their faces, and what the pads of two bodies share.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "../faces/pads.hpp"
#include "patch.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

inline void write(const Pad& pad, bc_load& load) {
  auto corners = pad.faces.rectangle();
  auto shares = corner_shares(corners, pad.faces.flat(pad.centre - pad.faces.origin));
  load.pressing = pad.pressing;
  std::copy_n(pad.centre.v, 3, load.centre);
  for (size_t c = 0; c < 4; ++c) {
    load.corner_loads[c] = shares[c] * load.pressing;
    std::copy_n(pad.faces.level(corners[c]).v, 3, load.corners[c]);
  }
}

// Memory that calls use again.
struct LoadsRoom {
  std::vector<Load> all;
  std::vector<Pad> pads;
  std::vector<std::pair<BoxPair, size_t>> pressed;  // by the bodies
  std::vector<Pad*> together;
  PadsRoom sharing;
};

// Put corners on the faces of boxes, and share what the pads of two bodies carry as rubber ones do. All
// bodies that no force moves are one support.
inline void share_on_faces(LoadsRoom& room, const std::vector<Body>& bodies,
                           const std::vector<bc_body_box>& boxes, const std::vector<bc_pose>& poses,
                           bc_load* loads) {
  auto& [all, pads, pressed, together, sharing] = room;
  auto support = [&](int64_t body) { return bodies[size_t(body)].is_free() ? int32_t(body) : -1; };
  pads.resize(all.size());
  pressed.clear();
  for (size_t k = 0; k < all.size(); ++k) {
    if (!(loads[k].pressing > 0.0)) continue;
    const bc_body_box &a = boxes[size_t(loads[k].box_a)], &b = boxes[size_t(loads[k].box_b)];
    pads[k] = {patch_of_faces(in_common_frame(poses[size_t(a.body)], a.box.pose), a.box.size,
                              in_common_frame(poses[size_t(b.body)], b.box.pose), b.box.size,
                              all[k].normal, face_tolerance),
               loads[k].pressing, vector(loads[k].centre)};
    if (pads[k].faces.polygon.count == 0) continue;
    pressed.push_back({std::minmax(support(a.body), support(b.body)), k});
  }
  std::sort(pressed.begin(), pressed.end());
  for (auto first = pressed.begin(), last = first; first != pressed.end(); first = last) {
    together.clear();
    for (; last != pressed.end() && last->first == first->first; ++last)
      if (pads[last->second].faces.area > 0.0) together.push_back(&pads[last->second]);
    if (together.size() > 1) share_by_normal(together, sharing);
  }
  for (const auto& [pair, k] : pressed) write(pads[k], loads[k]);
}

}  // namespace box_contact::BOX_CONTACT_SET::force
