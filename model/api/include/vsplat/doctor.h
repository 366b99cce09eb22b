/* Finds out why there is no OpenCL device, or the wrong one. Part of vsplat.h, which states the common conventions. */
#ifndef VSPLAT_DOCTOR_H
#define VSPLAT_DOCTOR_H

#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vsplat_doctor_options {
  size_t size;
  double seconds; /* time limit for one driver to load and list its devices */
  int32_t json;   /* not 0: JSON instead of text */
} vsplat_doctor_options;
#define VSPLAT_DOCTOR_OPTIONS_INIT \
  { sizeof(vsplat_doctor_options), 20, 0 }

/* Checks the OpenCL loader, every driver registered with it (each in a process of its own), installed drivers that are
   not registered, the files through which a GPU is reached, and the folders of compiled kernels. This process calls no
   OpenCL: a driver that crashes or hangs is named, and the others are still checked. `options` NULL: defaults.
   `out_findings` becomes the number of problems, 0 if a device can be used and nothing is wrong. `out_text` becomes
   what was checked and found, with a remedy for each problem; free it with vsplat_text_free. As JSON: {"usable",
   "findings": [{"kind", "about", "found", "mend"}], "loader": {"path", "ocl_icd", "looks_in", "variable"}, "drivers":
   [{"entry", "library", "state", "path", "error", "doing", "said", "platforms": [{"name", "version", "devices"}]}],
   "devices", "installed": [{"vendor", "path"}], "files": [{"path", "problem"}], "container", "caches": [{"of", "path",
   "variable", "writable"}]}. `state` is loaded, not_loaded, no_driver, crashed, hangs, or no_library for an entry that
   names no library; values that do not apply are null. VSPLAT_ERROR_INTERNAL: libexec/vsplat/vsplat-look, which is
   installed beside the library, is missing. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_doctor(const vsplat_doctor_options* options, size_t* out_findings,
                                                        char** out_text);

#ifdef __cplusplus
}
#endif

#endif
