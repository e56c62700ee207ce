// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// One kernel. It is compiled once for each instruction set, which names it.
#include "kernel.hpp"

#include "../mlp/mlp_model.hpp"
#include "stages.hpp"

namespace box_contact::BOX_CONTACT_SET {
namespace {

using detail::Kernel;
using detail::NetworkNumbers;

#if defined(__AVX512F__)
constexpr int lanes = 8;
constexpr const char* title = "AVX-512";
#elif defined(__AVX2__)
constexpr int lanes = 4;
constexpr const char* title = "AVX2";
#else
constexpr int lanes = 2;
#if defined(__aarch64__)
constexpr const char* title = "NEON";
#else
constexpr const char* title = "baseline";
#endif
#endif

NetworkView view(const NetworkNumbers& network) {
  auto* units = reinterpret_cast<const Network::Unit*>(network.numbers + site_outputs);
  return {network.numbers, units, network.units};
}

template <class M>
long solve(const NetworkNumbers& network, const Rows& rows, long begin, long end,
           const Results& results, Counts& counts) {
  M model{};
  if constexpr (!std::is_empty_v<M>) model = {view(network)};
  return solve_rows<Lanes<double, lanes>>(model, rows, begin, end, results, counts);
}

bool fill(const NetworkNumbers& network, bool by_edges, const Rows& rows, long row,
          const StageArrays& arrays) {
  NetworkView numbers = view(network);
  const NetworkView* asked = network.numbers ? &numbers : nullptr;
  return by_edges ? fill_stages<Network::Bounds::edges>(rows, row, asked, arrays)
                  : fill_stages<Network::Bounds::slab>(rows, row, asked, arrays);
}

#define NAME_OF(set) #set
#define NAME(set) NAME_OF(set)
#define KERNEL_OF(set) kernel_##set
#define KERNEL(set) KERNEL_OF(set)

using MlpByEdges = MlpModelBy<Network::Bounds::edges>;

}  // namespace
}  // namespace box_contact::BOX_CONTACT_SET

namespace box_contact::detail {

const Kernel KERNEL(BOX_CONTACT_SET) = {NAME(BOX_CONTACT_SET),
                                        title,
                                        lanes,
                                        {{solve<ExactPointModel>, solve<ExactModel>},
                                         {solve<MlpPointModel>, solve<MlpModel>},
                                         {solve<MlpByEdges>, solve<MlpByEdges>}},
                                        fill};

}  // namespace box_contact::detail
