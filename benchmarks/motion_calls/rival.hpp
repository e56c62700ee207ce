// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The program of another engine.
//
// PROGRAM MOTIONS ANSWERS: MOTIONS has rows of `Row`. ANSWERS gets a time (NaN: never) and the
// nanoseconds of the call, a row each. Without arguments it prints what it was made from.
#pragma once

#include "rows.hpp"

// `Motion` is made of a row, outside what is timed; its `time()` can be called again.
template <class Motion>
int run(const char* source, int count, char** words) {
  if (count == 1) return std::puts(source) < 0;
  if (count != 3) fail("usage: PROGRAM MOTIONS ANSWERS");
  std::FILE *from = std::fopen(words[1], "rb"), *to = std::fopen(words[2], "wb");
  if (!from || !to) fail("a file cannot be opened");
  Row row;
  while (std::fread(&row, sizeof row, 1, from) == 1) {
    Motion motion(row);
    double found[2];
    found[1] = nanoseconds([&] { found[0] = motion.time(); });
    std::fwrite(found, sizeof found, 1, to);
  }
  return std::fclose(to) ? 1 : 0;
}
