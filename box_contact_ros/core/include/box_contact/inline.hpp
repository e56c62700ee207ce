// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// libbox_contact as headers alone, for those who want the compiler to inline a call.
//
//   #include "box_contact/inline.hpp"
//   box_contact::Solver solver({1.0, 1.0, 1.0}, {2.0, 2.0, 2.0});  // full extents [m]
//   box_contact::Contact contact = solver({{0, 0, 1.49}, {0, 0, 0, 1}}, {{0, 0, 0}, {0, 0, 0, 1}});
//
// Most programs take box_contact.hpp, which compiles at once. A file that includes this one compiles
// for ten seconds with -O3. Classes have the names of box_contact.hpp, so a file includes one of the
// two. The bits of answers are the library's. Model `mlp` is the default, with the shipped weights; a
// third argument, box_contact::Solver::Model::exact, takes model `exact`.
//
// No flag is needed. The pragmas below keep g++ and clang++ from fusing products and sums, within
// this header alone. All names are in a namespace of the instruction set, so that files compiled with
// different -march can be linked. With -march=x86-64-v3 or -v4 a batch solves 4 or 8 pairs side by
// side instead of 2. Without them g++ notes that the ABI of wide vectors has changed: these vectors
// stay within this header, and -Wno-psabi silences the note. MSVC has no vector types and cannot
// compile it.
#pragma once

#if defined(BOX_CONTACT_HPP)
#error "box_contact/inline.hpp has the names of box_contact/box_contact.hpp: include one of them"
#endif
#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || \
    defined(__NO_SIGNED_ZEROS__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ != 0)
#error "box_contact needs IEEE arithmetic: compile without -ffast-math, -Ofast or a part of them"
#endif

#include <cfloat>
#if defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0
#error "box_contact needs double arithmetic in double: compile with -msse2 -mfpmath=sse"
#endif

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

#if defined(__clang__)
#pragma clang diagnostic push
#pragma float_control(push)
#pragma clang fp contract(off)
#else
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off", "no-tree-slp-vectorize")
#endif

#if __has_include("detail/inline_solver.hpp")
#include "detail/inline_solver.hpp"  // as installed
#else
#include "../../src/inline_solver.hpp"  // in the checkout
#endif

#if defined(__clang__)
#pragma float_control(pop)
#pragma clang diagnostic pop
#else
#pragma GCC pop_options
#endif
