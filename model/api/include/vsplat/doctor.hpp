// What is wrong with OpenCL here, for C++, see vsplat/doctor.h and report.h. Part of vsplat.hpp, which includes it.
#ifndef VSPLAT_DOCTOR_HPP
#define VSPLAT_DOCTOR_HPP

#include <vsplat/vsplat.hpp>

namespace vsplat {
inline namespace cxx {

struct Diagnosis {
  size_t findings = 0;  // how many things are wrong
  std::string text;     // or JSON
};

inline Diagnosis doctor(const vsplat_doctor_options& options) {
  Diagnosis out;
  char* found = nullptr;
  check(vsplat_doctor(&options, &out.findings, &found));
  out.text = text(found);
  return out;
}

// JSON. The device may be NULL: without a run.
inline std::string report(vsplat_device device, const vsplat_report_options& options) {
  char* out = nullptr;
  check(vsplat_report(device, &options, &out));
  return text(out);
}

}  // namespace cxx
}  // namespace vsplat

#endif
