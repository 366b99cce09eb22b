// Problems of OpenCL on this machine, for C++, see vsplat/doctor.h and report.h. Part of vsplat.hpp, which includes
// this file.
#ifndef VSPLAT_DOCTOR_HPP
#define VSPLAT_DOCTOR_HPP

#include <vsplat/vsplat.hpp>

namespace vsplat {
inline namespace cxx {

struct Diagnosis {
  size_t findings = 0;  // number of problems
  std::string text;     // or JSON
};

inline Diagnosis doctor(const vsplat_doctor_options& options) {
  Diagnosis out;
  char* found = nullptr;
  check(vsplat_doctor(&options, &out.findings, &found));
  out.text = text(found);
  return out;
}

// Returns JSON. The device may be NULL: the report is then without a run.
inline std::string report(vsplat_device device, const vsplat_report_options& options) {
  char* out = nullptr;
  check(vsplat_report(device, &options, &out));
  return text(out);
}

}  // namespace cxx
}  // namespace vsplat

#endif
