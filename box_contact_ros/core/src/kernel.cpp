// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// One kernel. It is compiled once for each instruction set, which names it.
#include "kernel.hpp"

#include "distance/distances.hpp"
#include "force/stages.hpp"
#include "mlp/mlp_model.hpp"
#include "mlp/paper_model.hpp"
#include "overlap/exact.hpp"
#include "pair.hpp"

namespace box_contact::BOX_CONTACT_SET {
namespace {

using detail::Kernel;

#if defined(__AVX512F__)
#define KERNEL kernel_avx512
constexpr int lanes = 8;
constexpr const char *name = "avx512", *title = "AVX-512";
#elif defined(__AVX2__)
#define KERNEL kernel_avx2
constexpr int lanes = 4;
constexpr const char *name = "avx2", *title = "AVX2";
#else
#define KERNEL kernel_baseline
constexpr int lanes = 2;
#if defined(__aarch64__)
constexpr const char *name = "baseline", *title = "NEON";
#else
constexpr const char *name = "baseline", *title = "baseline";
#endif
#endif

template <class M>
M model_of(const float* network) {
  if constexpr (std::is_empty_v<M>) {
    return {};
  } else {
    return {view(network)};
  }
}
template <class M>
bool pair_by(const float* network, const detail::PairNumbers& pair, double margin,
             bc_contact& contact) {
  return solve_pair(model_of<M>(network), pair, margin, contact);
}
template <class M>
long rows_by(const float* network, const Rows& rows, long begin, long end, const Results& results) {
  return solve_rows<Lanes<double, lanes>>(model_of<M>(network), rows, begin, end, results);
}

bool nearest_pair(const detail::PairNumbers& pair, bc_nearest& nearest) {
  auto collide = [](const detail::PairNumbers& touching, bc_contact& contact) {
    pair_by<ExactModel>(nullptr, touching, 0.0, contact);
  };
  return solve_nearest(pair, collide, nearest);
}
long nearest_rows(const Rows& rows, long begin, long end, const NearestResults& results) {
  return solve_nearest_rows<Lanes<double, lanes>>(rows, begin, end, results);
}

}  // namespace
}  // namespace box_contact::BOX_CONTACT_SET

namespace box_contact::detail {

const Kernel KERNEL = {name,
                       title,
                       lanes,
                       {{pair_by<ExactPointModel>, pair_by<ExactModel>},
                        {pair_by<MlpPointModel>, pair_by<MlpModel>},
                        {pair_by<PaperModel>, pair_by<PaperModel>}},
                       {{rows_by<ExactPointModel>, rows_by<ExactModel>},
                        {rows_by<MlpPointModel>, rows_by<MlpModel>},
                        {rows_by<PaperModel>, rows_by<PaperModel>}},
                       nearest_pair,
                       nearest_rows,
                       force::Stages<force::Group<Lanes<double, lanes>>>::kernel};

}  // namespace box_contact::detail
