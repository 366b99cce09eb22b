#include "model/diagnose/doctor.h"

#include <cmath>

#include "model/api/handle.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

vsplat_status vsplat_doctor(const vsplat_doctor_options* options, size_t* out_findings, char** out_text) {
  return guarded([&] {
    need(out_findings, "out_findings");
    need(out_text, "out_text");
    const vsplat_doctor_options o = taken(options, VSPLAT_DOCTOR_OPTIONS_INIT, "options");
    if (!(o.seconds > 0 && o.seconds <= 3600))
      fail(Status::usage, "options.seconds is {}: more than 0 and at most 3600 expected", o.seconds);
    const Diagnosis found = diagnose(o.seconds);
    *out_text = new_text(o.json ? diagnosis_json(found) : diagnosis_text(found));
    *out_findings = found.findings.size();
  });
}
