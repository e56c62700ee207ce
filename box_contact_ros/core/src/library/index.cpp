// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The C interface of many boxes: filters, an index of what stands, movers and paths. It is compiled once,
// for any instruction set: distances alone have kernels.
#include "../../include/box_contact/index.h"

#include <memory>

#include "../motion/path.hpp"
#include "../movers.hpp"
#include "pair_arguments.hpp"

using namespace box_contact::detail;

struct bc_filter : Filter {};
struct bc_index : Index {
  using Index::Index;
};
struct bc_movers {
  std::unique_ptr<Filter> own;  // where the program gives none
  Movers movers;
};
struct bc_path {
  std::unique_ptr<Filter> own;
  box_contact::motion::Path path;
  bc_way way;
};

namespace box_contact::detail {
namespace {

bool is_box(int64_t box, int64_t count) { return box >= 0 && box < count; }

bc_status check_count(int64_t count) {
  if (is_box(count, INT32_MAX)) return BC_OK;
  return fail(BC_BAD_ARGUMENT, "count %lld is that of no boxes", (long long)count);
}

bc_status check_length(const char* field, double length) {
  if (length >= 0.0 && length <= length_max) return BC_OK;
  return fail(BC_BAD_ARGUMENT, "%s must be within 0 and 1e50 m, not %g", field, length);
}

// --- Filters --------------------------------------------------------------------------------------

// Each two boxes are a pair.
std::unique_ptr<Filter> every_pair(int64_t count) {
  auto filter = std::make_unique<Filter>();
  filter->group.assign(size_t(count), 0);
  filter->body.assign(size_t(count), -1);
  for (int32_t box = 0; box < int32_t(count); ++box) filter->order.push_back(box);
  filter->groups = 1;
  filter->allowed = {3};
  return filter;
}

bc_status read_filter(const bc_filter_rows& rows, Filter& filter) {
  if (bc_status status = check_count(rows.count)) return status;
  filter = *every_pair(rows.count);
  auto take = [&](const int32_t* given, std::vector<int32_t>& to) {
    if (given) to.assign(given, given + rows.count);
  };
  take(rows.bodies, filter.body);
  take(rows.order, filter.order);
  for (int64_t k = 0; rows.listed && k < rows.listed_count; ++k) {
    int64_t a = rows.listed[2 * k], b = rows.listed[2 * k + 1];
    if (!is_box(a, rows.count) || !is_box(b, rows.count) || a == b)
      return fail(BC_BAD_ROWS, "listed[%lld] is (%lld, %lld), but there are %lld boxes",
                  (long long)k, (long long)a, (long long)b, (long long)rows.count);
    if (filter.body[size_t(a)] >= 0 && filter.body[size_t(a)] == filter.body[size_t(b)])
      return fail(BC_BAD_ROWS, "listed[%lld] is (%lld, %lld), boxes of one body", (long long)k,
                  (long long)a, (long long)b);
    filter.listed.emplace_back(a, b);
  }
  filter.sort_listed();
  if (!rows.groups) {
    filter.groups = rows.listed ? 0 : 1;
    return BC_OK;
  }
  if (rows.group_count < 0 || (rows.group_count && !rows.allowed))
    return fail(BC_BAD_ARGUMENT, "groups need a group_count, and which of them meet");
  take(rows.groups, filter.group);
  filter.groups = size_t(rows.group_count);
  filter.allowed.assign(rows.allowed, rows.allowed + filter.groups * filter.groups);
  for (int64_t box = 0; rows.group_count && box < rows.count; ++box)
    if (!is_box(rows.groups[box], rows.group_count))
      return fail(BC_BAD_ROWS, "groups[%lld] is %d, but there are %d", (long long)box,
                  int(rows.groups[box]), int(rows.group_count));
  return BC_OK;
}

// --- Boxes ----------------------------------------------------------------------------------------

bool is_absent(const bc_pose& pose) {
  const double* p = numbers(&pose);
  return std::all_of(p, p + 7, [](double number) { return std::isnan(number); });
}

// Read a box; `box`: its number in a refusal. What is absent is not read.
bc_status read_box(const bc_size& size, const bc_pose& pose, int64_t box, Pose<double>& pose_read,
                   Vec<double>& size_read) {
  char field[40];
  auto named = [&](const char* name) {
    std::snprintf(field, sizeof field, "%s[%lld]", name, (long long)box);
    return field;
  };
  const double *e = size.extent, *p = numbers(&pose);
  if (!size_is_valid(e)) return refuse_size(named("sizes"), e);
  if (!pose_is_valid(p) && !is_absent(pose)) return refuse_pose(named("poses"), p);
  size_read = {e[0], e[1], e[2]};
  pose_read = {{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
  return BC_OK;
}

struct Boxes {
  std::vector<Pose<double>> poses;
  std::vector<Vec<double>> sizes;

  bc_status read(const bc_size* sizes_given, const bc_pose* poses_given, int64_t count) {
    if (bc_status status = check_count(count)) return status;
    if (count && (!sizes_given || !poses_given)) return refuse_null(sizes_given ? "poses" : "sizes");
    poses.resize(size_t(count));
    sizes.resize(size_t(count));
    for (int64_t box = 0; box < count; ++box)
      if (bc_status status = read_box(sizes_given[box], poses_given[box], box, poses[size_t(box)],
                                      sizes[size_t(box)]))
        return status;
    return BC_OK;
  }
};

bc_status make_index(const bc_index* former, const int64_t* kept, const bc_size* sizes,
                     const bc_pose* poses, int64_t count, bc_index** index) {
  Boxes boxes;
  if (bc_status status = boxes.read(sizes, poses, count)) return status;
  for (int64_t box = 0; former && box < count; ++box)
    if (kept[box] >= 0 && !is_box(kept[box], int64_t(former->count())))
      return fail(BC_BAD_ROWS, "kept[%lld] is %lld, but there were %zu boxes", (long long)box,
                  (long long)kept[box], former->count());
  *index = former ? new bc_index(*former, kept, std::move(boxes.poses), std::move(boxes.sizes))
                  : new bc_index(std::move(boxes.poses), std::move(boxes.sizes));
  return BC_OK;
}

bc_status find_near(const Index& index, const bc_size* sizes, const bc_pose* poses, int64_t count,
                    double margin, int64_t* pairs, int64_t capacity, int64_t& found) {
  if (bc_status status = check_length("margin", margin)) return status;
  if (capacity < 0 || (capacity && !pairs)) return refuse_null("pairs");
  found = 0;
  for (int64_t box = 0; box < count && found <= capacity; ++box) {
    Pose<double> pose;
    Vec<double> size;
    if (bc_status status = read_box(sizes[box], poses[box], box, pose, size)) return status;
    if (is_absent(poses[box])) continue;
    index.each_near(bounds_of(pose, 0.5 * size).grown(margin), [&](int32_t other) {
      if (found < capacity) pairs[2 * found] = box, pairs[2 * found + 1] = other;
      return ++found <= capacity;
    });
  }
  return BC_OK;
}

// --- Movers ---------------------------------------------------------------------------------------

bc_status make_movers(const bc_size* sizes, int64_t count, double margin, const Filter* filter,
                      const Index* index, bc_movers** movers) {
  bc_status status = check_count(count);
  if (!status) status = check_length("margin", margin);
  if (status) return status;
  if (count && !sizes) return refuse_null("sizes");
  if ((filter && filter->count() != count) || (index && int64_t(index->count()) != count))
    return fail(BC_BAD_ARGUMENT, "filter and index must be of %lld boxes, too", (long long)count);
  std::vector<Vec<double>> half;
  for (int64_t box = 0; box < count; ++box) {
    const double* e = sizes[box].extent;
    char field[40];
    std::snprintf(field, sizeof field, "sizes[%lld]", (long long)box);
    if (!size_is_valid(e)) return refuse_size(field, e);
    half.push_back({0.5 * e[0], 0.5 * e[1], 0.5 * e[2]});
  }
  auto own = filter ? nullptr : every_pair(count);
  const Filter* used = filter ? filter : own.get();
  *movers = new bc_movers{std::move(own), Movers(std::move(half), margin, used, index)};
  return BC_OK;
}

// What a search that ended with `refused` found.
bc_status answer(const Movers& movers, const bc_pose* poses, int64_t refused, bc_near& near) {
  near = {sizeof(bc_near),
          reinterpret_cast<const int64_t*>(movers.pairs().data()),
          int64_t(movers.pairs().size()),
          reinterpret_cast<const int64_t*>(movers.stale().data()),
          int64_t(movers.stale().size()),
          refused};
  if (refused < 0) return BC_OK;
  char field[32];
  std::snprintf(field, sizeof field, "pose of box %lld", (long long)refused);
  return refuse_pose(field, numbers(poses + refused));
}

// --- Paths ----------------------------------------------------------------------------------------

bc_status read_poses(const bc_way& given, std::vector<Pose<double>>& poses) {
  for (int64_t row = 0; row < given.times * given.count; ++row) {
    const double* p = numbers(given.poses + row);
    char field[64];
    std::snprintf(field, sizeof field, "poses[%lld] of box %lld", (long long)(row / given.count),
                  (long long)(row % given.count));
    if (!pose_is_valid(p)) return refuse_pose(field, p);
    poses.push_back({{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}});
    if (row < given.count) continue;
    const double(&q)[4] = poses[size_t(row - given.count)].quaternion;
    double cosine = (q[0] * p[3] + q[1] * p[4]) + (q[2] * p[5] + q[3] * p[6]);
    double norms = std::sqrt(squared_norm(q) * squared_norm(poses.back().quaternion));
    if (!(std::fabs(cosine) >= motion::least_cosine * norms))
      return fail(BC_BAD_POSE, "%s: a turn by 180 degrees has two ways: give a pose between", field);
  }
  return BC_OK;
}

bc_status read_way(const bc_way& given, motion::Way& way) {
  if (given.times < 2 || !is_box(given.count, INT32_MAX) ||
      given.times > largest_count / std::max<int64_t>(1, given.count))
    return fail(BC_BAD_ARGUMENT, "a path has 2 times or more, not %lld, and %lld is its count of boxes",
                (long long)given.times, (long long)given.count);
  if (given.count && (!given.sizes || !given.poses)) return refuse_null(given.sizes ? "poses" : "sizes");
  bc_status status = check_length("clearance", given.clearance);
  if (!status) status = check_length("tolerance", given.tolerance);
  if (!status && !(given.tolerance > 0.0)) status = fail(BC_BAD_ARGUMENT, "tolerance must be above 0");
  if (!status) status = read_poses(given, way.poses);
  for (int64_t box = 0; !status && box < given.count; ++box) {
    const double* e = given.sizes[box].extent;
    char field[40];
    std::snprintf(field, sizeof field, "sizes[%lld]", (long long)box);
    if (!size_is_valid(e)) status = refuse_size(field, e);
    way.sizes.push_back({e[0], e[1], e[2]});
    if (!given.centres) continue;
    const double* c = given.centres + 3 * box;
    if (!(std::max({std::fabs(c[0]), std::fabs(c[1]), std::fabs(c[2])}) <= length_max))
      status = fail(BC_BAD_POSE, "centres[%lld] is not finite, or exceeds 1e50 m", (long long)box);
    way.centres.push_back({c[0], c[1], c[2]});
  }
  way.times = given.times;
  way.clearance = given.clearance, way.tolerance = given.tolerance;
  way.most_pairs = given.most_pairs, way.most_looks = given.most_looks;
  return status;
}

bc_status make_path(const bc_way& given, bc_path** path) {
  const Kernel* kernel = chosen_kernel();
  if (!kernel) return refuse_environment();
  motion::Way way{};
  if (bc_status status = read_way(given, way)) return status;
  int64_t standing = 0;
  for (const bc_index* index : {given.around, given.beside})
    if (index) way.around.push_back(index), standing = std::max(standing, int64_t(index->count()));
  auto own = given.filter ? nullptr : every_pair(standing);
  way.filter = given.filter ? given.filter : own.get();
  if (standing > way.filter->count())
    return fail(BC_BAD_ARGUMENT, "the filter has %lld boxes, and %lld stand",
                (long long)way.filter->count(), (long long)standing);
  for (int64_t box = 0; box < given.count; ++box) {
    int64_t number = given.numbers ? given.numbers[box] : way.filter->count() + box;
    if (!is_box(number, INT32_MAX))
      return fail(BC_BAD_ROWS, "numbers[%lld] is %lld", (long long)box, (long long)number);
    way.numbers.push_back(number);
  }
  *path = new bc_path{std::move(own), motion::Path(std::move(way), *kernel), given};
  return BC_OK;
}

bc_status advance(bc_path& self, int64_t work, bool& is_done) {
  is_done = self.path.advance(work);
  double at = self.path.ended_at();
  switch (self.path.ending()) {
    case motion::Ending::none:
      return BC_OK;
    case motion::Ending::too_many_pairs:
      return fail(BC_TOO_MUCH,
                  "more than %lld pairs come within the clearance of %g m: ask for fewer boxes or a "
                  "smaller clearance, or list pairs",
                  (long long)self.way.most_pairs, self.way.clearance);
    case motion::Ending::too_many_looks:
      return fail(BC_TOO_MUCH,
                  "%.0f looks at pairs within the clearance of %g m are more than %lld: ask for fewer "
                  "boxes or poses or a smaller clearance, or list pairs",
                  at, self.way.clearance, (long long)self.way.most_looks);
    case motion::Ending::rounding:
      break;
  }
  return fail(BC_BAD_ARGUMENT,
              "tolerance %g is below %.3g m, the least that rounding allows at these coordinates",
              self.way.tolerance, at);
}

}  // namespace
}  // namespace box_contact::detail

extern "C" {

bc_status bc_filter_create(const bc_filter_rows* rows, bc_filter** filter) {
  return guarded([&] {
    if (!rows || !filter) return refuse_null(rows ? "filter" : "rows");
    *filter = nullptr;
    bc_filter_rows all{};
    if (!read(rows, all)) return fail(BC_BAD_ABI, "rows.size is unknown");
    auto made = std::make_unique<bc_filter>();
    bc_status status = read_filter(all, *made);
    if (!status) *filter = made.release();
    return status;
  });
}

void bc_filter_destroy(bc_filter* filter) { delete filter; }

bc_status bc_filter_sides(const bc_filter* filter, const int64_t* pairs, int64_t count,
                          uint8_t* sides) {
  return guarded([&] {
    if (!filter || !pairs || !sides)
      return refuse_null(!filter ? "filter" : pairs ? "sides" : "pairs");
    for (int64_t k = 0; k < count; ++k) {
      const int64_t* pair = pairs + 2 * k;
      if (!is_box(pair[0], INT32_MAX) || !is_box(pair[1], INT32_MAX))
        return fail(BC_BAD_ROWS, "pairs[%lld] is (%lld, %lld)", (long long)k, (long long)pair[0],
                    (long long)pair[1]);
      uint8_t listed = filter->listed_side(pair[0], pair[1]);
      sides[k] = listed ? uint8_t(4 + listed) : filter->side(pair[0], pair[1]);
    }
    return BC_OK;
  });
}

bc_status bc_index_create(const bc_size* sizes, const bc_pose* poses, int64_t count,
                          bc_index** index) {
  return guarded([&] {
    if (!index) return refuse_null("index");
    *index = nullptr;
    return make_index(nullptr, nullptr, sizes, poses, count, index);
  });
}

bc_status bc_index_change(const bc_index* former, const int64_t* kept, const bc_size* sizes,
                          const bc_pose* poses, int64_t count, bc_index** index) {
  return guarded([&] {
    if (!index || !former || !kept)
      return refuse_null(!index ? "index" : former ? "kept" : "former");
    *index = nullptr;
    return make_index(former, kept, sizes, poses, count, index);
  });
}

void bc_index_destroy(bc_index* index) { delete index; }

bc_status bc_index_near(const bc_index* index, const bc_size* sizes, const bc_pose* poses,
                        int64_t count, double margin, int64_t* pairs, int64_t capacity,
                        int64_t* found) {
  return guarded([&] {
    if (!index || !found) return refuse_null(index ? "found" : "index");
    if (count && (!sizes || !poses)) return refuse_null(sizes ? "poses" : "sizes");
    return find_near(*index, sizes, poses, count, margin, pairs, capacity, *found);
  });
}

bc_status bc_movers_create(const bc_size* sizes, int64_t count, double margin,
                           const bc_filter* filter, const bc_index* index, bc_movers** movers) {
  return guarded([&] {
    if (!movers) return refuse_null("movers");
    *movers = nullptr;
    return make_movers(sizes, count, margin, filter, index, movers);
  });
}

void bc_movers_destroy(bc_movers* movers) { delete movers; }

bc_status bc_movers_find(bc_movers* movers, const bc_pose* poses, int64_t most, bc_near* near) {
  return guarded([&] {
    if (!movers || !near) return refuse_null(near ? "movers" : "near");
    if (near->size != sizeof(bc_near)) return fail(BC_BAD_ABI, "near.size is unknown");
    if (movers->movers.count() && !poses) return refuse_null("poses");
    if (most < 0)
      return fail(BC_BAD_ARGUMENT, "most must be 0 or more, not %lld", (long long)most);
    return answer(movers->movers, poses, movers->movers.find(numbers(poses), most), *near);
  });
}

bc_status bc_path_create(const bc_way* way, bc_path** path) {
  return guarded([&] {
    if (!way || !path) return refuse_null(way ? "path" : "way");
    *path = nullptr;
    bc_way all{};
    if (!read(way, all)) return fail(BC_BAD_ABI, "way.size is unknown");
    return make_path(all, path);
  });
}

void bc_path_destroy(bc_path* path) { delete path; }

bc_status bc_path_advance(bc_path* path, int64_t work, bool* is_done) {
  return guarded([&] {
    if (!path || !is_done) return refuse_null(path ? "is_done" : "path");
    return advance(*path, work, *is_done);
  });
}

bc_status bc_path_read(const bc_path* path, bc_path_found* found) {
  return guarded([&] {
    if (!path || !found) return refuse_null(path ? "found" : "path");
    if (found->size != sizeof(bc_path_found)) return fail(BC_BAD_ABI, "found.size is unknown");
    const auto& of = path->path;
    *found = {sizeof(bc_path_found),
              of.impacts().data(),
              int64_t(of.impacts().size()),
              reinterpret_cast<const int64_t*>(of.held().data()),
              int64_t(of.held().size()),
              of.least().empty() ? nullptr : of.least().data()};
    return BC_OK;
  });
}

}  // extern "C"
