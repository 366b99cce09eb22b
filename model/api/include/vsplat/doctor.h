/* Why there is no OpenCL device, or the wrong one.
   Part of vsplat.h, which says what holds for all of it. */
#ifndef VSPLAT_DOCTOR_H
#define VSPLAT_DOCTOR_H

#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vsplat_doctor_options {
  size_t size;
  double seconds; /* that one driver may take to be loaded and to tell its devices */
  int32_t json;   /* not 0: JSON in place of text */
} vsplat_doctor_options;
#define VSPLAT_DOCTOR_OPTIONS_INIT \
  { sizeof(vsplat_doctor_options), 20, 0 }

/* Looks at the OpenCL loader, at every driver that is named to it, each in a process of its own, at drivers that are
   not, at the files through which a GPU is reached, and at the folders of compiled kernels. Nothing of OpenCL is used in
   this process: a driver that crashes or hangs is named, and the others are still looked at. `options` NULL: defaults.
   `out_findings` becomes how many things are wrong, 0 where a device can be used and nothing is; `out_text` what was
   looked at and found, with the mend of each finding, to be freed with vsplat_text_free. As JSON: {"usable",
   "findings": [{"kind", "about", "found", "mend"}], "loader": {"path", "ocl_icd", "looks_in", "variable"}, "drivers":
   [{"entry", "library", "state", "path", "error", "doing", "said", "platforms": [{"name", "version", "devices"}]}],
   "devices", "installed": [{"vendor", "path"}], "files": [{"path", "problem"}], "container", "caches": [{"of", "path",
   "variable", "writable"}]}. `state` is loaded, not_loaded, no_driver, crashed, hangs, or no_library of an entry that
   names none; what does not apply is null. VSPLAT_ERROR_INTERNAL where libexec/vsplat/vsplat-look, which is installed
   beside the library, is missing. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_doctor(const vsplat_doctor_options* options, size_t* out_findings,
                                                        char** out_text);

#ifdef __cplusplus
}
#endif

#endif
