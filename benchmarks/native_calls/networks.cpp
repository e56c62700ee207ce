// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Networks that the library's interface does not name: other sizes of `mlp`, and the paper's. The
// library's sources are compiled here once more, for one instruction set and with the library's flags.
#include <cstdio>
#include <memory>

#include "../../box_contact_ros/core/src/mlp/mlp_model.hpp"
#include "../../box_contact_ros/core/src/mlp/paper_model.hpp"
#include "../../box_contact_ros/core/src/pair.hpp"
#include "../../box_contact_ros/core/src/queue.hpp"
#include "contestants.hpp"

namespace {

using namespace box_contact;
using namespace box_contact::BOX_CONTACT_SET;

#if defined(__AVX512F__)
constexpr int lanes = 8;
#else
constexpr int lanes = 4;
#endif

template <class Model>
void add(const Poses& poses, size_t calls, const std::string& name, const Model& model,
         Contestants& all) {
  auto pair = [&poses](size_t i) {
    return detail::PairNumbers{poses.box_a[i].pose.position, poses.box_b[i].pose.position,
                               poses.box_a[i].size.extent, poses.box_b[i].size.extent};
  };
  bc_contact& contact = *new bc_contact;
  auto call = [=, &contact](size_t i) {
    solve_pair(model, pair(i), 0.0, contact);
    return contact.separation;
  };
  all.push_back(single(name, calls, call, [&contact] { return contact.separation; }));

  size_t n = poses.count();
  auto colliding = new bool[n];
  auto separation = new double[n], normal = new double[3 * n], point = new double[3 * n];
  auto volume = new double[n];
  auto batch = [=, &poses](size_t) {
    Rows rows{poses.a[0].position,
              poses.b[0].position,
              poses.size_a[0].extent,
              poses.size_b[0].extent,
              3,
              3};
    Results results{colliding, separation, normal, point, volume, nullptr, nullptr, 0.0};
    solve_rows<Lanes<double, lanes>>(model, rows, 0, long(n), results);
  };
  all.push_back(batched(name, n, batch, separation));
}

}  // namespace

void ADD_NETWORKS(const Poses& poses, size_t calls, const char* path, Contestants& all) {
  std::FILE* file = std::fopen(path, "rb");
  if (!file) fail(std::string("cannot read ") + path);
  for (int64_t lengths[2]; std::fread(lengths, sizeof lengths, 1, file);) {
    auto name = read_items<char>(file, size_t(lengths[0]));
    auto& numbers = *new std::vector<float>(read_items<float>(file, size_t(lengths[1])));
    std::string shown(name.begin(), name.end());
    if (numbers[0] == float(detail::paper_inputs))
      add(poses, calls, shown, PaperModel{view(numbers.data())}, all);
    else
      add(poses, calls, shown + " volume", MlpPointModel{view(numbers.data())}, all);
  }
  std::fclose(file);
}
