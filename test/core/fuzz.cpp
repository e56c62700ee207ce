// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Adversarial and random poses through both models: no crash, and every contact holds its promises.
//
// usage: fuzz ROUNDS [SEED]
// Build it with sanitizers. A round draws some rows of pairs and a network of random weights. It
// solves the rows by single calls and as a batch, by model `exact` and by `mlp` with that network.
// The exit status is 1 if a check failed.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "box_contact/inline.hpp"

namespace {

using box_contact::Contact;
using box_contact::Counts;
using box_contact::ExactModel;
using box_contact::MlpModel;
using box_contact::Rows;
using box_contact::Solver;
using box_contact::detail::Results;
using box_contact::detail::unit_numbers;

// Longest by shortest extent of a pair up to which the point is in both boxes. Beyond 1e9 the
// shortest extent nears the rounding of the longest one. Points are then outside by up to 1e-8 of
// the longest extent.
constexpr double aspect_known = 1e8;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

struct Pair {
  double pose_a[7], pose_b[7], size_a[3], size_b[3];
};

// The largest extent of both boxes.
double largest(const Pair& p) {
  return std::max(*std::max_element(p.size_a, p.size_a + 3),
                  *std::max_element(p.size_b, p.size_b + 3));
}

class Draw {
 public:
  explicit Draw(unsigned long seed) : bits_(seed) {}

  int choice(int count) { return int(bits_() % unsigned(count)); }
  double uniform(double low, double high) {
    return low + (high - low) * (double(bits_() >> 11) * 0x1p-53);
  }
  double log_uniform(double low, double high) {
    return std::exp(uniform(std::log(low), std::log(high)));
  }
  double sign() { return choice(2) ? 1.0 : -1.0; }

  // A number that somebody's simulator may produce when it goes wrong.
  double bad_number() {
    const double numbers[] = {nan,    -nan,   infinity, -infinity, 0.0,    -0.0,
                              1e-320, 5e-324, 1e50,     -1e50,     1.1e50, 1e-50,
                              1e-51,  1e154,  1e-154,   1.7e308,   -1.0,   2.2e-308};
    return numbers[choice(sizeof numbers / sizeof *numbers)];
  }

  Pair pair() {
    Pair p;
    sizes(p);
    for (int k = 0; k < 7; ++k) p.pose_a[k] = k < 6 ? 0.0 : 1.0;
    if (choice(2)) orientation(p.pose_a + 3);
    if (choice(2)) position(p.pose_a);
    second_pose(p);
    if (choice(4) == 0) turn_both(p);
    if (choice(8) == 0) scale_quaternion(choice(2) ? p.pose_a : p.pose_b);
    if (choice(8) == 0) std::swap(p.pose_a, p.pose_b), std::swap(p.size_a, p.size_b);
    for (int bad = choice(12); bad > 9; --bad) {
      double* places[] = {p.pose_a, p.pose_b, p.size_a, p.size_b};
      int part = choice(4);
      places[part][choice(part < 2 ? 7 : 3)] = bad_number();
    }
    if (choice(64) == 0) std::fill(p.pose_b + 3, p.pose_b + 7, 0.0);
    return p;
  }

  // What a loader accepts: weights up to 1e4, most of them small.
  std::vector<float> network() {
    float most = choice(4) == 0 ? 1e4F : 1.0F;
    std::vector<float> numbers(size_t(1 + unit_numbers * choice(9)));
    for (float& number : numbers) number = choice(8) ? float(uniform(-most, most)) : 0.0F;
    return numbers;
  }

 private:
  void sizes(Pair& p) {
    double low = 0.1, high = 10.0;
    if (int kind = choice(10); kind == 0) {
      low = 1e-50, high = 1e50;
    } else if (kind == 1) {
      low = 1e-3, high = 1e3;
    } else if (kind == 2) {
      low = 1e-50, high = 1e-48;
    } else if (kind == 3) {
      low = 1e48, high = 1e50;
    }
    for (double& extent : p.size_a) extent = log_uniform(low, high);
    for (double& extent : p.size_b) extent = log_uniform(low, high);
    if (choice(3) == 0) std::copy(p.size_a, p.size_a + 3, p.size_b);
    if (choice(8) == 0)
      std::fill(p.size_a, p.size_a + 3, 2.0), std::fill(p.size_b, p.size_b + 3, 2.0);
  }
  void orientation(double* q) {
    if (choice(3) == 0) {  // a quarter or a third of a turn
      for (int k = 0; k < 4; ++k) q[k] = double(choice(3) - 1);
      if (std::none_of(q, q + 4, [](double x) { return x != 0.0; })) q[3] = 1.0;
    } else {
      for (int k = 0; k < 4; ++k) q[k] = uniform(-1.0, 1.0);
    }
  }
  void position(double* place) {
    double far = choice(4) == 0 ? log_uniform(1e-50, 1e50) : log_uniform(0.1, 1e7);
    for (int k = 0; k < 3; ++k) place[k] = sign() * uniform(0.0, far);
  }
  // B in A's frame, then in the common frame.
  void second_pose(Pair& p) {
    double offset[3], turn[4] = {0.0, 0.0, 0.0, 1.0};
    if (choice(3)) orientation(turn);
    if (choice(3) == 0) {
      double tilt = log_uniform(1e-17, 1.0);
      for (int k = 0; k < 3; ++k) turn[k] += tilt * uniform(-1.0, 1.0);
    }
    for (int k = 0; k < 3; ++k) {
      double both = 0.5 * (p.size_a[k] + p.size_b[k]), least = std::min(p.size_a[k], p.size_b[k]);
      switch (choice(6)) {
        case 0:
          offset[k] = 0.0;
          break;
        case 1:
          offset[k] = sign() * both;
          break;
        case 2:
          offset[k] = sign() * 0.5 * (p.size_a[k] - p.size_b[k]);
          break;
        case 3:
          offset[k] = sign() * (both - least * log_uniform(1e-16, 1.0));
          break;
        case 4:
          offset[k] = sign() * both * (1.0 + choice(9) * 0x1p-52);
          break;
        default:
          offset[k] = uniform(-both, both);
      }
    }
    double norm2 = 0.0;
    const double* q = p.pose_a + 3;
    for (int k = 0; k < 4; ++k) norm2 += q[k] * q[k];
    // v + 2 w (u × v) / n + 2 u × (u × v) / n.
    double cross[3], twice[3];
    for (int k = 0; k < 3; ++k) {
      int y = (k + 1) % 3, z = (k + 2) % 3;
      cross[k] = q[y] * offset[z] - q[z] * offset[y];
    }
    for (int k = 0; k < 3; ++k) {
      int y = (k + 1) % 3, z = (k + 2) % 3;
      twice[k] = q[y] * cross[z] - q[z] * cross[y];
    }
    for (int k = 0; k < 3; ++k)
      p.pose_b[k] = p.pose_a[k] + offset[k] + 2.0 * (q[3] * cross[k] + twice[k]) / norm2;
    product(q, turn, p.pose_b + 3);
  }
  static void product(const double* p, const double* q, double* found) {
    found[0] = p[3] * q[0] + p[0] * q[3] + p[1] * q[2] - p[2] * q[1];
    found[1] = p[3] * q[1] - p[0] * q[2] + p[1] * q[3] + p[2] * q[0];
    found[2] = p[3] * q[2] + p[0] * q[1] - p[1] * q[0] + p[2] * q[3];
    found[3] = p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2];
  }
  // Through float32, as poses from other programs.
  void turn_both(Pair& p) {
    for (double* pose : {p.pose_a, p.pose_b})
      for (int k = 0; k < 7; ++k)
        if (std::fabs(pose[k]) < 1e30) pose[k] = double(float(pose[k]));
  }
  void scale_quaternion(double* pose) {
    double factor = sign() * log_uniform(1e-99, 1e99);
    for (int k = 3; k < 7; ++k) pose[k] *= factor;
  }

  std::mt19937_64 bits_;
};

// --- What is promised ---

bool accepted(const double* pose, const double* size) {
  double norm2 = (pose[3] * pose[3] + pose[4] * pose[4]) + (pose[5] * pose[5] + pose[6] * pose[6]);
  bool good = norm2 >= 1e-100 * 1e-100 && norm2 <= 1e100 * 1e100;
  for (int k = 0; k < 3; ++k)
    good = good && std::fabs(pose[k]) <= 1e50 && size[k] >= 1e-50 && size[k] <= 1e50;
  return good;
}

// Whether the covariance has no negative eigenvalue, but for rounding in the common frame.
bool semidefinite(const Contact& found) {
  constexpr double slack = 1e-14;
  double c[3][3], determinant = 0.0;
  const auto& given = found.covariance;
  double trace = (given[0][0] + given[1][1]) + given[2][2];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[i][j] = given[i][j] / trace;
  for (int k = 0; k < 3; ++k) {
    int i = (k + 1) % 3, j = (k + 2) % 3;
    determinant += c[0][k] * (c[1][i] * c[2][j] - c[1][j] * c[2][i]);
    if (!(c[k][k] >= -slack && c[i][j] == c[j][i])) return false;
    if (!(c[i][i] * c[j][j] - c[i][j] * c[i][j] >= -slack)) return false;
  }
  return determinant >= -slack;
}

// By how much a point is outside a box [m].
double outside(const double* pose, const double* size, const Contact& contact) {
  double x = pose[3], y = pose[4], z = pose[5], w = pose[6];
  double scale = std::max({std::fabs(x), std::fabs(y), std::fabs(z), std::fabs(w)});
  x /= scale, y /= scale, z /= scale, w /= scale;
  double n = 2.0 / (x * x + y * y + z * z + w * w);
  double axes[3][3] = {{1 - n * (y * y + z * z), n * (x * y + z * w), n * (x * z - y * w)},
                       {n * (x * y - z * w), 1 - n * (x * x + z * z), n * (y * z + x * w)},
                       {n * (x * z + y * w), n * (y * z - x * w), 1 - n * (x * x + y * y)}};
  double most = -infinity;
  for (int c = 0; c < 3; ++c) {
    double along = 0.0;
    for (int k = 0; k < 3; ++k) along += axes[c][k] * (contact.point[k] - pose[k]);
    most = std::max(most, std::fabs(along) - 0.5 * size[c]);
  }
  return most;
}

long failures = 0, contacts = 0, refusals = 0, by_columns = 0;

void check(bool holds, const char* model, const char* what, const Pair& p) {
  if (holds || ++failures > 10) return;
  std::printf("FAILED %s: %s\n", model, what);
  for (auto [numbers, count] : {std::pair(p.pose_a, 7), std::pair(p.pose_b, 7),
                                std::pair(p.size_a, 3), std::pair(p.size_b, 3)}) {
    for (int k = 0; k < count; ++k) std::printf("%s%.17g", k ? ", " : "  (", numbers[k]);
    std::printf(")\n");
  }
}

void check_contact(const char* model, const Pair& p, const Contact& found) {
  if (!found.colliding) {
    check(found.separation > 0.0 && std::isfinite(found.separation), model, "gap", p);
    for (int k = 0; k < 3; ++k)
      check(std::isnan(found.normal[k]) && std::isnan(found.point[k]), model, "apart: NaN", p);
    check(found.volume == 0.0 && std::isnan(found.covariance[0][0]), model, "apart: no volume", p);
    return;
  }
  ++contacts;
  double size = largest(p), reach = 0.0, norm2 = 0.0;
  for (int k = 0; k < 3; ++k) {
    reach = std::max({reach, std::fabs(p.pose_a[k]), std::fabs(p.pose_b[k])});
    norm2 += found.normal[k] * found.normal[k];
    check(std::isfinite(found.point[k]), model, "the point is finite", p);
  }
  check(std::isfinite(found.separation), model, "the separation is finite", p);
  check(std::fabs(norm2 - 1.0) <= 1e-12, model, "the normal is unit", p);
  double pressed = 3e-9 * size;
  double slack = 0x1p-43 * (size + reach) + (found.separation > -0.34 * pressed ? pressed : 0.0);
  double least = std::min(*std::min_element(p.size_a, p.size_a + 3),
                          *std::min_element(p.size_b, p.size_b + 3));
  if (size > aspect_known * least) return;
  check(outside(p.pose_a, p.size_a, found) <= slack, model, "the point is in box A", p);
  check(outside(p.pose_b, p.size_b, found) <= slack, model, "the point is in box B", p);
}

bool same_bits(double a, double b) {
  return std::memcmp(&a, &b, sizeof a) == 0 || (std::isnan(a) && std::isnan(b));
}

// What a model finds of rows, each alone and as a batch.
struct Answers {
  std::vector<Contact> alone;  // those that are accepted
  std::vector<char> accepted;
};

template <class Model>
Answers check_rows(const char* name, const Model& model, const std::vector<Pair>& rows) {
  size_t count = rows.size();
  // Arrays of just this length: a sanitizer sees what is read or written beyond.
  std::vector<double> poses_a, poses_b, sizes_a, sizes_b;
  for (const Pair& p : rows) {
    poses_a.insert(poses_a.end(), p.pose_a, p.pose_a + 7);
    poses_b.insert(poses_b.end(), p.pose_b, p.pose_b + 7);
    sizes_a.insert(sizes_a.end(), p.size_a, p.size_a + 3);
    sizes_b.insert(sizes_b.end(), p.size_b, p.size_b + 3);
  }
  for (std::vector<double>* numbers : {&poses_a, &poses_b, &sizes_a, &sizes_b})
    numbers->shrink_to_fit();
  Rows all{poses_a.data(), poses_b.data(), sizes_a.data(), sizes_b.data(), 3, 3, nullptr};
  std::vector<char> colliding(count);
  std::vector<double> separation(count), normal(3 * count), point(3 * count);
  std::vector<double> volume(count), covariance(9 * count);
  Counts counts{};
  long refused = box_contact::solve_rows<box_contact::Lanes<double, Solver::lanes>>(
      model, all, 0, long(count),
      {reinterpret_cast<bool*>(colliding.data()), separation.data(), normal.data(), point.data(),
       volume.data(), covariance.data(), nullptr, 0.0},
      counts);
  long expected = -1;
  Answers found{std::vector<Contact>(count), std::vector<char>(count)};
  for (size_t row = 0; row < count; ++row) {
    const Pair& p = rows[row];
    bool good = accepted(p.pose_a, p.size_a) && accepted(p.pose_b, p.size_b);
    Contact& one = found.alone[row];
    int32_t axis;
    Results results{&one.colliding, &one.separation,   one.normal.v, one.point.v,
                    &one.volume,    one.covariance[0], &axis,        0.0};
    Rows alone{p.pose_a, p.pose_b, p.size_a, p.size_b, 3, 3, nullptr};
    bool taken = box_contact::solve_row(model, alone, 0, results, counts) < 0;
    check(taken == good, name, "bad poses are refused, good ones accepted", p);
    if (!taken) {
      ++refusals;
      check(!colliding[row], name, "a refused row does not collide", p);
      if (expected < 0) expected = long(row);
      continue;
    }
    found.accepted[row] = true;
    check_contact(name, p, one);
    bool same = one.colliding == bool(colliding[row]) && same_bits(one.separation, separation[row]);
    for (size_t k = 0; k < 3; ++k)
      same = same && same_bits(one.normal[int(k)], normal[3 * row + k]) &&
             same_bits(one.point[int(k)], point[3 * row + k]);
    same = same && same_bits(one.volume, volume[row]);
    for (size_t k = 0; k < 9; ++k)
      same = same && same_bits(one.covariance[int(k / 3)][k % 3], covariance[9 * row + k]);
    check(same, name, "a row of a batch is its single call", p);
  }
  check(refused == expected, name, "the first refused row", rows[0]);
  return found;
}

// Whatever the weights: the volume is within the brackets, which hold the true one. Left out are
// contacts shallower than `sliver` of the size: one in a thousand of those drawn here overlaps as
// little along a second axis, which float32 does not resolve.
void check_brackets(const std::vector<Pair>& rows, const Answers& exact, const Answers& mlp) {
  constexpr double rounding = 3000 * 0x1p-24, limit = box_contact::bracket_limit, sliver = 1e-6;
  for (size_t row = 0; row < rows.size(); ++row) {
    const Contact &truth = exact.alone[row], &found = mlp.alone[row];
    if (!mlp.accepted[row] || !truth.colliding) continue;
    if (same_bits(found.volume, truth.volume)) continue;  // left to `exact`
    ++by_columns;
    check(found.volume > 0.0, "mlp", "the volume is positive", rows[row]);
    check(semidefinite(found), "mlp", "the covariance has no negative eigenvalue", rows[row]);
    if (truth.separation > -sliver * largest(rows[row])) continue;
    double off = std::fabs(found.volume - truth.volume);
    check(off <= limit * found.volume + rounding * truth.volume, "mlp",
          "the volume is within the brackets", rows[row]);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: fuzz ROUNDS [SEED]\n");
    return 2;
  }
  long rounds = std::atol(argv[1]), pairs = 0;
  Draw draw(argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 17);
  for (long round = 0; round < rounds; ++round) {
    std::vector<Pair> rows(size_t(1 + draw.choice(2 * Solver::lanes + 1)));
    for (Pair& p : rows) p = draw.pair();
    pairs += long(rows.size());
    std::vector<float> network = draw.network();
    Answers exact = check_rows("exact", ExactModel{}, rows);
    MlpModel mlp{box_contact::view(network.data(), long(network.size()))};
    check_brackets(rows, exact, check_rows("mlp", mlp, rows));
  }
  bool reached = contacts > pairs / 2 && refusals > pairs / 20 && by_columns > pairs / 10;
  std::printf("%ld pairs by two models: %ld contacts, %ld by columns, %ld refusals, %ld failures\n",
              pairs, contacts, by_columns, refusals, failures);
  if (!reached) std::printf("FAILED: too few of a kind\n");
  return failures || !reached ? 1 : 0;
}
