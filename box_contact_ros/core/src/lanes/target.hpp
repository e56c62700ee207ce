// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The namespace of the instruction set that a file is compiled for.
//
// Templates that two files compile for different machines must not share a name. The linker keeps
// one of two, and a machine could run the wrong one. So each file has its own namespace here.
#pragma once

#include <limits>

#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__) && defined(__AVX512VL__)
#define BOX_CONTACT_SET avx512
#elif defined(__AVX512F__)
#define BOX_CONTACT_SET avx512f
#elif defined(__AVX2__) && defined(__FMA__)
#define BOX_CONTACT_SET avx2
#elif defined(__AVX2__)
#define BOX_CONTACT_SET avx2_without_fma
#elif defined(__AVX__) && defined(__FMA__)
#define BOX_CONTACT_SET avx_with_fma
#elif defined(__AVX__)
#define BOX_CONTACT_SET avx
#else
#define BOX_CONTACT_SET baseline
#endif

#define BC_INLINE [[gnu::always_inline]] inline

namespace box_contact {
inline namespace BOX_CONTACT_SET {

// Constants, not the functions of std::numeric_limits: without optimisation those are symbols that
// all files share.
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double largest_number = std::numeric_limits<double>::max();

}  // namespace BOX_CONTACT_SET
}  // namespace box_contact
