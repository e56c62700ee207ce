// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// How the C interface refuses: a code to return, and words for it.
#pragma once

#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>

#include "../../include/box_contact/box_contact.h"
#include "../poses.hpp"

namespace box_contact::detail {

inline thread_local char error_text[512];

[[gnu::format(printf, 2, 3)]] inline bc_status fail(bc_status status, const char* format, ...) {
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(error_text, sizeof error_text, format, arguments);
  va_end(arguments);
  return status;
}

// Call `work`; nothing that it throws leaves the library. Every function that returns a status does
// its work in here.
template <class Work>
bc_status guarded(Work work) noexcept {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return fail(BC_NO_MEMORY, "no memory is left");
  } catch (const std::exception& error) {
    return fail(BC_BAD_ARGUMENT, "%s", error.what());
  } catch (...) {
    return fail(BC_BAD_ARGUMENT, "unknown failure");
  }
}

inline bc_status refuse_null(const char* name) {
  return fail(BC_BAD_ARGUMENT, "%s is a null pointer", name);
}

// A copy of a struct that the program may have compiled by an older header, which had less fields.
template <class Struct>
bool read(const Struct* given, Struct& copy) {
  if (given->size == sizeof(Struct)) {
    copy = *given;
    return true;
  }
  if (given->size == 0 || given->size > sizeof(Struct)) return false;
  std::memcpy(static_cast<void*>(&copy), given, given->size);
  return true;
}

// The number in the place of an enumeration, where a program may have put any. C++ may read none but
// those of the enumeration from there.
template <class Enumeration>
unsigned number_of(const Enumeration& given) {
  unsigned number;
  static_assert(sizeof number == sizeof given);
  std::memcpy(&number, &given, sizeof number);
  return number;
}

inline bool pose_is_valid(const double* p) {
  double quaternion[4] = {p[3], p[4], p[5], p[6]};
  return pose_valid<double>(triple(Vec<double>{p[0], p[1], p[2]}), squared_norm(quaternion));
}

inline bc_status refuse_pose(const char* field, const double* p) {
  bool is_far = false, is_finite = true;
  for (int k = 0; k < 3; ++k) is_far |= !(std::fabs(p[k]) <= length_max);
  for (int k = 3; k < 7; ++k) is_finite &= __builtin_isfinite(p[k]);
  if (is_far)
    return fail(BC_BAD_POSE, "%s position (%g, %g, %g) is not finite, or exceeds 1e50 m", field,
                p[0], p[1], p[2]);
  return fail(BC_BAD_POSE, "%s quaternion (%g, %g, %g, %g) %s", field, p[3], p[4], p[5], p[6],
              is_finite ? "has no length within 1e-100 to 1e100" : "is not finite");
}

}  // namespace box_contact::detail
