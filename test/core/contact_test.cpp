// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Hard poses against their 60-digit truth, and laws, for the C++ core.
//
// usage: contact_test FAMILIES [ANSWERS]
//
// FAMILIES has a line for each pair: its family and 24 numbers. The numbers are two poses, two
// sizes, the true gap, and the true centroid from A's position. An unknown centroid is NaN.
// The test writes verdicts, separations and normals to ANSWERS, for comparison with other machines.
// The exit status is 1 if a check failed.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "box_contact/inline.hpp"

// Pairs that are drawn here have the same bits by all compilers. The header does not need this.
#if defined(__clang__)
#pragma clang fp contract(off)
#else
#pragma GCC optimize("fp-contract=off", "no-tree-slp-vectorize")
#endif

namespace {

using box_contact::Contact;
using box_contact::Counts;
using box_contact::Rows;
using box_contact::Solver;

// --- Checks ---

long failures = 0;

// Report a check that failed; the first twenty are printed. `row` −1: no row of its own.
void check(bool holds, const char* model, const char* what, long row = -1) {
  if (holds) return;
  if (++failures <= 20) std::printf("FAILED %s: %s (row %ld)\n", model, what, row);
}

bool same_bits(double a, double b) {
  return std::memcmp(&a, &b, sizeof a) == 0 || (std::isnan(a) && std::isnan(b));
}

// --- Pairs and answers, a row a pair ---

struct Pairs {
  std::vector<double> poses_a, poses_b, sizes_a, sizes_b;

  long count() const { return long(poses_a.size() / 7); }
  void add(const double* pose_a, const double* pose_b, const double* size_a, const double* size_b) {
    poses_a.insert(poses_a.end(), pose_a, pose_a + 7);
    poses_b.insert(poses_b.end(), pose_b, pose_b + 7);
    sizes_a.insert(sizes_a.end(), size_a, size_a + 3);
    sizes_b.insert(sizes_b.end(), size_b, size_b + 3);
  }
  // Largest extent of both boxes, and largest coordinate [m].
  double size(long row) const {
    return std::max(*std::max_element(&sizes_a[3 * row], &sizes_a[3 * row] + 3),
                    *std::max_element(&sizes_b[3 * row], &sizes_b[3 * row] + 3));
  }
  double reach(long row) const {
    double most = 0.0;
    for (int k = 0; k < 3; ++k)
      most = std::max({most, std::fabs(poses_a[7 * row + k]), std::fabs(poses_b[7 * row + k])});
    return most;
  }
};

struct Truth {
  std::vector<std::string> family;
  std::vector<double> gap, centroid;
};

struct Answers {
  std::unique_ptr<bool[]> colliding;
  std::vector<double> separation, normal, point, volume, covariance;

  explicit Answers(long count)
      : colliding(new bool[count]()),
        separation(count),
        normal(3 * count),
        point(3 * count),
        volume(count),
        covariance(9 * count) {}
  Solver::Results results() {
    return {colliding.get(), separation.data(), normal.data(),
            point.data(),    volume.data(),     covariance.data()};
  }
};

Answers solve(const Solver& solver, const Pairs& pairs) {
  Answers answers(pairs.count());
  long refused = solver.batch(pairs.poses_a.data(), pairs.poses_b.data(), pairs.sizes_a.data(),
                              pairs.sizes_b.data(), pairs.count(), answers.results());
  check(refused == -1, "batch", "accepts all rows", refused);
  return answers;
}

Pairs read_families(const char* path, Truth& truth) {
  std::ifstream file(path);
  std::string line;
  Pairs pairs;
  while (std::getline(file, line)) {
    size_t name = line.find(' ');
    const char* place = line.c_str() + name;
    double numbers[24];
    for (double& number : numbers) {
      char* end;
      number = std::strtod(place, &end);
      if (end == place) throw std::runtime_error("bad line: " + line);
      place = end;
    }
    pairs.add(numbers, numbers + 7, numbers + 14, numbers + 17);
    truth.family.push_back(line.substr(0, name));
    truth.gap.push_back(numbers[20]);
    truth.centroid.insert(truth.centroid.end(), numbers + 21, numbers + 24);
  }
  return pairs;
}

// Random boxes, some of them almost parallel or far from the origin. Only integers and the four
// operations make them, so every machine draws the same doubles.
Pairs random_pairs(long count) {
  std::mt19937_64 bits(2026);
  auto uniform = [&](double low, double high) {
    return low + (high - low) * (double(bits() >> 11) * 0x1p-53);
  };
  Pairs pairs;
  for (long row = 0; row < count; ++row) {
    double a[7], b[7], size_a[3], size_b[3];
    double tilt = std::ldexp(1.0, -int(bits() % 60)), far = row % 4 == 3 ? 1e6 : 0.0;
    for (int k = 0; k < 3; ++k) size_a[k] = uniform(0.1, 3.0), size_b[k] = uniform(0.1, 3.0);
    for (int k = 0; k < 3; ++k) a[k] = uniform(-far, far), b[k] = a[k] + uniform(-1.5, 1.5);
    for (int k = 3; k < 7; ++k) a[k] = uniform(-1.0, 1.0);
    for (int k = 3; k < 7; ++k)
      b[k] = row % 2 ? uniform(-1.0, 1.0) : a[k] + tilt * uniform(-1.0, 1.0);
    pairs.add(a, b, size_a, size_b);
  }
  return pairs;
}

// --- Geometry that shares no code with the core ---

struct Box {
  double axes[3][3], half[3];  // axes[c]: unit vector of the box's axis c

  Box(const double* pose, const double* size) {
    double x = pose[3], y = pose[4], z = pose[5], w = pose[6];
    double n = 2.0 / (x * x + y * y + z * z + w * w);
    double found[3][3] = {{1 - n * (y * y + z * z), n * (x * y + z * w), n * (x * z - y * w)},
                          {n * (x * y - z * w), 1 - n * (x * x + z * z), n * (y * z + x * w)},
                          {n * (x * z + y * w), n * (y * z - x * w), 1 - n * (x * x + y * y)}};
    std::memcpy(axes, found, sizeof axes);
    for (int c = 0; c < 3; ++c) half[c] = 0.5 * size[c];
  }
  static double dot(const double* a, const double* b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  }
  double half_width(const double* n) const {
    double sum = 0.0;
    for (int c = 0; c < 3; ++c) sum += half[c] * std::fabs(dot(axes[c], n));
    return sum;
  }
  // By how much a point, given from the box's centre, is outside.
  double beyond(const double* point) const {
    double most = -std::numeric_limits<double>::infinity();
    for (int c = 0; c < 3; ++c) most = std::max(most, std::fabs(dot(axes[c], point)) - half[c]);
    return most;
  }
};

// The gap from A to B along a direction [m].
double gap_along(const Pairs& pairs, long row, const double* n) {
  Box a(&pairs.poses_a[7 * row], &pairs.sizes_a[3 * row]);
  Box b(&pairs.poses_b[7 * row], &pairs.sizes_b[3 * row]);
  double offset[3];
  for (int k = 0; k < 3; ++k) offset[k] = pairs.poses_b[7 * row + k] - pairs.poses_a[7 * row + k];
  return Box::dot(offset, n) - a.half_width(n) - b.half_width(n);
}

// By how much a point is outside the box that it is farther out of [m].
double outside(const Pairs& pairs, long row, const double* point) {
  double most = -std::numeric_limits<double>::infinity();
  for (bool of_a : {true, false}) {
    const double* pose = &(of_a ? pairs.poses_a : pairs.poses_b)[7 * row];
    Box box(pose, &(of_a ? pairs.sizes_a : pairs.sizes_b)[3 * row]);
    double from[3] = {point[0] - pose[0], point[1] - pose[1], point[2] - pose[2]};
    most = std::max(most, box.beyond(from));
  }
  return most;
}

constexpr double eps = std::numeric_limits<double>::epsilon();

// Of separations [m].
double tolerance(const Pairs& pairs, long row) {
  return 1e-12 * pairs.size(row) + 8 * eps * pairs.reach(row);
}
// Depth or gap up to which either verdict is right: twice what counts as touching [m].
double unsure(const Pairs& pairs, long row) {
  double x = std::max(pairs.reach(row), pairs.size(row));
  return 2 * 8 * (std::nextafter(x, std::numeric_limits<double>::infinity()) - x);
}

// --- Truth ---

void check_truth(const char* model, const Pairs& pairs, const Truth& truth, const Answers& found) {
  bool exact = std::strcmp(model, "exact") == 0;
  for (long row = 0; row < pairs.count(); ++row) {
    double gap = truth.gap[row], size = pairs.size(row), reach = pairs.reach(row);
    double separation = found.separation[row];
    const double *normal = &found.normal[3 * row], *point = &found.point[3 * row];
    bool colliding = found.colliding[row];
    check(colliding == (gap <= 0.0) || std::fabs(gap) <= unsure(pairs, row), model,
          "the verdict is that of the true gap", row);
    if (!colliding) {
      check(separation > 0.0 && std::isfinite(separation), model, "apart: separation > 0", row);
      // Skipped axes cost a gap, never add to it.
      check(separation <= gap + tolerance(pairs, row), model, "apart: at most the gap", row);
      for (int k = 0; k < 3; ++k)
        check(std::isnan(normal[k]) && std::isnan(point[k]), model, "apart: NaN", row);
      continue;
    }
    check(std::fabs(separation - gap) <= tolerance(pairs, row), model, "separation", row);
    check(std::fabs(Box::dot(normal, normal) - 1.0) <= 1e-12, model, "the normal is unit", row);
    check(gap_along(pairs, row, normal) >= gap - tolerance(pairs, row), model,
          "the gap along the normal is the largest", row);
    // A shallow contact has the point of boxes that were pressed in, along up to three axes.
    double pressed = 3e-9 * size;
    double slack = 0x1p-43 * (size + reach) + (separation > -0.34 * pressed ? pressed : 0.0);
    check(outside(pairs, row, point) <= slack, model, "the point is in both boxes", row);
    const double *centroid = &truth.centroid[3 * row], *origin = &pairs.poses_a[7 * row];
    if (std::isnan(centroid[0] + centroid[1] + centroid[2])) continue;
    double off = std::hypot(point[0] - origin[0] - centroid[0], point[1] - origin[1] - centroid[1],
                            point[2] - origin[2] - centroid[2]);
    const double *a = &pairs.sizes_a[3 * row], *b = &pairs.sizes_b[3 * row];
    double reach_a = std::max({std::fabs(origin[0]), std::fabs(origin[1]), std::fabs(origin[2])});
    double allowed =
        exact ? std::max(1e-9, 1e-14 * size / std::max(-gap, 1e-300)) * size + 8 * eps * reach_a
              : 0.01 * std::min(*std::max_element(a, a + 3), *std::max_element(b, b + 3));
    check(off <= allowed, model, "the point is the centroid", row);
  }
}

// --- Laws ---

void check_laws(const char* model, const Solver& solver, const Pairs& pairs, const Answers& found) {
  Answers swapped = solve(solver, {pairs.poses_b, pairs.poses_a, pairs.sizes_b, pairs.sizes_a});
  Pairs negated = pairs, scaled = pairs;
  for (long i = 0; i < long(pairs.poses_a.size()); ++i) {
    if (i % 7 >= 3) negated.poses_b[i] *= -1.0;
    if (i % 7 < 3) scaled.poses_a[i] *= 0x1p-20, scaled.poses_b[i] *= 0x1p-20;
  }
  for (double& extent : scaled.sizes_a) extent *= 0x1p-20;
  for (double& extent : scaled.sizes_b) extent *= 0x1p-20;
  Answers same = solve(solver, negated), small = solve(solver, scaled);
  for (long row = 0; row < pairs.count(); ++row) {
    double separation = found.separation[row];
    check(swapped.colliding[row] == found.colliding[row], model, "swap keeps the verdict", row);
    check(same_bits(swapped.separation[row], separation), model, "swap keeps the separation", row);
    if (found.colliding[row]) {
      double reversed[3];
      for (int k = 0; k < 3; ++k) reversed[k] = -swapped.normal[3 * row + k];
      check(std::fabs(gap_along(pairs, row, reversed) - separation) <= 2 * tolerance(pairs, row),
            model, "swap reverses the normal, or takes one as good", row);
    }
    check(
        same.colliding[row] == found.colliding[row] && same_bits(same.separation[row], separation),
        model, "q and -q", row);
    check(small.colliding[row] == found.colliding[row] &&
              same_bits(0x1p20 * small.separation[row], separation),
          model, "scale by a power of two", row);
    for (long i = 3 * row; i < 3 * row + 3; ++i) {
      check(same_bits(same.normal[i], found.normal[i]) && same_bits(same.point[i], found.point[i]),
            model, "q and -q", row);
      check(same_bits(small.normal[i], found.normal[i]) &&
                same_bits(0x1p20 * small.point[i], found.point[i]),
            model, "scale by a power of two", row);
    }
    check(same_bits(same.volume[row], found.volume[row]), model, "q and -q", row);
    check(same_bits(0x1p60 * small.volume[row], found.volume[row]), model,
          "scale by a power of two", row);
    for (long i = 9 * row; i < 9 * row + 9; ++i) {
      check(same_bits(same.covariance[i], found.covariance[i]), model, "q and -q", row);
      check(same_bits(0x1p40 * small.covariance[i], found.covariance[i]), model,
            "scale by a power of two", row);
    }
  }
}

void check_row(const char* model, const char* law, const Answers& found, long row,
               const Contact& one) {
  check(one.colliding == found.colliding[row] && same_bits(one.separation, found.separation[row]),
        model, law, row);
  for (int k = 0; k < 3; ++k)
    check(same_bits(one.normal[k], found.normal[3 * row + k]) &&
              same_bits(one.point[k], found.point[3 * row + k]),
          model, law, row);
  check(same_bits(one.volume, found.volume[row]), model, law, row);
  for (int k = 0; k < 9; ++k)
    check(same_bits(one.covariance[k / 3][k % 3], found.covariance[9 * row + k]), model, law, row);
}

Solver::Pose pose_of(const double* p) { return {{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}}; }
Solver::Size size_of(const double* s) { return {s[0], s[1], s[2]}; }

// Every row as a single call, and as each row of batches of every short length.
void check_rows(const char* name, Solver::Model model, const Pairs& pairs, const Answers& found) {
  for (long row = 0; row < pairs.count(); ++row) {
    Solver::Size a = size_of(&pairs.sizes_a[3 * row]), b = size_of(&pairs.sizes_b[3 * row]);
    Solver solver(a, b, model);
    check_row(name, "a row is its single call", found, row,
              solver(pose_of(&pairs.poses_a[7 * row]), pose_of(&pairs.poses_b[7 * row])));
  }
  Solver solver({1, 1, 1}, {1, 1, 1}, model);
  long most = 2 * Solver::lanes + 1;
  for (long first = 0, count = 1; first + count <= pairs.count();
       first += count, count = count % most + 1) {
    Answers some(count + 1);
    some.separation[count] = 7.0;
    solver.batch(&pairs.poses_a[7 * first], &pairs.poses_b[7 * first], &pairs.sizes_a[3 * first],
                 &pairs.sizes_b[3 * first], count, some.results());
    for (long i = 0; i < count; ++i) {
      Contact one{some.colliding[i],
                  some.separation[i],
                  size_of(&some.normal[3 * i]),
                  size_of(&some.point[3 * i]),
                  some.volume[i],
                  {},
                  0};
      std::memcpy(one.covariance.m, &some.covariance[9 * i], sizeof(one.covariance.m));
      check_row(name, "a row is that of any batch", found, first + i, one);
    }
    check(some.separation[count] == 7.0, name, "nothing is written beyond the last row", first);
  }
}

// Verdict, separation and normal alone, which compile in a second for every width.
struct NoPoint {
  template <class T>
  using Found = box_contact::PointAndVolume<T>;
  template <class T>
  [[maybe_unused]] static constexpr int group = 1;
  using Rest = void;
  template <class T>
  void solve(const box_contact::Query<T> (&)[1], Found<T> (&)[1], unsigned (&)[1], Counts&) const {}
};
template <class T>
[[maybe_unused]] void check_width(const char* width, const Pairs& pairs, const Answers& found) {
  Answers other(pairs.count());
  Rows rows{pairs.poses_a.data(),
            pairs.poses_b.data(),
            pairs.sizes_a.data(),
            pairs.sizes_b.data(),
            3,
            3,
            nullptr};
  Counts counts{};
  Solver::Results to = other.results();
  box_contact::solve_rows<T>(
      NoPoint{}, rows, 0, pairs.count(),
      {to.colliding, to.separation, to.normal, to.point, nullptr, nullptr, nullptr, 0.0}, counts);
  for (long row = 0; row < pairs.count(); ++row) {
    check(other.colliding[row] == found.colliding[row] &&
              same_bits(other.separation[row], found.separation[row]),
          width, "same bits of verdict and separation", row);
    for (long i = 3 * row; i < 3 * row + 3; ++i)
      check(same_bits(other.normal[i], found.normal[i]), width, "same bits of the normal", row);
  }
}
// Check the widths that neither single calls nor the solver's batches have. Vectors of one lane are
// left out: g++ 12 compiles them wrongly, and nothing uses them.
void check_widths([[maybe_unused]] const Pairs& pairs, [[maybe_unused]] const Answers& found) {
#if defined(__AVX2__)
  check_width<box_contact::Lanes<double, 2>>("2 lanes", pairs, found);
#endif
#if defined(__AVX512F__)
  check_width<box_contact::Lanes<double, 4>>("4 lanes", pairs, found);
#endif
}

// --- Pairs by name ---

// Contact counts up to 8 ulp, and a real gap beyond is a gap.
void check_touch(const Solver& cubes) {
  for (int ulps = 0; ulps < 20; ++ulps) {
    Contact found = cubes({{0, 0, 0}, {0, 0, 0, 1}}, {{1.0 + ulps * 0x1p-52, 0, 0}, {0, 0, 0, 1}});
    check(found.colliding == (ulps <= 8) && found.separation == ulps * 0x1p-52, "exact",
          "touching counts up to 8 ulp", ulps);
  }
}

// Cubes that touch at a corner or along an edge, in any orientation. They have no overlap until B
// is pressed in along several axes. Rounding tilts them by 1e-16, and a depth of 1e-9 magnifies
// the tilt to 1e-7.
void check_corners(const char* model, const Solver& cubes) {
  std::mt19937_64 bits(7);
  for (long turn = 0; turn < 300; ++turn) {
    double q[4] = {0, 0, 0, 1}, offset[3] = {1, 1, turn % 2 ? 1.0 : 0.0};
    if (turn >= 2)
      for (double& part : q) part = double(bits() >> 11) * 0x1p-52 - 1.0;
    const double pose[7] = {0, 0, 0, q[0], q[1], q[2], q[3]}, size[3] = {1, 1, 1};
    Box box(pose, size);
    double place[3] = {};
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 3; ++k) place[k] += offset[c] * box.axes[c][k];
    Contact found = cubes({{0, 0, 0}, {q[0], q[1], q[2], q[3]}},
                          {{place[0], place[1], place[2]}, {q[0], q[1], q[2], q[3]}});
    double off = 0.0;
    for (int k = 0; k < 3; ++k) off = std::max(off, std::fabs(found.point[k] - 0.5 * place[k]));
    check(found.colliding && off < 1e-7, model, "the point is where corners or edges touch", turn);
  }
}

// Edges along each other to 1e-9 rad: only double-double sees the gap of 1e-9 of the size.
void check_near_parallel_edges() {
  Solver solver({2.636034007520441, 0.04718327345567861, 1.1853955253154986},
                {0.6785790000111154, 1.842483032467027, 1.099002126224811});
  Contact found =
      solver({{0, 0, 0}, {0, 0, 0, 1}},
             {{1.8675180668730165, 0.36288113673398403, 0.3285437535754884},
              {-0.5000000000000665, -0.500000000000317, -0.500000000000147, -0.4999999999994721}});
  check(!found.colliding, "exact", "edges almost along each other that miss");
}

// --- Refusals ---

template <class Error, class Call>
void check_throws(const char* words, const Call& call) {
  try {
    call();
    check(false, "throws", words);
  } catch (const Error& error) {
    check(std::strstr(error.what(), words) != nullptr, error.what(), words);
  }
}

void check_refusals() {
  using Bad = std::invalid_argument;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const Solver::Size cube{1, 1, 1};
  check_throws<Bad>("size_a (nan, 1, 1)", [&] { Solver({nan, 1, 1}, cube); });
  check_throws<Bad>("size_a (1, 0, 1)", [&] { Solver({1, 0, 1}, cube); });
  check_throws<Bad>("size_b (1, 1, -1)", [&] { Solver(cube, {1, 1, -1}); });
  check_throws<Bad>("size_b (1, inf, 1)", [&] { Solver(cube, {1, infinity, 1}); });
  check_throws<Bad>("size_b (1, 1e-51, 1)", [&] { Solver(cube, {1, 1e-51, 1}); });
  check_throws<Bad>("size_b (1, 1.1e+50, 1)", [&] { Solver(cube, {1, 1.1e50, 1}); });

  const Solver solver(cube, cube);
  const Solver::Pose good{{0, 0, 0}, {0, 0, 0, 1}};
  auto pose = [&](int place, double value) {
    Solver::Pose p = good;
    (place < 3 ? p.position[place] : p.quaternion[place - 3]) = value;
    return p;
  };
  check_throws<Bad>("pose_a position (0, nan, 0)", [&] { solver(pose(1, nan), good); });
  check_throws<Bad>("pose_b position (0, 0, -inf)", [&] { solver(good, pose(2, -infinity)); });
  check_throws<Bad>("pose_b position (1.1e+50, 0, 0)", [&] { solver(good, pose(0, 1.1e50)); });
  check_throws<Bad>("pose_a quaternion (0, 0, 0, 0)", [&] { solver(pose(6, 0.0), good); });
  check_throws<Bad>("pose_b quaternion (0, nan, 0, 1) is not finite",
                    [&] { solver(good, pose(4, nan)); });
  check_throws<Bad>("pose_a quaternion (0, 0, 0, 1e+200)", [&] { solver(pose(6, 1e200), good); });
  check_throws<Bad>("pose_a quaternion (0, 0, 0, 1e-160)", [&] { solver(pose(6, 1e-160), good); });
  check(solver(pose(6, -1e99), pose(6, 1e-99)).separation == -1.0, "exact", "any length");

  for (long bad_row = 0; bad_row < 21; ++bad_row) {
    Pairs pairs;
    const double plain[7] = {0, 0, 0, 0, 0, 0, 1}, zero[7] = {};
    for (long row = 0; row < 20; ++row)
      pairs.add(plain, row == bad_row || row == 17 ? zero : plain, cube.v, cube.v);
    Answers found(20);
    long refused = solver.batch(pairs.poses_a.data(), pairs.poses_b.data(), 20, found.results());
    check(refused == std::min(bad_row, 17L), "batch", "the first refused row", bad_row);
    for (long row = 0; row < 20; ++row) {
      bool good_row = row != bad_row && row != 17;
      double separation = found.separation[row];
      check(found.colliding[row] == good_row, "batch", "the other rows are solved", row);
      check(good_row ? separation == -1.0 : std::isnan(separation), "batch", "NaN if refused", row);
    }
    pairs.sizes_b[3 * 5] = 0.0;
    refused = solver.batch(pairs.poses_a.data(), pairs.poses_b.data(), pairs.sizes_a.data(),
                           pairs.sizes_b.data(), 20, found.results());
    check(refused == std::min(bad_row, 5L), "batch", "the first refused size", bad_row);
  }
  Answers nothing(0);
  check(solver.batch(nullptr, nullptr, 0, nothing.results()) == -1, "batch", "no rows");
}

void write_answers(std::FILE* file, const Answers& found, long count) {
  for (long row = 0; row < count; ++row) {
    std::fprintf(file, "%d %a", found.colliding[row], found.separation[row]);
    for (int k = 0; k < 3 && found.colliding[row]; ++k)
      std::fprintf(file, " %a", found.normal[3 * row + k]);
    std::fprintf(file, "\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 && argc != 3) {
    std::fprintf(stderr, "usage: contact_test FAMILIES [ANSWERS]\n");
    return 2;
  }
  Truth truth;
  Pairs hard = read_families(argv[1], truth), random = random_pairs(20000);
  constexpr Solver::Model by_exact = Solver::Model::exact, by_mlp = Solver::Model::mlp;
  Solver exact({1, 1, 1}, {1, 1, 1}, by_exact), mlp({1, 1, 1}, {1, 1, 1});
  Answers hard_exact = solve(exact, hard), hard_mlp = solve(mlp, hard);
  Answers random_exact = solve(exact, random), random_mlp = solve(mlp, random);

  check(hard.count() >= 2880, "families", "as many as there are");
  check_truth("exact", hard, truth, hard_exact);
  check_truth("mlp", hard, truth, hard_mlp);
  check_laws("exact", exact, hard, hard_exact);
  check_laws("mlp", mlp, hard, hard_mlp);
  check_laws("exact", exact, random, random_exact);
  check_rows("exact", by_exact, hard, hard_exact);
  check_rows("mlp", by_mlp, hard, hard_mlp);
  check_rows("exact", by_exact, random, random_exact);
  check_rows("mlp", by_mlp, random, random_mlp);
  check_widths(hard, hard_exact);
  check_widths(random, random_exact);
  check_touch(exact);
  check_corners("exact", exact);
  check_corners("mlp", mlp);
  check_near_parallel_edges();
  check_refusals();

  if (argc == 3) {
    std::FILE* file = std::fopen(argv[2], "w");
    if (!file) {
      std::perror(argv[2]);
      return 2;
    }
    write_answers(file, hard_exact, hard.count());
    write_answers(file, random_exact, random.count());
    std::fclose(file);
  }
  long contacts =
      std::count(&random_exact.colliding[0], &random_exact.colliding[random.count()], true);
  check(contacts > random.count() / 4 && contacts < random.count() * 3 / 4, "random pairs",
        "both verdicts are tested");
  std::printf("%ld hard pairs, %ld random pairs, %d lanes: %ld failures\n", hard.count(),
              random.count(), Solver::lanes, failures);
  return failures ? 1 : 0;
}
