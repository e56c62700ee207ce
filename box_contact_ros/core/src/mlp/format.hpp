// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The form of networks in memory: how many numbers they read and give, and what comes before the weights.
#pragma once

namespace box_contact::detail {

// The network of model `mlp`: the features of the overlap that it reads, its outputs, and the most units
// of a hidden layer. `network_format` counts changes of what features and outputs mean.
constexpr int network_format = 6, network_features = 19, network_outputs = 10,
              network_units_max = 64;
// The same of model `paper`.
constexpr int paper_inputs = 6, paper_outputs = 4;
// Numbers before the weights of a network: inputs, units of both hidden layers, outputs, whether the
// hidden units are tanh or rectified, whether lengths are in half edges of cubes or in metres, and
// whether the last layer reads the inputs before the units: a linear path beside the hidden layers.
constexpr int network_header = 7;

}  // namespace box_contact::detail
