// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Pads: several patches by which one body stands on another, as on the feet of a pallet.
//
// How rigid pads share a load is open, but for three points. Here they share as rubber pads of one kind
// and thickness do: the pressure is linear over all of them, and does not pull. The whole load and its
// centre stay.
#pragma once

#include <algorithm>
#include <vector>

#include "beds.hpp"
#include "face_patch.hpp"

namespace box_contact::BOX_CONTACT_SET::faces {

// Normals of pads differ by an angle whose cosine is 1 less this, at most [1]: 1.4 mrad.
constexpr double level_slack = 1e-6;

// A pad, with what presses on it and where [N], [m].
struct Pad {
  FacePatch faces;
  double pressing;
  Vec<double> centre;
};

// Memory that calls use again.
struct PadsRoom {
  std::vector<Pad*> level;
  std::vector<Polygon> beds;
};

// Share what presses on pads whose normals are parallel.
inline void share(const std::vector<Pad*>& pads, std::vector<Polygon>& beds) {
  const FacePatch plane = pads.front()->faces;
  auto flat = [&](const Vec<double>& at) { return plane.flat(at - plane.origin); };
  double total = 0.0;
  Point moment = {0.0, 0.0};
  beds.clear();
  for (const Pad* pad : pads) {
    total += pad->pressing;
    moment = moment + pad->pressing * flat(pad->centre);
    Polygon bed = pad->faces.polygon;
    for (int k = 0; k < bed.count; ++k)
      bed.corners[size_t(k)] = flat(pad->faces.in_common_frame(bed[k]));
    if (dot(pad->faces.normal, plane.normal) < 0.0)
      std::reverse(bed.corners.begin(), bed.corners.begin() + bed.count);
    beds.push_back(bed);
  }
  Point middle = (1.0 / total) * moment;
  Pressure pressure = pressure_on(beds, middle);
  if (!pressure.holds) return;
  for (size_t k = 0; k < pads.size(); ++k) {
    Moments m = moments_of(pressure.under(beds[k], middle), middle);
    double part = pressure.a * m.area + dot(pressure.g, m.first);
    pads[k]->pressing = total * part;
    if (!(part > 0.0)) continue;
    Point turn = {pressure.a * m.first.x + pressure.g.x * m.xx + pressure.g.y * m.xy,
                  pressure.a * m.first.y + pressure.g.x * m.xy + pressure.g.y * m.yy};
    Point at = middle + (1.0 / part) * turn;
    pads[k]->centre = pads[k]->centre + ((at.x - flat(pads[k]->centre).x) * plane.axis_1 +
                                         (at.y - flat(pads[k]->centre).y) * plane.axis_2);
  }
}

// Share what presses on the pads of two bodies, those with parallel normals among themselves. Takes pads out.
inline void share_by_normal(std::vector<Pad*>& pads, PadsRoom& room) {
  while (pads.size() > 1) {
    const Vec<double> normal = pads.front()->faces.normal;
    room.level.clear();
    auto is_taken = [&](Pad* pad) {
      bool is_level = std::fabs(dot(pad->faces.normal, normal)) >= 1.0 - level_slack;
      if (is_level) room.level.push_back(pad);
      return is_level;
    };
    pads.erase(std::remove_if(pads.begin(), pads.end(), is_taken), pads.end());
    if (room.level.size() > 1) share(room.level, room.beds);
  }
}

}  // namespace box_contact::BOX_CONTACT_SET::faces
