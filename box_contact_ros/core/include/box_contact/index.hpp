// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Many boxes in C++17: an index of those that stand, and what others meet on a path among them.
//
//   box_contact::Index yard(sizes, poses);
//   box_contact::Way way{load_sizes, poses_of_load};       // a row of poses for each time
//   way.clearance = 0.5;
//   box_contact::Path path(yard, way);
//   while (!path.advance(1000)) do_other_things();
//   for (const box_contact::Meeting& impact : path.impacts()) ...
//
// index.h describes the arguments, and has filters and movers. Refused input throws std::invalid_argument
// that names field and value.
#ifndef BOX_CONTACT_INDEX_HPP
#define BOX_CONTACT_INDEX_HPP

#include <cstdint>
#include <memory>

#include "box_contact.hpp"
#include "index.h"

namespace box_contact {

using Meeting = bc_meeting;  // two boxes by number, and when they meet, by the path's time

namespace detail {

template <class T, void (*destroy)(T*)>
struct Destroy {
  void operator()(T* made) const { destroy(made); }
};

}  // namespace detail

// Boxes that stand. It does not change, and any threads may use it.
class Index {
 public:
  // Seven NaN instead of a pose: a box that is not there.
  Index(Span<const Size> sizes, Span<const Pose> poses) {
    if (sizes.size() != poses.size())
      detail::raise(BC_BAD_ARGUMENT, "sizes and poses must be equally many");
    bc_index* made = nullptr;
    detail::check(bc_index_create(sizes.data(), poses.data(), std::int64_t(sizes.size()), &made));
    made_.reset(made);
  }

  const bc_index* get() const { return made_.get(); }

 private:
  std::unique_ptr<bc_index, detail::Destroy<bc_index, bc_index_destroy>> made_;
};

// Boxes that move, and where they are at each time of a path.
struct Way {
  Span<const Size> sizes;
  Span<const Pose> poses;  // those of all boxes at the first time, then at the next one, and so on
  Span<const double> centres{};  // of turning, in the boxes' frames, three numbers a box [m]; none: the boxes' own
  double clearance = 0.0;        // the distance from which on a pair counts [m]
  double tolerance = 1e-6;       // of distances [m]
  std::int64_t most_pairs = INT64_MAX;  // that come within the clearance; more are refused
  std::int64_t most_looks = INT64_MAX;  // at pairs that are near each other; more are refused
};

// What boxes on their way meet among those of an index, which outlives the path, and each other. Box k of
// the way has the number of the boxes of the index, plus k, and is box A.
class Path {
 public:
  Path(const Index& yard, const Way& way) {
    std::size_t count = way.sizes.size();
    if (count == 0 || way.poses.size() % count)
      detail::raise(BC_BAD_ARGUMENT, "poses must be a row of all boxes for each time");
    if (way.centres.size() && way.centres.size() != 3 * count)
      detail::raise(BC_BAD_ARGUMENT, "centres must be three numbers a box");
    bc_way plain = bc_default_way();
    plain.times = std::int64_t(way.poses.size() / count);
    plain.count = std::int64_t(count);
    plain.sizes = way.sizes.data();
    plain.poses = way.poses.data();
    plain.centres = way.centres.data();
    plain.around = yard.get();
    plain.clearance = way.clearance;
    plain.tolerance = way.tolerance;
    plain.most_pairs = way.most_pairs;
    plain.most_looks = way.most_looks;
    bc_path* made = nullptr;
    detail::check(bc_path_create(&plain, &made));
    made_.reset(made);
  }

  // Go on by about `work` looks, of some microseconds each; all: to the end. Returns whether all is done.
  bool advance(std::int64_t work = INT64_MAX) {
    bool is_done = false;
    detail::check(bc_path_advance(made_.get(), work, &is_done));
    return is_done;
  }

  // Of a path that is done: the first of each pair within the clearance, in the order of time.
  Span<const Meeting> impacts() const {
    bc_path_found found = read();
    return {found.impacts, std::size_t(found.impact_count)};
  }
  // Pairs within the clearance at the first pose, two numbers a row; see bc_path_found.
  Span<const std::int64_t> held() const {
    bc_path_found found = read();
    return {found.held, std::size_t(2 * found.held_count)};
  }
  // How near a pair comes that is not held, or nullptr.
  const Meeting* least() const { return read().least; }

 private:
  bc_path_found read() const {
    bc_path_found found{};
    found.size = sizeof found;
    detail::check(bc_path_read(made_.get(), &found));
    return found;
  }

  std::unique_ptr<bc_path, detail::Destroy<bc_path, bc_path_destroy>> made_;
};

}  // namespace box_contact

#endif
