// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The C++17 interface of libbox_contact: whether two boxes touch, where, and along which direction;
// how far they are apart, and between which points; where two of their faces meet; or when they come
// near each other on their ways.
//
//   box_contact::Box a{{{0.0, 0.0, 1.49}, {0.0, 0.0, 0.0, 1.0}}, {1.0, 1.0, 1.0}};
//   box_contact::Box b{{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}}, {2.0, 2.0, 2.0}};
//   box_contact::Contact contact = box_contact::collide(a, b);  // the normal points down, from A to B
//
// A box has a pose, position [m] and quaternion x y z w, and a size, three full extents [m].
// Units are SI, frames are right-handed. A pose places a box's centre and axes in a frame common to
// both boxes. Answers are in the same frame. "Size" as a length: the largest extent of both boxes.
//
// Fields of `Contact`, each with its unit, its frame and its largest error. The rounding of the
// coordinates comes on top.
//
//   colliding: bool. Touching counts, up to 8 ulp of the largest coordinate or size.
//   separation [m]. Negative: the depth along the normal, to 1e-12 · size. Positive: the largest
//       gap of the separating-axis test, at most the distance.
//   normal: unit vector, common frame, from A to B. Moving B by depth · normal separates the boxes.
//   axis: the winning axis. 0–2: faces of A. 3–5: faces of B. 6 + 3 i + j: the edges a_i × b_j.
//   point [m], common frame: the centroid of A∩B, inside both boxes but for its error. The error of
//       model `exact` is at most max(1e-9, 1e-14 · size / depth) · size. The point of model `mlp` is
//       within the bounds of A∩B, not always in both boxes.
//   volume [m³] of A∩B. The error of model `exact` is at most max(1e-9, 1e-14 · size / depth) of it.
//   covariance [m²], common frame: the second central moments of A∩B divided by its volume. The
//       error of model `exact` is at most max(1e-8, 1e-14 · size / depth) of the trace. That of model
//       `mlp` is positive definite.
//
// In 99 of 100 contacts, even of the pose set where it is worst, the error of model `mlp` is
// at most 3.3 % of the smaller box's longest edge for the point, 13 % for the volume, and 16
// % of the trace for the covariance.
//
// Without contact, `point` and `covariance` are NaN, and `volume` is zero. `normal` is NaN where the
// separation exceeds the margin, 0 by default. A contact shallower than 1e-9 · size has the point,
// volume and covariance of boxes that were pressed in to this depth.
//
// No compiler flag is needed. The library contains code for several instruction sets, and uses the
// best one that the machine can run.
#ifndef BOX_CONTACT_HPP
#define BOX_CONTACT_HPP

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "box_contact.h"

namespace box_contact {

using Size = bc_size;        // full extents along the box's own axes [m]
using Pose = bc_pose;        // position [m]; quaternion x y z w of any length
using Box = bc_box;          // pose and size
using Contact = bc_contact;  // see above
using Nearest = bc_nearest;  // see box_contact.h
using Sweep = bc_sweep;      // poses at s = 0 and s = 1, size, and centre of turning; see box_contact.h
using Approach = bc_approach;
using Polygon = bc_polygon;  // see box_contact.h

enum class Model { exact = BC_EXACT, mlp = BC_MLP };
enum class Patch { none = BC_NO_PATCH, volume = BC_VOLUME, covariance = BC_COVARIANCE };

// A question about boxes.
struct Query {
  Model model = Model::exact;
  Patch patch = Patch::covariance;  // of single calls; a batch computes what has an array
  double margin = 0.0;              // [m]; normals are given up to this separation
};

// Numbers in a row that somebody else owns: an array, a std::vector or a std::array.
template <class T>
class Span {
 public:
  constexpr Span() = default;
  constexpr Span(T* data, std::size_t size) : data_(data), size_(size) {}
  template <std::size_t n>
  constexpr Span(T (&array)[n]) : data_(array), size_(n) {}
  template <class Container, class = decltype(static_cast<T*>(std::declval<Container&>().data()))>
  constexpr Span(Container&& container) : data_(container.data()), size_(container.size()) {}

  constexpr T* data() const { return data_; }
  constexpr T* begin() const { return data_; }
  constexpr T* end() const { return data_ + size_; }
  constexpr std::size_t size() const { return size_; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

namespace detail {

// Without exceptions (-fno-exceptions) the words are printed, and the program ends; call box_contact.h
// where it must go on.
[[noreturn]] inline void raise(bc_status status, const char* words) {
#if defined(__cpp_exceptions) || defined(_CPPUNWIND)
  if (status == BC_NO_MEMORY) throw std::bad_alloc();
  if (status == BC_BAD_ENVIRONMENT || status == BC_BAD_ABI)
    throw std::runtime_error(words);
  throw std::invalid_argument(words);
#else
  (void)status;
  std::fprintf(stderr, "box_contact: %s\n", words);
  std::abort();
#endif
}

inline void check(bc_status status) {
  if (status != BC_OK) raise(status, bc_error_text());
}

inline bc_query plain(const Query& query) {
  return {sizeof(bc_query), bc_model(query.model), bc_patch(query.patch), query.margin};
}

}  // namespace detail

// Arrays of a row for each pair; nullptr for what is not wanted, which is then not computed.
struct Results {
  bool* colliding = nullptr;
  double* separation = nullptr;
  double* normal = nullptr;  // three numbers a row
  double* point = nullptr;   // three numbers a row
  double* volume = nullptr;
  double* covariance = nullptr;  // nine numbers a row
  std::int32_t* axis = nullptr;
};

// The contact of two boxes. Throws std::invalid_argument with field and value. Refused are numbers that
// are not finite, coordinates beyond 1e50 m, extents outside 1e-50 to 1e50 m, and quaternions of a length
// outside 1e-100 to 1e100. Throws std::runtime_error for an unknown BOX_CONTACT_INSTRUCTION_SET, and
// where the library is of another version than this header.
inline Contact collide(const Box& a, const Box& b, const Query& query = {}) {
  Contact contact;
  bc_query plain = detail::plain(query);
  detail::check(bc_collide(&a, &b, &plain, &contact));
  return contact;
}

// Rows of pairs: row i is (poses_a[i], poses_b[i]). With `pairs` row i has box A at poses_a[pairs[2 i]]
// and box B at poses_b[pairs[2 i + 1]]; an empty list has no rows. Poses of A and B are equally many.
// Sizes go with poses, one for each, or one for all.
struct Rows {
  Span<const Pose> poses_a, poses_b;
  Span<const Size> sizes_a, sizes_b;
  std::optional<Span<const std::int64_t>> pairs{};
};

// Arrays of a row for each pair; nullptr for what is not wanted.
struct NearestResults {
  bool* colliding = nullptr;
  double* distance = nullptr;
  double* normal = nullptr;   // three numbers a row
  double* point_a = nullptr;  // three numbers a row
  double* point_b = nullptr;  // three numbers a row
};

namespace detail {

inline bc_nearest_results plain(const NearestResults& results) {
  return {sizeof(bc_nearest_results), results.colliding, results.distance,
          results.normal,             results.point_a,   results.point_b};
}

// Ask `call` for rows. Returns the first row that is refused, or −1.
template <class Call>
std::int64_t ask_rows(const Rows& rows, Call call) {
  auto size = [](const auto& span) { return std::int64_t(span.size()); };
  if (size(rows.poses_a) != size(rows.poses_b))
    raise(BC_BAD_ARGUMENT, "poses_a and poses_b must be equally many");
  Span<const std::int64_t> pairs = rows.pairs.value_or(Span<const std::int64_t>());
  if (pairs.size() % 2) raise(BC_BAD_ARGUMENT, "pairs must be two indices a row");
  const bc_rows plain{sizeof(bc_rows),
                      rows.pairs ? size(pairs) / 2 : size(rows.poses_a),
                      size(rows.poses_a),
                      rows.poses_a.data(),
                      rows.poses_b.data(),
                      rows.sizes_a.data(),
                      rows.sizes_b.data(),
                      size(rows.sizes_a),
                      size(rows.sizes_b),
                      pairs.data()};
  std::int64_t refused = -1;
  bc_status status = call(plain, refused);
  auto is_place = [&](std::int64_t place) { return place >= 0 && place < size(rows.poses_a); };
  bool bad_pose = status == BC_BAD_ROWS &&
                  (!rows.pairs || (is_place(pairs.data()[2 * refused]) &&
                                   is_place(pairs.data()[2 * refused + 1])));
  if (!bad_pose) check(status);
  return refused;
}

}  // namespace detail

// The contacts of many pairs, bit for bit those of single calls. Returns the first row that is
// refused, or −1. A refused row gets `colliding` false and `separation` NaN, and its other fields
// have no meaning. All other rows are solved. Throws as for one pair, for arrays of unequal lengths
// as well, and where a place in `pairs` has no pose. Calls allocate no memory, but for those of
// several threads.
inline std::int64_t collide(const Rows& rows, const Results& results, const Query& query = {},
                            int threads = 1) {
  const bc_results wanted{sizeof(bc_results), results.colliding, results.separation,
                          results.normal,     results.point,     results.volume,
                          results.covariance, results.axis};
  const bc_query asked = detail::plain(query);
  return detail::ask_rows(rows, [&](const bc_rows& plain, std::int64_t& refused) {
    return bc_collide_rows(&plain, &asked, &wanted, threads, &refused);
  });
}

// How far two boxes are apart, and between which points. Throws as `collide`.
inline Nearest distance(const Box& a, const Box& b) {
  Nearest nearest{};
  nearest.size = sizeof(Nearest);
  detail::check(bc_distance(&a, &b, &nearest));
  return nearest;
}

// The same of many pairs, as `collide` takes and answers them. A refused row gets `distance` NaN.
inline std::int64_t distance(const Rows& rows, const NearestResults& results, int threads = 1) {
  const bc_nearest_results wanted = detail::plain(results);
  return detail::ask_rows(rows, [&](const bc_rows& plain, std::int64_t& refused) {
    return bc_distance_rows(&plain, &wanted, threads, &refused);
  });
}

// The first time at which two boxes are as near as the clearance [m], to the tolerance [m]; time NaN:
// never. See bc_time_of_impact. Throws as `collide`, for turns by 180 degrees, and for a tolerance that
// rounding does not allow.
inline Approach time_of_impact(const Sweep& a, const Sweep& b, double clearance = 0.0,
                               double tolerance = 1e-6) {
  Approach approach{};
  approach.size = sizeof(Approach);
  detail::check(bc_time_of_impact(&a, &b, clearance, tolerance, &approach));
  return approach;
}

// The least distance of two boxes on their ways, to the tolerance [m], and when. See bc_least_distance.
// Throws likewise.
inline Approach least_distance(const Sweep& a, const Sweep& b, double tolerance = 1e-6) {
  Approach approach{};
  approach.size = sizeof(Approach);
  detail::check(bc_least_distance(&a, &b, tolerance, &approach));
  return approach;
}

// Rows of pairs on their ways. Poses at s = 1 are as many as those at s = 0.
struct SweepRows {
  Rows starts;  // poses at s = 0, sizes, and pairs
  Span<const Pose> ends_a, ends_b;
  const double* centres_a = nullptr;  // three numbers a pose [m]; nullptr: the boxes' centres
  const double* centres_b = nullptr;
  Span<const double> clearances{};  // of each pair [m]; none: that of the call
};

// Arrays of a row for each pair; nullptr for what is not wanted.
struct ApproachResults {
  double* time = nullptr;
  double* closing_speed = nullptr;
  NearestResults nearest{};
};

namespace detail {

template <class Call>
std::int64_t ask_sweeps(const SweepRows& rows, const ApproachResults& results, Call call) {
  for (const Span<const Pose>& ends : {rows.ends_a, rows.ends_b})
    if (ends.size() != rows.starts.poses_a.size())
      raise(BC_BAD_ARGUMENT, "ends must be as many as starts");
  const bc_approach_results wanted{sizeof(bc_approach_results), results.time,
                                   results.closing_speed, plain(results.nearest)};
  return ask_rows(rows.starts, [&](const bc_rows& starts, std::int64_t& refused) {
    if (rows.clearances.size() && std::int64_t(rows.clearances.size()) != starts.count)
      raise(BC_BAD_ARGUMENT, "clearances must be as many as pairs");
    const bc_sweep_rows plain{sizeof(bc_sweep_rows), starts,         rows.ends_a.data(),
                              rows.ends_b.data(),    rows.centres_a, rows.centres_b,
                              rows.clearances.data()};
    return call(plain, wanted, refused);
  });
}

}  // namespace detail

// The same of many pairs, as `collide` takes and answers them. A refused row gets `time` −1.
inline std::int64_t time_of_impact(const SweepRows& rows, const ApproachResults& results,
                                   double clearance = 0.0, double tolerance = 1e-6,
                                   int threads = 1) {
  return detail::ask_sweeps(rows, results, [&](auto& plain, auto& wanted, auto& refused) {
    return bc_time_of_impact_rows(&plain, clearance, tolerance, &wanted, threads, &refused);
  });
}
inline std::int64_t least_distance(const SweepRows& rows, const ApproachResults& results,
                                   double tolerance = 1e-6, int threads = 1) {
  return detail::ask_sweeps(rows, results, [&](auto& plain, auto& wanted, auto& refused) {
    return bc_least_distance_rows(&plain, tolerance, &wanted, threads, &refused);
  });
}

// The patch of the faces by which two boxes meet, within a tolerance [m]; see bc_face_patch. `normal`: that
// of their contact. Throws as `collide`, and for a normal whose length is not 1.
inline Polygon face_patch(const Box& a, const Box& b, const double (&normal)[3],
                          double tolerance = 1e-4) {
  Polygon patch{};
  patch.size = sizeof(Polygon);
  detail::check(bc_face_patch(&a, &b, normal, tolerance, &patch));
  return patch;
}

// The instruction set of this process: "baseline", "avx2" or "avx512".
inline std::string instruction_set() {
  const char* name = bc_instruction_set();
  return name ? name : "";
}

}  // namespace box_contact

#endif
