// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The features: what the half-spaces of both boxes cut off the patch box, as the network reads it.
//
// A half-space cuts the box [−1, 1]³ to a depth c along a, with Σ|a_i| = 1. Per slab there are two,
// c⁺ and c⁻. All six slabs of both boxes count alike:
//
//   0–2: Σ (c⁺ − c⁻) a       3, 4: Σ c, Σ c²       5–7, 8–10: Σ of (c⁺ − c⁻)² a aᵀ, xx yy zz, xy xz yz
//   11–18: how deep the corners of the box are cut off, +++ ++− +−+ +−− −++ −+− −−+ −−−
//
// Axes are mirrored so that 0–2 are not above 0, but for `tie`.
#pragma once

#include "network.hpp"
#include "patch_box.hpp"

namespace box_contact::BOX_CONTACT_SET::mlp {

// A slope that is a smaller part of the sum of the three counts as 0: the digits of float32 end before it.
constexpr float least_slope = 1e-8F;
// Where boxes are centre above centre, features 0–2 are 0 but for rounding. Then Σ c a_i a_j decides how
// the second axis is mirrored: less than this of a feature, and above its rounding.
constexpr float tie = 1e-5F;

template <class F>
struct Features {
  F flip[3], numbers[up_to_fours(detail::network_features)];

  template <class T>
  BC_INLINE explicit Features(const PatchBox<T>& box) {
    for (F& number : numbers) number = F{};
    Side<F> slabs[2] = {box.a, box.b};
    Triple<F> one = uniform(splat<F>(1.0F)), whole = uniform(splat<F>(2.0F)), zero{};
    Triple<F> depth[2], pull[2][3];
    for (int n = 0; n < 2; ++n) {
      Triple<F>(&slope)[3] = slabs[n].slope;
      Triple<F> scale = inverses<F>((abs(slope[0]) + abs(slope[1])) + abs(slope[2]));
      for (int i = 0; i < 3; ++i) slope[i] = significant<F>(scale * slope[i], least_slope);
      slabs[n].plus = scale * slabs[n].plus;
      slabs[n].minus = scale * slabs[n].minus;
      auto cut = [&](const Triple<F>& side) { return min(whole, max(one - side, zero)); };
      Triple<F> above = cut(slabs[n].plus), below = cut(slabs[n].minus);
      depth[n] = above + below;
      for (int i = 0; i < 3; ++i) pull[n][i] = (above - below) * slope[i];
    }
    auto add = [](const Triple<F>& x, const Triple<F>& y) { return sum(x + y); };
    auto add_products = [&](int i, int j) {
      return add(pull[0][i] * pull[0][j], pull[1][i] * pull[1][j]);
    };
    auto across = [&](int i, int j) {
      auto of = [&](int n) { return depth[n] * (slabs[n].slope[i] * slabs[n].slope[j]); };
      return add(of(0), of(1));
    };
    for (int i = 0; i < 3; ++i) {
      F all = add(pull[0][i], pull[1][i]), decides = all;
      for (int j = 0; j < i; ++j) decides = decides + tie * (flip[j] * across(i, j));
      flip[i] = either<F>(decides > F{}, splat<F>(-1.0F), splat<F>(1.0F));
      numbers[i] = flip[i] * all;
      numbers[5 + i] = add_products(i, i);
    }
    numbers[3] = add(depth[0], depth[1]);
    numbers[4] = add(depth[0] * depth[0], depth[1] * depth[1]);
    numbers[8] = flip[0] * flip[1] * add_products(0, 1);
    numbers[9] = flip[0] * flip[2] * add_products(0, 2);
    numbers[10] = flip[1] * flip[2] * add_products(1, 2);
    for (const Side<F>& of_box : slabs) {
      Triple<F> a[3];
      for (int i = 0; i < 3; ++i) a[i] = flip[i] * of_box.slope[i];
      Triple<F> along = a[0] + a[1], against = a[0] - a[1];
      Triple<F> corners[4] = {along + a[2], along - a[2], against + a[2], against - a[2]};
      for (int i = 0; i < 4; ++i) {
        Triple<F> here = max(corners[i] - of_box.plus, -corners[i] - of_box.minus);
        Triple<F> there = max(-corners[i] - of_box.plus, corners[i] - of_box.minus);
        numbers[11 + i] = max(numbers[11 + i], largest(here));
        numbers[18 - i] = max(numbers[18 - i], largest(there));
      }
    }
    for (int i = 11; i < detail::network_features; ++i)
      numbers[i] = min(numbers[i], splat<F>(2.0F));
  }
};

}  // namespace box_contact::BOX_CONTACT_SET::mlp
