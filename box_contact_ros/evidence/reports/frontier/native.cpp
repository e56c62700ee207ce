// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Times of libbox_contact and of MuJoCo's box colliders, C against C, in turn, in one process.
//
// native POSES MODEL.xml ROUNDS CALLS: prints a line for each contestant and round, nanoseconds a pair.
// POSES has a count of int64, then poses of A and B (n, 7) and full extents of A and B (n, 3).
#include <box_contact/box_contact.h>
#include <mujoco/mujoco.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

// MuJoCo's collider of two boxes, which the library exports without a public declaration.
extern "C" int mjc_BoxBox(const mjModel* m, const mjData* d, mjContact* found, int a, int b,
                          mjtNum margin);

namespace {

[[noreturn]] void fail(const std::string& what) {
  std::fprintf(stderr, "native: %s\n", what.c_str());
  std::exit(2);
}

template <class Item>
std::vector<Item> read(std::FILE* file, size_t count) {
  std::vector<Item> items(count);
  if (std::fread(items.data(), sizeof(Item), count, file) != count) fail("the poses end early");
  return items;
}

struct Poses {
  std::vector<bc_pose> a, b;
  std::vector<bc_size> size_a, size_b;

  explicit Poses(const char* path) {
    std::FILE* file = std::fopen(path, "rb");
    if (!file) fail(std::string("cannot read ") + path);
    size_t count = size_t(read<int64_t>(file, 1)[0]);
    a = read<bc_pose>(file, count);
    b = read<bc_pose>(file, count);
    size_a = read<bc_size>(file, count);
    size_b = read<bc_size>(file, count);
    std::fclose(file);
  }
  size_t count() const { return a.size(); }
};

// A scene of two boxes. Positions and matrices of all pairs are made beforehand, so that a pair costs
// MuJoCo the copy of its numbers alone.
struct Scene {
  struct Geom {
    mjtNum size[3], position[3], matrix[9];
  };
  mjModel* model;
  mjData* data;
  std::vector<Geom> geoms;

  Scene(const char* path, const Poses& poses) {
    char error[200];
    model = mj_loadXML(path, nullptr, error, sizeof error);
    if (!model) fail(error);
    data = mj_makeData(model);
    mj_forward(model, data);
    auto add = [&](const bc_pose& pose, const bc_size& size) {
      const double* q = pose.quaternion;
      mjtNum turn[4] = {q[3], q[0], q[1], q[2]};
      Geom geom;
      mju_normalize4(turn);
      mju_quat2Mat(geom.matrix, turn);
      for (int k = 0; k < 3; ++k) {
        geom.position[k] = pose.position[k];
        geom.size[k] = 0.5 * size.extent[k];
      }
      geoms.push_back(geom);
    };
    for (size_t i = 0; i < poses.count(); ++i) {
      add(poses.a[i], poses.size_a[i]);
      add(poses.b[i], poses.size_b[i]);
    }
  }
  void place(size_t pair) {
    for (int g = 0; g < 2; ++g) {
      const Geom& geom = geoms[2 * pair + size_t(g)];
      std::memcpy(model->geom_size + 3 * g, geom.size, sizeof geom.size);
      std::memcpy(data->geom_xpos + 3 * g, geom.position, sizeof geom.position);
      std::memcpy(data->geom_xmat + 9 * g, geom.matrix, sizeof geom.matrix);
    }
  }
};

struct Contestant {
  std::string name;
  size_t pairs;  // of a round
  std::function<void(size_t first)> run;
};

}  // namespace

int main(int count, char** arguments) {
  if (count != 5) fail("usage: native POSES MODEL.xml ROUNDS CALLS");
  Poses poses(arguments[1]);
  Scene scene(arguments[2], poses);
  size_t rounds = std::strtoul(arguments[3], nullptr, 10), n = poses.count();
  size_t calls = std::min<size_t>(std::strtoul(arguments[4], nullptr, 10), n);
  std::vector<double> separation(n), normal(3 * n), point(3 * n), volume(n), covariance(9 * n);
  std::vector<char> colliding(n);
  std::vector<Contestant> all;
  std::printf("set %s\n", bc_instruction_set());
  static double kept;  // so that no call can be left out
  mjContact contacts[16];
  size_t touching = 0;
  for (size_t i = 0; i < n; ++i) {
    scene.place(i);
    if (mjc_BoxBox(scene.model, scene.data, contacts, 0, 1, 0.0) > 0)
      touching += contacts[0].dist < 0.0;
  }
  std::printf("touching by mjc_BoxBox\t%zu\n", touching);
  all.push_back({"mjc_BoxBox, single", calls, [&](size_t first) {
                   for (size_t i = first; i < first + calls; ++i) {
                     scene.place(i);
                     kept += mjc_BoxBox(scene.model, scene.data, contacts, 0, 1, 0.0);
                   }
                 }});
  all.push_back({"mj_geomDistance, single", calls, [&](size_t first) {
                   mjtNum from_to[6];
                   for (size_t i = first; i < first + calls; ++i) {
                     scene.place(i);
                     kept += mj_geomDistance(scene.model, scene.data, 0, 1, 1.0, from_to);
                   }
                 }});
  for (bc_model model : {BC_EXACT, BC_MLP})
    for (bc_patch patch : {BC_VOLUME, BC_COVARIANCE}) {
      bc_options options = BC_DEFAULT_OPTIONS;
      options.model = model;
      bc_solver* solver;
      if (bc_solver_create(&poses.size_a[0], &poses.size_b[0], &options, &solver) != BC_OK)
        fail(bc_error_text());
      std::string name = model == BC_EXACT ? "exact" : "mlp";
      name += patch == BC_VOLUME ? " volume" : " covariance";
      all.push_back({name + ", single", calls, [&, solver, patch](size_t first) {
                       bc_contact found;
                       for (size_t i = first; i < first + calls; ++i) {
                         bc_solve(solver, &poses.a[i], &poses.b[i], &poses.size_a[i],
                                  &poses.size_b[i], patch, &found);
                         kept += found.separation;
                       }
                     }});
      all.push_back({name + ", batch", n, [&, solver, patch](size_t) {
                       bc_rows rows = {
                           sizeof rows,         int64_t(n),          poses.a.data(), poses.b.data(),
                           poses.size_a.data(), poses.size_b.data(), nullptr,        0};
                       bc_results results = {sizeof results,
                                             reinterpret_cast<bool*>(colliding.data()),
                                             separation.data(),
                                             normal.data(),
                                             point.data(),
                                             volume.data(),
                                             patch == BC_VOLUME ? nullptr : covariance.data(),
                                             nullptr};
                       bc_solve_rows(solver, &rows, &results, 1, nullptr);
                     }});
    }
  for (size_t round = 0; round <= rounds; ++round)  // the first one warms up
    for (const Contestant& one : all) {
      size_t first = round * calls % (n - calls + 1);
      auto start = std::chrono::steady_clock::now();
      one.run(first);
      std::chrono::duration<double, std::nano> took = std::chrono::steady_clock::now() - start;
      if (round) std::printf("%s\t%.2f\n", one.name.c_str(), took.count() / double(one.pairs));
    }
  return kept == 0.5 ? 3 : 0;
}
