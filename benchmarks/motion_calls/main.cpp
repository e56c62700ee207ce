// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Times of impact and least distances of libbox_contact: how many distances each takes, its time, and
// what a judge says of it.
//
// motion MOTIONS TOLERANCE TIMED SAMPLED ANSWERS: MOTIONS has rows of `Row`. ANSWERS gets
// `Answer`, a row each. The first TIMED motions are timed. The first SAMPLED are also checked each mm.
#include <limits>

#include "judge.hpp"
#include "motion/least_distance.hpp"
#include "rows.hpp"

namespace {

namespace motion = box_contact::BOX_CONTACT_SET::motion;

struct Answer {
  double time, time_distances, late, early;  // late: 1 refuted, 0.5 in doubt
  double least, least_distances, too_high, error;  // [m]; too_high as `late`
  double distance_ns, time_ns, least_ns;
  double sampled, sampled_ns;  // the first sample that touches, or NaN
};

bc_sweep sweep(const double* start, const double* end, const double* size, const double* centre) {
  bc_sweep found;
  std::copy_n(start, 7, found.start.position);
  std::copy_n(end, 7, found.end.position);
  std::copy_n(size, 3, found.size.extent);
  std::copy_n(centre, 3, found.centre);
  return found;
}

void check(bc_status status) {
  if (status != BC_OK) fail(bc_error_text());
}

long distances = 0;

// The core's own search on a kernel that counts: the library tells no counts.
bool counted(const box_contact::detail::PairNumbers& pair, bc_nearest& nearest) {
  ++distances;
  bc_box a, b;
  std::copy_n(pair.pose_a, 7, a.pose.position);
  std::copy_n(pair.pose_b, 7, b.pose.position);
  std::copy_n(pair.size_a, 3, a.size.extent);
  std::copy_n(pair.size_b, 3, b.size.extent);
  return bc_distance(&a, &b, &nearest) == BC_OK;
}

motion::Motion motion_of(const Row& row) {
  motion::Motion found;
  if (found.set({row.start_a, row.end_a, row.size_a, row.centre_a},
                {row.start_b, row.end_b, row.size_b, row.centre_b}) >= 0)
    fail("a turn has two ways");
  return found;
}

// The verdict each millimetre: what a planner without a time of impact does.
double sampled(const motion::Motion& ways) {
  long count = long(std::ceil(ways.fastest / 1e-3)) + 1;
  bc_query query = bc_default_query();
  query.patch = BC_NO_PATCH;
  for (long k = 0; k <= count; ++k) {
    double s = double(k) / double(count);
    motion::Instant now = ways.at(s);
    bc_box boxes[2];
    for (int of = 0; of < 2; ++of) {
      auto pose = ways.pose(of, now);
      std::copy_n(pose.position.v, 7, boxes[of].pose.position);
      std::copy_n(ways.sizes[of].v, 3, boxes[of].size.extent);
    }
    bc_contact contact;
    check(bc_collide(&boxes[0], &boxes[1], &query, &contact));
    if (contact.colliding) return s;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

double worth(judge::Verdict verdict) {
  return verdict == judge::Verdict::proved ? 0.0 : verdict == judge::Verdict::refuted ? 1.0 : 0.5;
}

Answer answer(const Row& row, double tolerance, bool is_timed, bool is_sampled) {
  const bc_sweep a = sweep(row.start_a, row.end_a, row.size_a, row.centre_a);
  const bc_sweep b = sweep(row.start_b, row.end_b, row.size_b, row.centre_b);
  bc_approach first{}, least{};
  first.size = least.size = sizeof(bc_approach);
  check(bc_time_of_impact(&a, &b, row.clearance, tolerance, &first));
  check(bc_least_distance(&a, &b, tolerance, &least));

  box_contact::detail::Kernel kernel{};
  kernel.nearest_pair = counted;
  motion::Motion ways = motion_of(row);
  motion::Near near;
  Answer found{};
  distances = 0;
  motion::Follower follower(ways, kernel);
  bool is_hit = motion::find_time_of_impact(follower, row.clearance, tolerance, near);
  found.time_distances = double(distances);
  if (is_hit ? near.s != first.time : first.time == first.time) fail("the core says another time");
  distances = 0;
  motion::Follower other(ways, kernel);
  near = motion::LeastDistance(other, tolerance).find();
  found.least_distances = double(distances);
  if (near.s != least.time) fail("the core says another least distance");

  judge::Judge judge(a, b);
  judge::Real doubt = ways.rounding;
  found.time = first.time, found.least = least.nearest.distance;
  bool is_free = first.time != first.time;
  found.late = worth(judge.stays_above(row.clearance, is_free ? 1.0L : first.time, 0));
  if (!is_free && !first.nearest.colliding)
    found.early = judge::distance(judge.at(first.time)) > row.clearance + tolerance;
  if (least.nearest.distance > tolerance) {
    found.too_high = worth(judge.stays_above(least.nearest.distance - tolerance, 1.0L, 0));
    found.error = double(std::fabs(judge::distance(judge.at(least.time)) - least.nearest.distance));
    if (found.error > doubt) found.too_high = 1.0;
  } else {  // touching: nothing does before
    found.too_high = worth(judge.stays_above(0, least.time, 0));
  }
  if (is_timed) {
    bc_box box_a{a.start, a.size}, box_b{b.start, b.size};
    bc_nearest nearest;
    nearest.size = sizeof nearest;
    found.distance_ns = nanoseconds([&] { bc_distance(&box_a, &box_b, &nearest); });
    found.time_ns =
        nanoseconds([&] { bc_time_of_impact(&a, &b, row.clearance, tolerance, &first); });
    found.least_ns = nanoseconds([&] { bc_least_distance(&a, &b, tolerance, &least); });
  }
  if (is_sampled) {
    auto begin = Clock::now();
    found.sampled = sampled(ways);
    found.sampled_ns = std::chrono::duration<double, std::nano>(Clock::now() - begin).count();
  }
  return found;
}

}  // namespace

int main(int count, char** words) {
  if (count != 6) fail("usage: motion MOTIONS TOLERANCE TIMED SAMPLED ANSWERS");
  std::FILE *from = std::fopen(words[1], "rb"), *to = std::fopen(words[5], "wb");
  if (!from || !to) fail("a file cannot be opened");
  double tolerance = std::strtod(words[2], nullptr);
  long timed = std::strtol(words[3], nullptr, 10), sampled = std::strtol(words[4], nullptr, 10);
  Row row;
  for (long k = 0; std::fread(&row, sizeof row, 1, from) == 1; ++k) {
    Answer found = answer(row, tolerance, k < timed, k < sampled);
    std::fwrite(&found, sizeof found, 1, to);
  }
  return std::fclose(to) ? 1 : 0;
}
