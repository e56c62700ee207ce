// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// The test and the fuzz as one program, so that sanitizers instrument the core once: with two
// arguments it is the test, with one the fuzz.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "box_contact/inline.hpp"

// What these include is above: nothing but their own text comes into the namespaces.
namespace test {
#include "contact_test.cpp"
}
namespace fuzz {
#include "fuzz.cpp"
}

int main(int argc, char** argv) {
  return argc > 2 ? test::main(argc, argv) : fuzz::main(argc, argv);
}
