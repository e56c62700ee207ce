// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// MuJoCo through its C interface: its collider of two boxes, and its signed distance.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cstring>

#include "contestants.hpp"

namespace {

constexpr char BOXES[] = R"(<mujoco><worldbody>
<geom type="box" size="1 1 1"/><body pos="0 0 3"><freejoint/><geom type="box" size="1 1 1"/></body>
</worldbody></mujoco>)";

// A scene of two boxes, and what its last call answered.
struct Scene {
  mjModel* model;
  mjData* data;
  mjfCollision box_box = mjCOLLISIONFUNC[mjGEOM_BOX][mjGEOM_BOX];  // mjc_BoxBox
  mjPreContact contacts[mjMAXCONPAIR];
  int count = 0;
  double distance = 0.0, from_to[6];

  Scene() {
    char error[200];
    mjVFS vfs;
    mj_defaultVFS(&vfs);
    mj_addBufferVFS(&vfs, "boxes.xml", BOXES, sizeof BOXES - 1);
    model = mj_loadXML("boxes.xml", &vfs, error, sizeof error);
    mj_deleteVFS(&vfs);
    if (!model) fail(error);
    data = mj_makeData(model);
    mj_forward(model, data);
  }
  void place(int geom, const PlacedBox& box) {
    std::memcpy(model->geom_size + 3 * geom, box.half, sizeof box.half);
    std::memcpy(data->geom_xpos + 3 * geom, box.position, sizeof box.position);
    std::memcpy(data->geom_xmat + 9 * geom, box.matrix, sizeof box.matrix);
  }
};

}  // namespace

void add_mujoco(Query query, const Poses& poses, size_t calls, Contestants& all) {
  Scene& scene = *new Scene;
  double farthest = query == Query::contact ? 1.0 : 1e10;  // distance up to which it is asked [m]
  auto boxes = [&](size_t i) {
    // contact: mjc_BoxBox
    scene.place(0, poses.placed_a[i]);
    scene.place(1, poses.placed_b[i]);
    scene.count = scene.box_box(scene.model, scene.data, scene.contacts, 0, 1, 0.0);
    // end of call
    return scene.count;
  };
  auto deepest = [&] {
    double found = APART;
    for (int k = 0; k < scene.count; ++k) found = std::min(found, scene.contacts[k].dist);
    return found;
  };
  if (query == Query::contact) all.push_back(single("mjc_BoxBox", calls, boxes, deepest));
  auto distance = [&, farthest](size_t i) {
    // contact, distance: mj_geomDistance
    scene.place(0, poses.placed_a[i]);
    scene.place(1, poses.placed_b[i]);
    scene.distance = mj_geomDistance(scene.model, scene.data, 0, 1, farthest, scene.from_to);
    // end of call
    return scene.distance;
  };
  all.push_back(single("mj_geomDistance", calls, distance, [&] { return scene.distance; }));
}
