// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Chords: what A∩B cuts out of 48 lines along x of the patch box, and what they sum to.
//
// A line is clipped by the slabs of both boxes (Kay and Kajiya 1986). Eight lines in a row, at equal
// distances along y, are on each of six levels along z, which are the nodes of Gauss and Legendre. All
// of it is the same for every pair. The sums of a level and the moments over all levels are what the
// network reads, and the body that it corrects.
#pragma once

#include "eight.hpp"
#include "patch_box.hpp"

namespace box_contact::BOX_CONTACT_SET::mlp {

constexpr int levels = 6, features = 3 * levels + 3;

// Where the eight lines of a row are along y.
constexpr float rows_at[8] = {-0.875F, -0.625F, -0.375F, -0.125F, 0.125F, 0.375F, 0.625F, 0.875F};
// Where the levels are along z, and their weights.
constexpr float level_at[levels] = {-0.932469514F, -0.661209386F, -0.238619186F,
                                    0.238619186F,  0.661209386F,  0.932469514F};
constexpr float level_weight[levels] = {0.085662246F, 0.180380787F, 0.233956967F,
                                        0.233956967F, 0.180380787F, 0.085662246F};

// Least slope of a slab against the chords by which is divided: steeper ones are all the same to them.
constexpr float least_slope = 0x1p-20F;
// Volume that every overlap has [of the patch box], so that one can divide by it.
constexpr float least_volume = 1e-5F;
// Variance of each coordinate that every overlap has [of the squared half extent].
constexpr float least_variance = 0.003F;

// Coordinates are those of the patch box, volumes are relative to its own.
template <class F>
struct Chords {
  F area[levels], x[levels], y[levels];  // of each level: share of the chords' length, and moments
  F volume, mean[3];
  F variance[3], beside[3];  // xx, yy, zz and yz, xz, xy
  F flip[3];                 // by coordinate: −1 where the mean was below 0

  template <class T>
  BC_INLINE explicit Chords(const PatchBox<T>& box) {
    F high[6], low[6], along_z[6];
    Eight<F> along_y[6], rows = eight<F>(rows_at);
    for (int k = 0; k < 6; ++k) {
      const Triple<F>(&share)[3] = box.share[k / 3];
      F a = share[0][k % 3], plus = box.plus[k / 3][k % 3], minus = box.minus[k / 3][k % 3];
      Mask<F> forwards = a >= 0.0F;
      F by_a = 1.0F / max(abs(a), splat<F>(least_slope)), side = select<F>(forwards, by_a, -by_a);
      high[k] = by_a * select<F>(forwards, plus, minus);
      low[k] = -(by_a * select<F>(forwards, minus, plus));
      along_y[k] = eight<F>(side * share[1][k % 3]) * rows;
      along_z[k] = side * share[2][k % 3];
    }
    Eight<F> one = eight<F>(splat<F>(1.0F)), zero = eight<F>(F{});
    Eight<F> third = eight<F>(splat<F>(1.0F / 3.0F));
    Eight<F> all = zero, all_x = zero, all_xx = zero;
    for (int n = 0; n < levels; ++n) {
      Eight<F> top = one, bottom = zero - one;
      for (int k = 0; k < 6; ++k) {
        F at_level = level_at[n] * along_z[k];
        top = min(top, eight<F>(high[k] - at_level) - along_y[k]);
        bottom = max(bottom, eight<F>(low[k] - at_level) - along_y[k]);
      }
      Eight<F> length = max(top - bottom, zero), ends = top + bottom, first = length * ends;
      Eight<F> weight = eight<F>(splat<F>(level_weight[n]));
      area[n] = 0.0625F * total<F>(length);
      x[n] = 0.03125F * total<F>(first);
      y[n] = 0.0625F * total<F>(length * rows);
      all = all + weight * length;
      all_x = all_x + weight * first;
      all_xx = all_xx + weight * (length * (ends * ends + third * (length * length)));
    }
    Eight<F> by_row = all * rows;
    sum_up(0.015625F * total<F>(all_xx), 0.03125F * total<F>(all_x * rows),
           0.0625F * total<F>(by_row * rows));
  }

  // What the network is told.
  BC_INLINE void tell(F (&told)[features]) const {
    for (int n = 0; n < levels; ++n) {
      told[n] = area[n];
      told[levels + n] = x[n];
      told[2 * levels + n] = y[n];
    }
    told[3 * levels] = variance[0];
    told[3 * levels + 1] = beside[2];
    told[3 * levels + 2] = variance[1];
  }

 private:
  // Volume, mean and second moments from the levels and from `xx`, `xy` and `yy` over all of them. Then
  // mirror the coordinates so that no mean is below 0.
  BC_INLINE void sum_up(F xx, F xy, F yy) {
    F at_x{}, at_y{}, at_z{}, zz{}, xz{}, yz{};
    volume = splat<F>(least_volume);
    for (int n = 0; n < levels; ++n) {
      F weight = splat<F>(level_weight[n]), z = splat<F>(level_at[n]);
      F of_area = weight * area[n], of_x = weight * x[n], of_y = weight * y[n];
      volume += of_area;
      at_x += of_x;
      at_y += of_y;
      at_z += of_area * z;
      zz += of_area * (z * z);
      xz += of_x * z;
      yz += of_y * z;
    }
    F by_volume = 1.0F / volume;
    F first[3] = {at_x, at_y, at_z}, second[3] = {xx, yy, zz}, mixed[3] = {yz, xz, xy};
    for (int i = 0; i < 3; ++i) {
      flip[i] = select<F>(first[i] < 0.0F, splat<F>(-1.0F), splat<F>(1.0F));
      mean[i] = by_volume * abs(first[i]);
      variance[i] = max(by_volume * second[i] - mean[i] * mean[i], F{}) + least_variance;
    }
    for (int i = 0; i < 3; ++i) {
      int j = (i + 1) % 3, k = (i + 2) % 3;
      beside[i] = (flip[j] * flip[k]) * (by_volume * mixed[i]) - mean[j] * mean[k];
    }
    Mask<F> turned = flip[2] < 0.0F;
    for (int n = 0; n < levels; ++n) {
      x[n] *= flip[0];
      y[n] *= flip[1];
    }
    auto mirror = [&](F(&of_level)[levels]) {
      for (int n = 0; n < levels / 2; ++n) {
        F lower = of_level[n], upper = of_level[levels - 1 - n];
        of_level[n] = select<F>(turned, upper, lower);
        of_level[levels - 1 - n] = select<F>(turned, lower, upper);
      }
    };
    mirror(area);
    mirror(x);
    mirror(y);
  }
};

}  // namespace box_contact::BOX_CONTACT_SET::mlp
