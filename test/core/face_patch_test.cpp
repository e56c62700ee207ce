// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// Print the patches of faces of a list of pairs, for comparison with Python, and how often memory was
// allocated for them. The exit status is 1 if something is not refused.
//
// usage: face_patch_test PAIRS
//
// PAIRS has a line for each pair: two poses, two sizes and a normal, 23 numbers.
#include <cstdio>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "allocations.hpp"
#include "box_contact/box_contact.hpp"

using box_contact::Box;
using box_contact::Polygon;

namespace {

struct Meeting {
  Box a, b;
  double normal[3];
};

std::vector<Meeting> read_meetings(const char* path) {
  std::ifstream file(path);
  std::vector<Meeting> meetings;
  double numbers[23];
  std::string word;
  for (int k = 0; file >> word;) {
    numbers[k] = std::strtod(word.c_str(), nullptr);  // streams read no hexadecimal numbers
    if (++k < 23) continue;
    k = 0;
    Meeting meeting;
    std::memcpy(&meeting.a.pose, numbers, sizeof meeting.a.pose);
    std::memcpy(&meeting.b.pose, numbers + 7, sizeof meeting.b.pose);
    std::memcpy(&meeting.a.size, numbers + 14, sizeof meeting.a.size);
    std::memcpy(&meeting.b.size, numbers + 17, sizeof meeting.b.size);
    std::memcpy(meeting.normal, numbers + 20, sizeof meeting.normal);
    meetings.push_back(meeting);
  }
  return meetings;
}

bool is_refused(const Box& a, double height, double tolerance, const char* words) {
  try {
    const double normal[3] = {0.0, 0.0, height};
    box_contact::face_patch(a, a, normal, tolerance);
  } catch (const std::invalid_argument& error) {
    return std::strstr(error.what(), words);
  }
  return false;
}

}  // namespace

int main(int, char** arguments) {
  const std::vector<Meeting> meetings = read_meetings(arguments[1]);
  std::vector<Polygon> patches;
  patches.reserve(meetings.size());
  const long before = allocations;
  for (const Meeting& meeting : meetings)
    patches.push_back(box_contact::face_patch(meeting.a, meeting.b, meeting.normal));
  const long allocated = allocations - before;
  for (const Polygon& patch : patches) {
    std::printf("%d %a", int(patch.count), patch.area);
    for (double number : patch.centre) std::printf(" %a", number);
    for (const auto& corner : patch.corners)
      for (double number : corner) std::printf(" %a", number);
    std::printf("\n");
  }
  std::printf("%ld allocations\n", allocated);
  Box box{{{0, 0, 0}, {0, 0, 0, 1}}, {1, 1, 1}}, flat = box;
  flat.size.extent[1] = 0.0;
  return !is_refused(box, 2.0, 1e-4, "normal (0, 0, 2) must be of length 1") ||
         !is_refused(box, 1.0, -1.0, "tolerance must be within 0 and 1e50 m, not -1") ||
         !is_refused(flat, 1.0, 0.0, "size_a (1, 0, 1) is not within");
}
