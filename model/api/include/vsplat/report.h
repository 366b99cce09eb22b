/* What a report of a defect should tell, in one text.
   Part of vsplat.h, which says what holds for all of it. */
#ifndef VSPLAT_REPORT_H
#define VSPLAT_REPORT_H

#include <vsplat/device.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vsplat_report_options {
  size_t size;
  double seconds;                    /* that one driver may take, as vsplat_doctor_options has it */
  vsplat_progress_function progress; /* of the run; may be NULL */
  void* user;
} vsplat_report_options;
#define VSPLAT_REPORT_OPTIONS_INIT \
  { sizeof(vsplat_report_options), 20, NULL, NULL }

/* All that helps to find out what is wrong on a machine. `device` may be NULL: nothing of OpenCL is used in this
   process then, and "device" and "run" are null. With one, the standard run is done: the model that the library carries
   reconstructs an object that needs no file, and draws it (vsplat_model_check), and its profile is told; where that
   fails, the report has the error. Folders of users are replaced by ~; their names and the machine's, in variables,
   paths and messages, by USER and HOST. `options` NULL: defaults. `out_text` becomes JSON, to be freed with
   vsplat_text_free: {"format": "vsplat-report", "version", "made": the day, "system", "environment", "doctor": what
   vsplat_doctor tells, "kept": [{"file", "content", "bytes"}], the tables, verdicts and measured peaks in the cache's
   folder, "device": {"index", "name", "driver", "kernels", "tuning", "limits", "switched_off", ...}, "run": {"check",
   "profile", "error"}}. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_report(vsplat_device device, const vsplat_report_options* options,
                                                        char** out_text);

#ifdef __cplusplus
}
#endif

#endif
