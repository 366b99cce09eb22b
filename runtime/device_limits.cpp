#include "runtime/device_limits.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "runtime/fail.h"

namespace vsplat {
namespace {

[[noreturn]] void refuse(const std::string& part, const char* why) {
  fail(Status::usage,
       "VSPLAT_LIMITS: \"{}\" {}. Expected, separated by commas: group=ITEMS, local=BYTES, buffer=BYTES, memory=BYTES "
       "(16K, 128M, 2G), align=BITS, size=32, fp64=0, fp16=0, subgroups=0, matrix=0, flops=OPERATIONS (2e10), "
       "grid=GROUPS",
       part, why);
}

// "16K", "2e10".
double number_of(const std::string& part, const std::string& text) {
  double out = 0;
  const char* end = text.data() + text.size();
  auto [rest, error] = std::from_chars(text.data(), end, out);
  if (error == std::errc() && rest != end) {
    const char unit = *rest++;
    out *= unit == 'K'   ? 0x1p10
           : unit == 'M' ? 0x1p20
           : unit == 'G' ? 0x1p30
                         : std::numeric_limits<double>::quiet_NaN();
  }
  if (error != std::errc() || rest != end || !(out >= 0 && out < 0x1p63)) refuse(part, "has no such number");
  return out;
}

template <class T>
void at_most(T& claim, double limit) {
  if (limit < static_cast<double>(claim)) claim = static_cast<T>(limit);
}

void lower_one(DeviceInfo& d, const std::string& part) {
  const std::size_t sign = part.find('=');
  if (sign == std::string::npos) refuse(part, "has no value");
  const std::string key = part.substr(0, sign);
  const double value = number_of(part, part.substr(sign + 1));
  const auto without = [&](bool& claim) {
    if (value != 0) refuse(part, "raises a claim");
    claim = false;
  };
  if (value == 0 && key != "fp64" && key != "fp16" && key != "subgroups" && key != "matrix")
    refuse(part, "leaves nothing");
  if (key != "flops" && value != std::floor(value)) refuse(part, "is no whole number");
  if (key == "group") {
    at_most(d.max_work_group, value);
  } else if (key == "local") {
    at_most(d.local_memory, value);
  } else if (key == "buffer") {
    at_most(d.max_alloc, value);
  } else if (key == "memory") {
    at_most(d.memory, value);
    at_most(d.max_alloc, value);
  } else if (key == "align") {
    const auto bits = static_cast<std::uint64_t>(value);
    if (bits % 8 != 0 || (bits & (bits - 1)) != 0 || bits > 1 << 20)
      refuse(part, "is no power of two from 8 to 1048576");
    d.align = std::max(d.align, static_cast<int>(bits / 8));
  } else if (key == "size") {
    if (value != 32 && value != 64) refuse(part, "is neither 32 nor 64");
    d.address_bits = std::min(d.address_bits, static_cast<int>(value));
  } else if (key == "flops") {
    at_most(d.most_flops, value);
  } else if (key == "grid") {
    at_most(d.most_groups, value);
  } else if (key == "fp64") {
    without(d.fp64);
  } else if (key == "fp16") {
    without(d.fp16);
  } else if (key == "subgroups") {
    without(d.subgroups);
  } else if (key == "matrix") {
    if (value != 0) refuse(part, "raises a claim");
    d.matrix_units.clear();
  } else {
    refuse(part, "is no such limit");
  }
}

}  // namespace

void lower(DeviceInfo& device, const std::string& text) {
  if (text.empty()) return;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    lower_one(device, text.substr(begin, end - begin));
    begin = end + 1;
  }
  device.lowered = text;
}

void refuse_too_small(const DeviceInfo& device) {
  const char* by = device.lowered.empty() ? "" : " (with VSPLAT_LIMITS)";
  if (device.max_work_group < kLeastGroup)
    fail(Status::device, "{} allows work-groups of {} items{}: at least {} are needed, choose another device",
         device.name, device.max_work_group, by, kLeastGroup);
  if (device.local_memory < kLeastLocal)
    fail(Status::device,
         "{} has {} bytes of local memory for a work-group{}: at least {} are needed, choose another "
         "device",
         device.name, device.local_memory, by, kLeastLocal);
}

}  // namespace vsplat
