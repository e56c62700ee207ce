// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Columns of pairs that are asked for, and of what is found for them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "../kernel.hpp"

namespace box_contact::BOX_CONTACT_SET::force {

// Pairs with what is asked of each.
struct AskedPairs {
  std::vector<int64_t> pairs;  // (n, 2)
  std::vector<double> friction, surface;

  size_t count() const { return pairs.size() / 2; }
  void resize(size_t n) {
    pairs.resize(2 * n);
    friction.resize(n);
    surface.resize(3 * n);
  }
  void reserve(size_t n) {
    pairs.reserve(2 * n);
    friction.reserve(n);
    surface.reserve(3 * n);
  }
  void add(const AskedPairs& other, size_t k) {
    pairs.insert(pairs.end(), &other.pairs[2 * k], &other.pairs[2 * k] + 2);
    friction.push_back(other.friction[k]);
    surface.insert(surface.end(), &other.surface[3 * k], &other.surface[3 * k] + 3);
  }
};

// Answers to rows.
struct Columns {
  std::vector<double> separation, normal, point, volume, covariance;

  void resize(size_t n) {
    separation.resize(n);
    volume.resize(n);
    for (auto* column : {&normal, &point}) column->resize(3 * n);
    covariance.resize(9 * n);
  }
  detail::Results results(double margin) {
    return {nullptr,       separation.data(), normal.data(), point.data(),
            volume.data(), covariance.data(), nullptr,       margin};
  }
  // Set the patch to that of a contact; the separation stays.
  void set_patch(size_t row, const bc_contact& contact) {
    volume[row] = contact.volume;
    std::copy_n(contact.normal, 3, &normal[3 * row]);
    std::copy_n(contact.point, 3, &point[3 * row]);
    std::copy_n(contact.covariance[0], 9, &covariance[9 * row]);
  }
};

}  // namespace box_contact::BOX_CONTACT_SET::force
