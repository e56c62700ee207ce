// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// How much shorter the sub-steps of an island are, so that no patch is pressed deeper than wanted, or than a
// tenth of the thinner box; and for how long it has swayed.
//
// A patch that bears a force F for long is F·c·w²/f² deep. Here c is what an impulse N alone changes the
// closing speed by, w is the window, and f is `soft_frequency`. Of boxes alike that is little. Of a heavy
// body on a light one, c is the inverse of the small mass, and F the weight of the large one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "islands.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Chooses the factor of an island, and tells for how long it has swayed. Both are kept with its bodies.
class FinenessOf {
 public:
  FinenessOf(const bc_wrench* outside, double most_depth, std::vector<Patch>& patches,
             Islands& islands)
      : outside_(outside),
        most_depth_(most_depth),
        patches_(patches),
        moving_(islands.moving),
        blocks_(islands.blocks),
        by_height_(islands.by_height) {}

  double operator()(const Island& island, const SubSteps& steps) const {
    double needed = needed_by(island, steps), last = 1.0, calm = calm_time;
    each_free(island, [&](const Moving& moving) {
      last = std::max(last, moving.fineness.factor);
      calm = std::min(calm, moving.fineness.calm);
    });
    if (last == 1.0 && needed <= 1.0) return 1.0;
    bool is_spare = spare_factor * needed <= last;
    bool is_short = needed > (last == 1.0 ? 1.0 : growth * last);
    double factor = last;
    if (is_short)
      factor = std::ceil(std::min(growth * needed, double(finest)));
    else if (is_spare && calm >= calm_time)
      factor = std::max(1.0, last * (1.0 - steps.dt / calm_time));
    each_free(island, [&](Moving& moving) {
      moving.fineness.factor = factor;
      moving.fineness.calm = is_spare ? moving.fineness.calm + steps.dt : 0.0;
    });
    return factor;
  }
  // For how long an island has swayed at the end of a step [s]. Its bodies pass each other at `speed` [m/s].
  double swayed(const Island& island, double speed, double dt) const {
    double swayed = 0.0;
    each_free(island,
              [&](const Moving& moving) { swayed = std::max(swayed, moving.fineness.swayed); });
    swayed = is_sway(speed, swayed > 0.0) ? swayed + dt : 0.0;
    each_free(island, [&](Moving& moving) { moving.fineness.swayed = swayed; });
    return swayed;
  }

 private:
  template <class Visit>
  void each_free(const Island& island, const Visit& visit) const {
    for (size_t k = island.body; k < island.body_end; ++k)
      if (moving_[k].inverse_mass > 0.0) visit(moving_[k]);
  }

  // The factor that is needed [1]. Below 1, the load could grow by its inverse without one.
  double needed_by(const Island& island, const SubSteps& steps) const {
    Vec<double> total{0.0, 0.0, 0.0};
    double lightest = 0.0;
    each_free(island, [&](const Moving& moving) {
      if (outside_) total += vector(outside_[moving.body].force);
      lightest = std::max(lightest, moving.inverse_mass);
    });
    double weight = length(total), push = 0.0, push_by_depth = 0.0, thinnest = place_max;
    for (size_t k = island.block; k < island.block_end; ++k)
      thinnest = std::min(thinnest, patches_[size_t(blocks_[k].patch)].most_depth);
    auto finer = [&](double by_depth) {
      return steps.window * std::sqrt(by_depth / aimed_depth) / soft_frequency;
    };
    bool is_uneven = false;
    double most_push = weight * 2.0 * lightest;
    bool may_be_heavy = most_push > least_push || finer(most_push / thinnest) > 1.0;
    if (may_be_heavy) hand_down_weights(island, (-1.0 / weight) * total);
    for (size_t k = island.block; k < island.block_end; ++k) {
      Patch& patch = patches_[size_t(blocks_[k].patch)];
      double above = may_be_heavy ? blocks_[k].load : 0.0;
      patch.lasting =
          std::min(patch.force, std::max(patch.lasting, above) * (1.0 + steps.dt / lasting_time));
      double of_a = moving_[size_t(blocks_[k].a)].inverse_mass,
             of_b = moving_[size_t(blocks_[k].b)].inverse_mass;
      double least = min(of_a, of_b), most = max(of_a, of_b);
      is_uneven = is_uneven || (least > 0.0 && most >= uneven_masses * least);
      double pushed = std::max(patch.lasting, above) * (of_a + of_b);
      push = std::max(push, pushed);
      push_by_depth = std::max(push_by_depth, pushed / patch.most_depth);
    }
    double ratio = finer(push / most_depth_), thin = finer(push_by_depth);
    double beyond = push / least_push;
    return std::max(thin, is_uneven && beyond > 1.0 ? std::ceil(ratio) : std::min(ratio, beyond));
  }

  // Weights from the top: each body hands what it bears to its patches below, in equal parts.
  void hand_down_weights(const Island& island, const Vec<double>& up) const {
    for (size_t k = island.body; k < island.body_end; ++k) {
      Moving& moving = moving_[k];
      moving.carriers = 0;
      moving.load = moving.inverse_mass > 0.0 && outside_
                        ? std::fabs(dot(vector(outside_[moving.body].force), up))
                        : 0.0;
    }
    for (size_t k = island.block; k < island.block_end; ++k) {
      Block& block = blocks_[k];
      const Patch& patch = patches_[size_t(block.patch)];
      block.height = dot(patch.point, up);
      block.rises = dot(patch.normal, up);
      if (carries(block)) ++moving_[size_t(upper(block))].carriers;
    }
    auto first = by_height_.begin() + long(island.block),
         last = by_height_.begin() + long(island.block_end);
    std::iota(first, last, int32_t(island.block));
    std::sort(first, last, [&](int32_t j, int32_t k) {
      double a = blocks_[size_t(j)].height, b = blocks_[size_t(k)].height;
      return a != b ? a > b : j < k;
    });
    for (auto at = first; at != last; ++at) {
      Block& block = blocks_[size_t(*at)];
      block.load = 0.0;
      if (!carries(block)) continue;
      const Moving& above = moving_[size_t(upper(block))];
      block.load = above.load / above.carriers;
      moving_[size_t(lower(block))].load += block.load;
    }
  }
  static bool carries(const Block& block) { return std::fabs(block.rises) > 0.5; }
  static int32_t upper(const Block& block) { return block.rises > 0.0 ? block.b : block.a; }
  static int32_t lower(const Block& block) { return block.rises > 0.0 ? block.a : block.b; }

  const bc_wrench* outside_;
  double most_depth_;
  std::vector<Patch>& patches_;
  std::vector<Moving>& moving_;
  std::vector<Block>& blocks_;
  std::vector<int32_t>& by_height_;
};

}  // namespace box_contact::BOX_CONTACT_SET::force
