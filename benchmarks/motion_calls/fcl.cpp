// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// FCL's continuousCollide of two boxes, by conservative advancement with linear motions.
//
// Of InterpMotion's constructors only the one with matrices, vectors and a reference point makes a
// motion: the others leave out the reference point or the velocities.
#include <fcl/config.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/math/motion/interp_motion.h>
#include <fcl/narrowphase/continuous_collision.h>

#include <limits>

#include "rival.hpp"

namespace {

fcl::Matrix3d matrix(const double* pose) {
  return fcl::Quaterniond(pose[6], pose[3], pose[4], pose[5]).normalized().toRotationMatrix();
}
fcl::Vector3d vector(const double* v) { return {v[0], v[1], v[2]}; }

class Motion {
 public:
  explicit Motion(const Row& row)
      : box_a_(vector(row.size_a)),
        box_b_(vector(row.size_b)),
        way_a_(matrix(row.start_a), vector(row.start_a), matrix(row.end_a), vector(row.end_a),
               vector(row.centre_a)),
        way_b_(matrix(row.start_b), vector(row.start_b), matrix(row.end_b), vector(row.end_b),
               vector(row.centre_b)) {}

  double time() const {
    way_a_.integrate(0.0), way_b_.integrate(0.0);  // a call begins where the last one ended
    fcl::ContinuousCollisionResultd result;
    fcl::continuousCollide(&box_a_, &way_a_, &box_b_, &way_b_, request_, result);
    return result.is_collide ? result.time_of_contact : std::numeric_limits<double>::quiet_NaN();
  }

 private:
  fcl::Boxd box_a_, box_b_;
  fcl::InterpMotion<double> way_a_, way_b_;
  fcl::ContinuousCollisionRequestd request_{1000, 1e-6, fcl::CCDM_LINEAR, fcl::GST_LIBCCD,
                                            fcl::CCDC_CONSERVATIVE_ADVANCEMENT};
};

}  // namespace

int main(int count, char** words) { return run<Motion>("FCL " FCL_VERSION, count, words); }
