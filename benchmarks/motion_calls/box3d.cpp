// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// b3TimeOfImpact of two hulls of boxes.
#include <limits>

#include "box3d/box3d.h"
#include "rival.hpp"

namespace {

b3Vec3 vector(const double* v) { return {float(v[0]), float(v[1]), float(v[2])}; }

b3Sweep sweep(const double* start, const double* end, const double* centre) {
  auto turn = [](const double* pose) { return b3NormalizeQuat({vector(pose + 3), float(pose[6])}); };
  b3Sweep found{vector(centre), {}, {}, turn(start), turn(end)};
  found.c1 = b3Add(vector(start), b3RotateVector(found.q1, found.localCenter));
  found.c2 = b3Add(vector(end), b3RotateVector(found.q2, found.localCenter));
  return found;
}

b3BoxHull hull(const double* size) {
  return b3MakeBoxHull(float(size[0] / 2), float(size[1] / 2), float(size[2] / 2));
}

class Motion {
 public:
  explicit Motion(const Row& row) : hull_a_(hull(row.size_a)), hull_b_(hull(row.size_b)) {
    auto proxy = [](const b3BoxHull& hull) {
      return b3ShapeProxy{b3GetHullPoints(&hull.base), hull.base.vertexCount, 0.0f};
    };
    input_ = {proxy(hull_a_), proxy(hull_b_), sweep(row.start_a, row.end_a, row.centre_a),
              sweep(row.start_b, row.end_b, row.centre_b), 1.0f};
  }
  Motion(const Motion&) = delete;  // the input has its hulls' addresses

  // Where it gives up, the time that it reached is a time of impact, as in Box3D's own steps.
  double time() const {
    b3TOIOutput found = b3TimeOfImpact(&input_);
    return found.state == b3_toiStateSeparated ? std::numeric_limits<double>::quiet_NaN()
                                               : double(found.fraction);
  }

 private:
  b3BoxHull hull_a_, hull_b_;
  b3TOIInput input_;
};

}  // namespace

int main(int count, char** words) { return run<Motion>(SOURCE, count, words); }
